#include "tileflight/flight/telemetry_file.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <string>

#include "tileflight/flight/gpx.h"
#include "tileflight/flight/log_text.h"

namespace tileflight::flight {
namespace {

enum class Format { kDjiSubtitles, kGpx };

std::string first_bytes(const std::filesystem::path& file) {
  std::array<char, 4096> bytes{};
  std::ifstream in(file, std::ios::binary);
  in.read(bytes.data(), bytes.size());
  return {bytes.data(), static_cast<std::size_t>(in.gcount())};
}

/// UTF-8 that begins with a tag, or UTF-16 (which only the XML among the formats is written in).
bool is_xml(std::string_view head) {
  return trimmed(without_byte_order_mark(head)).starts_with('<') || head.starts_with("\xFF\xFE") ||
         head.starts_with("\xFE\xFF");
}

Format format_of(const std::filesystem::path& file) {
  const std::string head = first_bytes(file);
  if (is_xml(head)) return Format::kGpx;
  return Format::kDjiSubtitles;
}

}  // namespace

Telemetry read_telemetry(const std::filesystem::path& file) {
  switch (format_of(file)) {
    case Format::kGpx:
      return read_gpx(file);
    case Format::kDjiSubtitles:
      break;
  }
  return read_dji_srt(file);
}

}  // namespace tileflight::flight
