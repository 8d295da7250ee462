#pragma once

#include <filesystem>
#include <memory>
#include <string>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libswscale/swscale.h>
}

/// Shared by the video reader and writer: owners of libav* objects, and error texts.
namespace tileflight::video::libav {

struct Deleter {
  void operator()(AVFrame* frame) const { av_frame_free(&frame); }
  void operator()(AVPacket* packet) const { av_packet_free(&packet); }
  void operator()(AVCodecContext* codec) const { avcodec_free_context(&codec); }
  void operator()(SwsContext* scaler) const { sws_freeContext(scaler); }
};

template <class T>
using Owner = std::unique_ptr<T, Deleter>;

/// The text of an AVERROR code, e.g. "End of file".
inline std::string error_text(int code) {
  char text[AV_ERROR_MAX_STRING_SIZE] = "";
  av_strerror(code, text, sizeof text);
  return text;
}

/// A local file's name as a libav* URL, so that names such as "http:x" or "concat:a" are treated as files.
inline std::string file_url(const std::filesystem::path& file) { return "file:" + file.string(); }

/// Disables libav*'s own logging to stderr, which is a process-wide setting; errors are returned anyway.
inline void disable_logging() { av_log_set_level(AV_LOG_QUIET); }

}  // namespace tileflight::video::libav
