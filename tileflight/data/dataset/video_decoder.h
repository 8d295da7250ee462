#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "tileflight/data/dataset/libav.h"
#include "tileflight/data/dataset/video.h"

namespace tileflight::dataset {

/// The video stream of a file, frame by frame in display order. All throw InputError (file, cause).
class VideoDecoder {
 public:
  explicit VideoDecoder(const std::filesystem::path& file);
  ~VideoDecoder();
  VideoDecoder(const VideoDecoder&) = delete;
  VideoDecoder& operator=(const VideoDecoder&) = delete;

  /// Size after rotation, frame rate and duration, without decoding.
  VideoInfo info() const;

  /// The next frame; nullptr after the last. Valid until the next call. For a truncated or damaged file, returns the
  /// frames before the fault, then throws.
  const AVFrame* next();
  /// Time of the frame returned by next(), seconds after the file's first frame.
  double time_s() const { return time_s_; }
  /// Whether parts of that frame could not be decoded. This also happens in sound files just after seek_before().
  bool is_damaged() const;

  /// Seeks to a frame at or before `time_s` if the file's index allows it, else to the first frame. Requires a previous
  /// next().
  void seek_before(double time_s);

  /// Clockwise quarter turns for display (the container's display matrix), 0 to 3.
  int quarter_turns() const { return quarter_turns_; }

 private:
  void open();
  void open_decoder();
  void read_rotation();
  bool has_full_index() const;
  void send_next_packet();
  void note_end(int code);
  bool is_incomplete() const;
  void note_time(const AVPacket& packet);
  std::string position_text() const;
  void restart_at(std::int64_t timestamp);
  double time_of(const AVFrame& frame);

  std::filesystem::path file_;
  AVFormatContext* format_ = nullptr;
  AVStream* stream_ = nullptr;
  libav::Owner<AVCodecContext> codec_;
  libav::Owner<AVFrame> frame_;
  libav::Owner<AVPacket> packet_;
  int quarter_turns_ = 0;
  std::optional<std::int64_t> first_timestamp_;
  double time_s_ = -1.0;
  bool has_seeked_ = false;                       ///< seek_before() has changed the position
  std::int64_t frames_ = 0;                       ///< returned since the file's start or the last seek
  std::int64_t packets_ = 0;                      ///< read since the last seek
  std::int64_t last_timestamp_ = AV_NOPTS_VALUE;  ///< decoding time of the last complete packet
  double end_s_ = 0.0;                            ///< end of the latest packet of any stream
  bool drained_ = false;
  std::string fault_;  ///< why reading stopped early; thrown after the frames before the fault were returned
};

}  // namespace tileflight::dataset
