#pragma once

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/cpu.h>
#include <libswscale/swscale.h>
}

#include "tileflight/core/base/input_error.h"

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

/// The rotation that a stream states, FFmpeg's nine numbers; null if it states none. FFmpeg 6 and later keep it
/// elsewhere.
inline const std::int32_t* display_matrix(const AVStream& stream) {
#if LIBAVCODEC_VERSION_INT >= AV_VERSION_INT(60, 29, 100)
  const AVPacketSideData* const found = av_packet_side_data_get(
      stream.codecpar->coded_side_data, stream.codecpar->nb_coded_side_data, AV_PKT_DATA_DISPLAYMATRIX);
  return found == nullptr ? nullptr : reinterpret_cast<const std::int32_t*>(found->data);
#else
  return reinterpret_cast<const std::int32_t*>(av_stream_get_side_data(&stream, AV_PKT_DATA_DISPLAYMATRIX, nullptr));
#endif
}

inline bool is_key_frame(const AVFrame& frame) {
#ifdef AV_FRAME_FLAG_KEY
  return (frame.flags & AV_FRAME_FLAG_KEY) != 0;
#else
  return frame.key_frame != 0;
#endif
}

inline bool is_interlaced(const AVFrame& frame) {
#ifdef AV_FRAME_FLAG_INTERLACED
  return (frame.flags & AV_FRAME_FLAG_INTERLACED) != 0;
#else
  return frame.interlaced_frame != 0;
#endif
}

/// The text of an AVERROR code, e.g. "End of file".
inline std::string error_text(int code) {
  char text[AV_ERROR_MAX_STRING_SIZE] = "";
  av_strerror(code, text, sizeof text);
  return text;
}

/// A local file's name as a libav* URL, so that names such as "http:x" or "concat:a" are treated as files.
inline std::string file_url(const std::filesystem::path& file) { return "file:" + file.string(); }

/// Returns the features of the processor that TILEFLIGHT_FFMPEG names (`sse2`, as FFmpeg's -cpuflags; 0: none), by
/// which tests show that results do not depend on them; nullptr: all that there are.
inline const char* forced_features() { return std::getenv("TILEFLIGHT_FFMPEG"); }

/// Sets what is the same for the whole process: no logging to stderr, since errors are returned anyway; and the
/// processor's features that may be used.
inline void set_process_wide() {
  av_log_set_level(AV_LOG_QUIET);
  [[maybe_unused]] static const bool kForced = [] {
    const char* const names = forced_features();
    unsigned features = 0;
    if (names == nullptr || av_parse_cpu_caps(&features, names) < 0) return false;
    av_force_cpu_flags(static_cast<int>(features));
    return true;
  }();
}

struct CloseInput {
  void operator()(AVFormatContext* context) const { avformat_close_input(&context); }
};
using OpenInput = std::unique_ptr<AVFormatContext, CloseInput>;

/// Opens a video and reads what it says of its streams. Throws InputError.
inline OpenInput open_input(const std::filesystem::path& file) {
  set_process_wide();
  AVFormatContext* context = nullptr;
  AVDictionary* options = nullptr;
  av_dict_set(&options, "protocol_whitelist", "file", 0);  // a playlist must not reach the network
  const int opened = avformat_open_input(&context, file_url(file).c_str(), nullptr, &options);
  av_dict_free(&options);
  if (opened < 0) throw InputError(file.string(), "cannot be opened as a video: " + error_text(opened));
  OpenInput input(context);
  const int found = avformat_find_stream_info(context, nullptr);
  if (found < 0) throw InputError(file.string(), "cannot be read as a video: " + error_text(found));
  return input;
}

/// Tells whether a stream holds a moving image: not a cover or a preview, which are single images.
inline bool is_moving_image(const AVStream& stream) {
  constexpr int kPicture = AV_DISPOSITION_ATTACHED_PIC | AV_DISPOSITION_TIMED_THUMBNAILS;
  return stream.codecpar->codec_type == AVMEDIA_TYPE_VIDEO && (stream.disposition & kPicture) == 0 &&
         stream.nb_frames != 1;
}

/// Returns the index of the stream whose images are the recording: of the moving images that which libavformat prefers,
/// else the first of them, else whatever it takes for a video; below 0: an AVERROR.
inline int find_video_stream(AVFormatContext& input) {
  const int preferred = av_find_best_stream(&input, AVMEDIA_TYPE_VIDEO, -1, -1, nullptr, 0);
  if (preferred >= 0 && is_moving_image(*input.streams[preferred])) return preferred;
  for (unsigned i = 0; i < input.nb_streams; ++i)
    if (is_moving_image(*input.streams[i])) return static_cast<int>(i);
  return preferred;
}

}  // namespace tileflight::video::libav
