#pragma once

#include <filesystem>
#include <memory>
#include <string>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libswscale/swscale.h>
}

/// What the video reader and writer share of libav*: owners of its objects, and its error texts.
namespace tileflight::dataset::libav {

struct Deleter {
  void operator()(AVFrame* frame) const { av_frame_free(&frame); }
  void operator()(AVPacket* packet) const { av_packet_free(&packet); }
  void operator()(AVCodecContext* codec) const { avcodec_free_context(&codec); }
  void operator()(SwsContext* scaler) const { sws_freeContext(scaler); }
};

template <class T>
using Owner = std::unique_ptr<T, Deleter>;

/// "End of file" of an AVERROR code.
std::string error_text(int code);

/// A local file's name as libav* wants it, so that names such as "http:x" or "concat:a" are files too.
std::string url_of(const std::filesystem::path& file);

/// libav* writes to stderr by itself, and only a setting of the whole process keeps it quiet; errors are returned
/// anyway.
void silence();

}  // namespace tileflight::dataset::libav
