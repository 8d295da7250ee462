#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>

#include "tileflight/imaging/image.h"

namespace tileflight::dataset {

struct VideoInfo {
  int width = 0, height = 0;       ///< after rotation flags
  double frames_per_second = 0.0;  ///< average
  double duration_s = 0.0;
  std::int64_t frames_declared = 0;  ///< 0: the container does not say
};

struct VideoExcerpt {
  double from_s = 0.0;         ///< on the video's own clock, first frame at 0
  std::optional<double> to_s;  ///< exclusive
  int every = 1;               ///< each n-th frame of the excerpt
};

/// Size, rate and length as the container states them; nothing is decoded. Throws InputError (file, cause).
VideoInfo probe_video(const std::filesystem::path& file);

/// Decodes frames in display order (libav*) and calls `on_frame(index in the excerpt after stepping, time_s, image)`;
/// it returns false to stop. Throws InputError (file, time, cause) when the file is unreadable, ends early (fewer
/// frames than declared or a packet cut short) and the excerpt needs what is missing, or holds nothing in the excerpt.
/// Times are the file's own (variable rates too), the first frame at 0. Frames are turned as the rotation flag says.
void read_video(const std::filesystem::path& file, const VideoExcerpt& excerpt,
                const std::function<bool(std::int64_t index, double time_s, const imaging::RgbImage& image)>& on_frame);

/// How much a video may cost.
struct VideoRate {
  int crf = 18;                 ///< x264 constant rate factor, 0..51
  double megabits_per_s = 0.0;  ///< above 0: this on average, instead of a constant factor
};

struct VideoOptions {
  double frames_per_second = 30.0;
  VideoRate rate;
};

/// H.264 in MP4 (libx264 where libavcodec has it, else MPEG-4 part 2), yuv420p, single-threaded so that the bytes are
/// the same each time. Width and height must be even (chroma is halved): an odd size is an InputError, since padding or
/// cutting it would part the video from its calibration. Nothing is at `file` until finish(); destroyed without it,
/// what was written is removed.
class VideoWriter {
 public:
  VideoWriter(const std::filesystem::path& file, int width, int height, const VideoOptions& options);
  ~VideoWriter();
  VideoWriter(const VideoWriter&) = delete;
  VideoWriter& operator=(const VideoWriter&) = delete;
  /// The next frame; it must have the video's size.
  void add(const imaging::RgbImage& image);
  /// Throws InputError when the disk is full or there were no frames.
  void finish();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::dataset
