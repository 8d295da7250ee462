#include "tileflight/data/dataset/libav.h"

namespace tileflight::dataset::libav {

std::string error_text(int code) {
  char text[AV_ERROR_MAX_STRING_SIZE] = "";
  av_strerror(code, text, sizeof text);
  return text;
}

std::string file_url(const std::filesystem::path& file) { return "file:" + file.string(); }

void disable_logging() { av_log_set_level(AV_LOG_QUIET); }

}  // namespace tileflight::dataset::libav
