#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "tileflight/dataset/libav.h"
#include "tileflight/dataset/video.h"

namespace tileflight::dataset {

/// The video stream of a file, frame by frame in display order. All throw InputError (file, cause).
class VideoDecoder {
 public:
  explicit VideoDecoder(const std::filesystem::path& file);
  ~VideoDecoder();
  VideoDecoder(const VideoDecoder&) = delete;
  VideoDecoder& operator=(const VideoDecoder&) = delete;

  /// Size after the rotation flag, rate, length; nothing is decoded.
  VideoInfo info() const;

  /// The next frame; nullptr after the last. It is valid until the next call. When the file is cut short or damaged,
  /// the frames before that place are given first, then it throws.
  const AVFrame* next();
  /// Of the frame that next() gave, seconds after the file's first frame.
  double time_s() const { return time_s_; }
  /// Whether parts of that frame could not be decoded. Frames just after seek_before() may be so in a sound file.
  bool is_damaged() const;

  /// Goes on at a frame at or before `time_s`, where the file's index allows; else at the first frame. Call after at
  /// least one next().
  void seek_before(double time_s);

  /// Quarter turns clockwise that a player makes (the container's display matrix), 0 to 3.
  int quarter_turns() const { return quarter_turns_; }

 private:
  void open();
  void open_decoder();
  void read_rotation();
  bool has_full_index() const;
  void feed();
  void note_end(int code);
  bool is_incomplete() const;
  void note_time(const AVPacket& packet);
  std::string place_text() const;
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
  bool searched_ = false;                         ///< seek_before() moved on
  std::int64_t frames_ = 0;                       ///< given since the file's start or the last seek
  std::int64_t packets_ = 0;                      ///< read since the last seek
  std::int64_t last_timestamp_ = AV_NOPTS_VALUE;  ///< decoding time of the last whole packet
  double end_s_ = 0.0;                            ///< end of the latest packet of any stream
  bool drained_ = false;
  std::string fault_;  ///< why reading stopped before the end; thrown once the frames before it are given
};

}  // namespace tileflight::dataset
