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
  double from_s = 0.0;                ///< on the video's own clock, first frame at 0
  std::optional<double> to_s;         ///< exclusive
  int every = 1;                      ///< each n-th frame of the excerpt
};

VideoInfo probe_video(const std::filesystem::path& file);

/// Decodes frames in display order (libav*) and calls `on_frame(index in the excerpt after stepping, time_s, image)`; it returns
/// false to stop. Throws InputError (file, time, cause) when the file is unreadable, ends early (fewer frames than
/// declared or a packet cut short), or holds nothing in the excerpt.
void read_video(const std::filesystem::path& file, const VideoExcerpt& excerpt,
                const std::function<bool(std::int64_t index, double time_s, const imaging::RgbImage& image)>& on_frame);

struct VideoOptions {
  double frames_per_second = 30.0;
  int crf = 18;  ///< x264 constant rate factor
};

/// H.264 in MP4 (libx264 where libavcodec has it, else MPEG-4 part 2), single-threaded so that the bytes are the same each time.
class VideoWriter {
 public:
  VideoWriter(const std::filesystem::path& file, int width, int height, const VideoOptions& options);
  ~VideoWriter();
  VideoWriter(const VideoWriter&) = delete;
  VideoWriter& operator=(const VideoWriter&) = delete;
  void add(const imaging::RgbImage& image);
  void finish();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::dataset
