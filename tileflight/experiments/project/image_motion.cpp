#include "tileflight/experiments/project/image_motion.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/order_statistics.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/video/video.h"
#include "tileflight/slam/initialization/klt.h"
#include "tileflight/slam/keyframes/pyramid.h"
#include "tileflight/slam/odometry/image_examination.h"

namespace tileflight::project {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kPairs = 32;
constexpr std::size_t kFewestPairs = 3;  // from which anything is concluded
constexpr std::size_t kStills = 16;      // as many as find_static_pixels() looks at

/// Holds two consecutive frames of a video.
struct FramePair {
  double time_s = 0.0, period_s = 0.0;
  imaging::RgbImage first, second;
};

/// Reads the pair at a time of a video; nullopt if there are no two frames from there on.
std::optional<FramePair> read_pair_of_video(const Recording& recording, double time_s) {
  std::size_t part = 0;
  while (part + 1 < recording.parts.size() && recording.part_starts_s[part + 1] <= time_s) ++part;
  const double start_s = recording.part_starts_s[part];
  FramePair pair;
  const auto keep = [&](std::int64_t index, double frame_time_s, const imaging::RgbImage& image) {
    if (index == 0) {
      pair.time_s = start_s + frame_time_s;
      pair.first = image;
      return true;
    }
    pair.period_s = start_s + frame_time_s - pair.time_s;
    pair.second = image;
    return false;
  };
  video::read_video(recording.parts[part], {.from_s = time_s - start_s}, keep);
  if (pair.second.empty() || !(pair.period_s > 0.0)) return std::nullopt;
  return pair;
}

/// Reads the pair at a share, 0 to 1, of the recording.
std::optional<FramePair> read_pair(const Recording& recording, double share) {
  if (!recording.is_folder()) {
    const double last_s = std::max(recording.from_s, recording.to_s - 2.0 / recording.frames_per_second);
    return read_pair_of_video(recording, recording.from_s + share * (last_s - recording.from_s));
  }
  if (recording.images.size() < 2) return std::nullopt;
  const double last = static_cast<double>(recording.images.size() - 2);
  const double begin = std::min(last, recording.from_s * recording.frames_per_second);
  const double end = std::clamp(recording.to_s * recording.frames_per_second - 2.0, begin, last);
  const auto index = static_cast<std::size_t>(begin + share * (end - begin));
  const double period_s = 1.0 / recording.frames_per_second;
  FramePair pair{static_cast<double>(index) * period_s, period_s, imaging::read_rgb(recording.images[index]),
                 imaging::read_rgb(recording.images[index + 1])};
  if (pair.first.width != pair.second.width || pair.first.height != pair.second.height) return std::nullopt;
  return pair;
}

/// Follows corners from the first frame to the second, in images of 640 pixels.
std::optional<double> measure_motion(const FramePair& pair) {
  constexpr int kWidth_px = 640, kCorners = 300, kLevels = 5;
  constexpr std::size_t kFewest = 30;
  constexpr double kAnyFov_deg = 90.0;  // find_corners() uses the rays only to leave out pixels without one
  const int width = std::min(kWidth_px, pair.first.width);
  const int height =
      std::max(1, static_cast<int>(std::lround(static_cast<double>(pair.first.height) * width / pair.first.width)));
  const auto pyramid_of = [&](const imaging::RgbImage& image) {
    return keyframes::build_pyramid(imaging::downsample(keyframes::luminance(image, nullptr), width, height), kLevels);
  };
  const keyframes::Pyramid first = pyramid_of(pair.first), second = pyramid_of(pair.second);
  const keyframes::LensPyramid lens =
      keyframes::build_lens_pyramid(imaging::make_pinhole(width, height, kAnyFov_deg), 1);
  const std::vector<Eigen::Vector2f> corners = initialization::find_corners(first, lens.rays.front(), kCorners);
  const auto followed = initialization::track_corners(first, second, corners);
  std::vector<double> moved_px;
  for (std::size_t i = 0; i < corners.size(); ++i)
    if (followed[i]) moved_px.push_back(static_cast<double>((*followed[i] - corners[i]).norm()));
  if (moved_px.size() < kFewest) return std::nullopt;
  return base::median(moved_px) / width / pair.period_s;
}

/// Collects what pairs show.
class Findings {
 public:
  Findings(std::size_t pairs, const Progress& progress) : pairs_(pairs), progress_(progress) {}

  void add(const FramePair& pair) {
    report_progress(progress_, static_cast<std::int64_t>(count_), static_cast<std::int64_t>(pairs_),
                    "looking at the images");
    result_.motion.push_back({pair.time_s, measure_motion(pair)});
    if (pairs_ < kPairs || count_ % (kPairs / kStills) == 0) stills_.push_back(imaging::to_gray(pair.first));
    ++count_;
  }

