#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/imaging/image.h"

namespace tileflight::video {

/// Properties of a video.
struct VideoInfo {
  int width = 0, height = 0;       ///< after rotation flags
  double frames_per_second = 0.0;  ///< average
  double duration_s = 0.0;
  int quarter_turns = 0;             ///< clockwise, 0 to 3: by which the rotation flags turn the stored images
  std::int64_t declared_frames = 0;  ///< 0: not declared by the container
  std::string creation_time;         ///< as the container has it (ISO 8601, UTC); empty: not declared
  double pixel_aspect = 1.0;         ///< width of a pixel as it is meant to be shown, divided by its height
  /// Lines that say why its images are not plain, and what that means for a calibration and for odometry: they name a
  /// rotation flag, pixels that are not square, high dynamic range, interlacing, several videos in the file.
  std::vector<std::string> notes;
};

/// The part of a video to read.
struct VideoExcerpt {
  double from_s = 0.0;         ///< on the video's own clock, first frame at 0
  std::optional<double> to_s;  ///< exclusive
  int every = 1;               ///< each n-th frame of the excerpt
};

/// Size, frame rate and duration as declared by the container, without decoding. Throws InputError (file, cause).
VideoInfo probe_video(const std::filesystem::path& file);

/// Returns how a video's images come to have their size, in a clause, where a calibration may be for another one:
/// turned by a flag, or of pixels that are not square. Empty: they are as they are stored and shown.
std::string describe_size(const VideoInfo& info);

/// Decodes frames in display order (libav*) and calls `on_frame(index in the excerpt after stepping, time_s, image)`,
/// which returns false to stop. Throws InputError (file, time, cause) if the file is unreadable, if it ends early
/// (fewer frames than declared, or a truncated packet) before the excerpt's end, if the frames' size changes or their
/// times go back within it, or if the excerpt is empty. Times are the file's own (also variable rates), the first frame
/// at 0. Frames are rotated by the rotation flag; those of high dynamic range are mapped to sRGB. Damage before the
/// excerpt is skipped. The result is notes, a line each: if the excerpt's first frames are predicted from damaged ones,
/// if there are gaps in the times, if frames turn out to be interlaced.
std::vector<std::string> read_video(
    const std::filesystem::path& file, const VideoExcerpt& excerpt,
    const std::function<bool(std::int64_t index, double time_s, const imaging::RgbImage& image)>& on_frame);

/// Returns the positions of the images that follow a gap in the times, which increase: half a second or more, and ten
/// times as long as is usual.
std::vector<std::size_t> find_gaps(const std::vector<double>& times_s);

/// Returns the first text track of a video (MP4's timed text, Matroska's SubRip) as the text of an .srt file, with
/// times after the first frame; empty if there is none. Throws InputError (file, cause) for a file that is no video.
std::string read_subtitles(const std::filesystem::path& file);

/// Compression of a video.
struct VideoCompression {
  int crf = 18;                 ///< x264 constant rate factor, 0..51
  double megabits_per_s = 0.0;  ///< if above 0: average bit rate, instead of a constant rate factor
};

/// Options of a VideoWriter.
struct VideoOptions {
  double frames_per_second = 30.0;
  VideoCompression compression;
};

/// Writes H.264 in MP4 (libx264 if libavcodec has it, else MPEG-4 part 2), yuv420p, single-threaded so that the bytes
/// are reproducible. Width and height must be even (chroma is subsampled by 2): an odd size is an InputError, since
/// padding or cropping would invalidate the calibration. `file` appears only in finish(); without it, the destructor
/// removes what was written.
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

}  // namespace tileflight::video