  bool is_empty() const { return count_ == 0; }
  void add_fault(const InputError& fault) { base::add_distinct({fault.what()}, result_.warnings); }

  ImageFindings finish() {
    warn_of_blank_images();
    warn_of_still_images();
    result_.mask =
        odometry::find_static_pixels(stills_.size(), [&](std::size_t i) { return std::optional(stills_[i]); });
    return std::move(result_);
  }

 private:
  void warn_of_blank_images() {
    const auto images =
        odometry::summarize_images(stills_.size(), [&](std::size_t i) { return std::optional(stills_[i]); });
    for (const odometry::BlankImages& blank : odometry::find_blank_images(images))
      result_.warnings.push_back(
          base::formatted("%zu of %zu images that were looked at are %s one after the other: "
                          "nothing can be tracked in them",
                          blank.last - blank.first + 1, images.size(), blank.look.c_str()));
  }

  void warn_of_still_images() {
    constexpr double kStill = 0.002;  // share of the width a second: a tenth of what a slow flight shows
    const auto is_still = [](const MotionSample& sample) { return sample.share_per_s && *sample.share_per_s < kStill; };
    if (result_.motion.size() < kFewestPairs || !std::ranges::all_of(result_.motion, is_still)) return;
    result_.stands_still = true;
    result_.warnings.emplace_back(
        "the image hardly moves from frame to frame wherever it was looked at: a flight that stands still gives no "
        "map");
  }

  std::size_t pairs_, count_ = 0;
  const Progress& progress_;
  ImageFindings result_;
  std::vector<imaging::GrayImage> stills_;
};

/// Reads a short video once from its beginning, which takes less time than to seek: a seek decodes all frames from the
/// last one that is stored whole.
void examine_in_one_pass(const Recording& recording, std::size_t frames, Findings& findings) {
  const std::size_t step = std::max<std::size_t>(2, frames / kPairs);
  FramePair pair;
  video::VideoExcerpt part{.from_s = recording.from_s};
  if (recording.to_s < recording.duration_s) part.to_s = recording.to_s;
  video::read_video(recording.parts.front(), part,
                    [&](std::int64_t index, double time_s, const imaging::RgbImage& image) {
                      const std::size_t in_step = static_cast<std::size_t>(index) % step;
                      if (in_step == 0) {
                        pair.time_s = time_s;
                        pair.first = image;
                      } else if (in_step == 1) {
                        pair.period_s = time_s - pair.time_s;
                        pair.second = image;
                        findings.add(pair);
                      }
                      return true;
                    });
}

}  // namespace

ImageFindings examine_images(const Recording& recording, const Progress& progress) {
  constexpr double kMostInOnePass = 4000.0;  // frames
  const std::size_t pairs = recording.is_folder() ? std::min(kPairs, recording.images.size()) : kPairs;
  Findings findings(pairs, progress);
  const double frames = (recording.to_s - recording.from_s) * recording.frames_per_second;
  if (!recording.is_folder() && recording.parts.size() == 1 && frames < kMostInOnePass) {
    try {
      examine_in_one_pass(recording, static_cast<std::size_t>(frames), findings);
    } catch (const InputError& fault) {
      if (findings.is_empty()) throw;
      findings.add_fault(fault);
    }
    return findings.finish();
  }
  for (std::size_t i = 0; i < pairs; ++i) {
    try {
      const double share = static_cast<double>(i) / static_cast<double>(std::max<std::size_t>(1, pairs - 1));
      if (const std::optional<FramePair> pair = read_pair(recording, share)) findings.add(*pair);
    } catch (const InputError& fault) {
      if (findings.is_empty()) throw;
      findings.add_fault(fault);
    }
  }
  return findings.finish();
}

std::optional<FrameStep> choose_frame_step(const std::vector<MotionSample>& motion, double frames_per_second) {
  constexpr double kFast = 0.9, kMostShare = 0.01, kFewestPerSecond = 10.0;  // chosen by hand
  std::vector<double> shares;
  for (const MotionSample& sample : motion)
    if (sample.share_per_s) shares.push_back(*sample.share_per_s);
  if (shares.size() < kFewestPairs || !(frames_per_second > 0.0)) return std::nullopt;
  const double share_per_frame = base::lower_quantile(shares, kFast) / frames_per_second;
  const double most = std::max(1.0, frames_per_second / kFewestPerSecond);
  const double step = share_per_frame > 0.0 ? std::min(most, kMostShare / share_per_frame) : most;
  const int every = std::max(1, static_cast<int>(step));
  return FrameStep{every, every * share_per_frame};
}

}  // namespace tileflight::project
