#include "tileflight/experiments/project/image_motion.h"

#include <algorithm>
#include <cmath>
#include <utility>

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

/// Holds two frames of a video, the second the next one that differs.
struct FramePair {
  double time_s = 0.0, period_s = 0.0;
  imaging::RgbImage first, second;
};

/// Returns every n-th pixel of an image, so that some 320 are left across.
imaging::GrayImage thinned(const imaging::RgbImage& image) {
  constexpr int kAcross = 320;
  const int step = std::max(1, image.width / kAcross);
  imaging::RgbImage thin((image.width + step - 1) / step, (image.height + step - 1) / step);
  for (int y = 0; y < thin.height; ++y)
    for (int x = 0; x < thin.width; ++x) thin(x, y) = image(x * step, y * step);
  return imaging::to_gray(thin);
}

/// Returns the mean difference of two images of one size, grey values.
double mean_difference(const imaging::GrayImage& a, const imaging::GrayImage& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) sum += std::abs(static_cast<int>(a.pixels[i]) - b.pixels[i]);
  return sum / static_cast<double>(std::max<std::size_t>(1, a.pixels.size()));
}

/// Finds pairs of frames that differ among consecutive ones. Where none differs, the image stands still, and frames
/// that are equal make a pair.
class PairFinder {
 public:
  /// Begins another part: the next frame follows nothing.
  void restart() {
    last_ = {};
    pair_ = {};
    equal_ = 0;
    changes_.emplace_back(std::nullopt);
  }

  /// Takes the next frame; returns the pair that it completes. `wants_pair`: whether it may begin one, which the first
  /// frames of a part do not, since it takes some to know how much frames differ.
  std::optional<FramePair> add(double time_s, const imaging::RgbImage& image, bool wants_pair) {
    constexpr double kEqual = 0.1;  // grey values
    constexpr int kMostEqual = 8;   // frames
    constexpr std::size_t kKnown = 4;
    imaging::GrayImage thin = thinned(image);
    const bool follows = thin.width == last_.width && thin.height == last_.height;
    const double change = follows ? mean_difference(thin, last_) : 0.0;
    last_ = std::move(thin);
    const double usual = largest_before(changes_.size());
    if (follows) changes_.emplace_back(change);
    equal_ = change < std::max(kEqual, kRepeats * usual) ? equal_ + 1 : 0;
    frames_ = follows ? frames_ + 1 : 0;
    if (equal_ > 0 && equal_ < kMostEqual) return std::nullopt;
    equal_ = 0;
    if (pair_.first.empty()) {
      if (wants_pair && frames_ >= kKnown) pair_ = {time_s, 0.0, image, {}};
      return std::nullopt;
    }
    FramePair complete = std::exchange(pair_, {});
    complete.period_s = time_s - complete.time_s;
    complete.second = image;
    return complete;
  }

  /// Returns the last frame, thinned.
  const imaging::GrayImage& last() const { return last_; }

  /// Returns the share of the frames that repeat the one before while the image moves; nullopt: it hardly moves.
  std::optional<double> repeated_share() const {
    constexpr std::size_t kFewest = 20;
    constexpr double kMoves = 0.3;  // grey values
    std::size_t moving = 0, repeated = 0;
    for (std::size_t i = 0; i < changes_.size(); ++i) {
      if (!changes_[i]) continue;
      double around = largest_before(i);
      for (std::size_t k = i + 1; k < changes_.size() && k - i <= kReach && changes_[k]; ++k)
        around = std::max(around, *changes_[k]);
      if (std::max(around, *changes_[i]) < kMoves) continue;
      ++moving;
      if (*changes_[i] < kRepeats * around) ++repeated;
    }
    if (moving < kFewest) return std::nullopt;
    return static_cast<double>(repeated) / static_cast<double>(moving);
  }

 private:
  // An image that is stored again is compressed again: it differs by up to a third of what the next one does.
  static constexpr double kRepeats = 0.35;
  static constexpr std::size_t kReach = 4;

  /// Returns the largest of the changes just before one, in the same part.
  double largest_before(std::size_t change) const {
    double largest = 0.0;
    for (std::size_t k = change; k-- > 0 && change - k <= kReach && changes_[k];)
      largest = std::max(largest, *changes_[k]);
    return largest;
  }

  FramePair pair_;
  imaging::GrayImage last_;
  std::size_t frames_ = 0;                      ///< before the last one, in its part
  int equal_ = 0;                               ///< frames since the last one that differed from the one before
  std::vector<std::optional<double>> changes_;  ///< from frame to frame, grey values; nullopt between parts
};

/// Reads the pair at a time of a video; nullopt if there are no two frames from there on.
std::optional<FramePair> read_pair_of_video(const Recording& recording, double time_s, PairFinder& finder) {
  std::size_t part = 0;
  while (part + 1 < recording.parts.size() && recording.part_starts_s[part + 1] <= time_s) ++part;
  const double start_s = recording.part_starts_s[part];
  std::optional<FramePair> pair;
  const auto keep = [&](std::int64_t, double frame_time_s, const imaging::RgbImage& image) {
    pair = finder.add(start_s + frame_time_s, image, true);
    return !pair;
  };
  finder.restart();
  video::read_video(recording.parts[part], {.from_s = time_s - start_s}, keep);
  return pair;
}

/// Reads the pair at a share, 0 to 1, of the recording.
std::optional<FramePair> read_pair(const Recording& recording, double share, PairFinder& finder) {
  if (!recording.is_folder()) {
    const double last_s = std::max(recording.from_s, recording.to_s - 12.0 / recording.frames_per_second);
    return read_pair_of_video(recording, recording.from_s + share * (last_s - recording.from_s), finder);
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
  void add_warnings(const std::vector<std::string>& texts) { base::add_distinct(texts, result_.warnings); }
  void add_breaks(std::vector<Break> breaks) { result_.breaks = std::move(breaks); }

  /// `share`: PairFinder::repeated_share().
  void add_repeats(const std::optional<double>& share) {
    constexpr double kFew = 0.08, kRounding = 0.04;
    if (!share || *share < kFew) return;
    const double stored = 1.0 / std::max(1.0 - *share, 0.01);
    const int times = static_cast<int>(std::lround(stored));
    const std::string start = base::formatted("%.0f %% of the images repeat the one before: ", 100 * *share);
    if (times > 1 && std::abs(*share - (1.0 - 1.0 / times)) < kRounding) {
      result_.repeats = times;
      result_.warnings.push_back(start + base::formatted("each is stored %d times, and is taken once", times));
      return;
    }
    result_.warnings.push_back(start +
                               "the recording was converted to another rate, or its camera lost images; their times "
                               "are wrong by up to one image");
  }

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

/// Holds all frames of a video in small, and finds where they do not go on.
class WholeVideo {
 public:
  WholeVideo(std::size_t frames, Findings& findings)
      : step_(std::max<std::size_t>(2, frames / kPairs)), findings_(findings) {}

  void add(double time_s, const imaging::RgbImage& image) {
    if (const auto pair = finder_.add(time_s, image, times_s_.size() >= next_pair_)) {
      findings_.add(*pair);
      next_pair_ += step_;
    }
    times_s_.push_back(time_s);
    const auto thin = [&](std::size_t) { return std::optional(finder_.last()); };
    images_.push_back(odometry::summarize_images(1, thin).front());
  }

  /// Notes that what follows the last frame cannot be read.
  void add_fault() {
    finder_.restart();
    faults_.push_back(times_s_.size());
  }

  std::size_t frames() const { return times_s_.size(); }
  double last_s() const { return times_s_.empty() ? 0.0 : times_s_.back(); }

  void finish() {
    findings_.add_repeats(finder_.repeated_share());
    if (times_s_.size() < 2) return;
    std::vector<Break> breaks;
    for (const std::size_t next : faults_)
      add_break(next, base::formatted("images cannot be read after %.2f s", times_s_.at(next - 1)), breaks);
    for (const std::size_t next : odometry::find_cuts(images_)) {
      if (std::ranges::count(faults_, next) > 0) continue;
      const std::string what = base::formatted("the video is cut at %.2f s", times_s_[next]);
      findings_.add_warnings({what + ": what follows shows something else"});
      add_break(next, what, breaks);
    }
    for (const std::size_t next : video::find_gaps(times_s_)) {
      if (std::ranges::count(faults_, next) > 0) continue;
      add_break(next,
                base::formatted("no image was recorded for %.2f s after %.2f s", times_s_[next] - times_s_[next - 1],
                                times_s_[next - 1]),
                breaks);
    }
    std::ranges::stable_sort(breaks, {}, &Break::last_s);
    findings_.add_breaks(std::move(breaks));
  }

 private:
  /// `next`: the frame that follows the break; the number of all frames: none does.
  void add_break(std::size_t next, std::string what, std::vector<Break>& breaks) const {
    const std::optional<double> next_s = next < times_s_.size() ? std::optional(times_s_[next]) : std::nullopt;
    breaks.push_back({times_s_.at(next - 1), next_s, std::move(what)});
  }

  std::size_t step_, next_pair_ = 0;
  Findings& findings_;
  PairFinder finder_;
  std::vector<double> times_s_;
  std::vector<odometry::ImageSummary> images_;
  std::vector<std::size_t> faults_;  ///< frames before which some could not be read
};

/// Reads a short video once from its beginning, which takes less time than to seek: a seek decodes all frames from the
/// last one that is stored whole. Goes on behind damage.
void examine_in_one_pass(const Recording& recording, std::size_t frames, Findings& findings) {
  constexpr int kMostFaults = 4;
  constexpr double kSkipped_s = 1.0;  // behind a fault
  WholeVideo whole(frames, findings);
  video::VideoExcerpt part{.from_s = recording.from_s};
  if (recording.to_s < recording.duration_s) part.to_s = recording.to_s;
  for (int faults = 0; faults < kMostFaults; ++faults) {
    const std::size_t before = whole.frames();
    try {
      findings.add_warnings(video::read_video(recording.parts.front(), part,
                                              [&](std::int64_t, double time_s, const imaging::RgbImage& image) {
                                                whole.add(time_s, image);
                                                return true;
                                              }));
      break;
    } catch (const InputError& fault) {
      if (findings.is_empty()) throw;
      if (whole.frames() == before) break;  // nothing is left behind the fault
      findings.add_fault(fault);
      whole.add_fault();
      part.from_s = whole.last_s() + kSkipped_s;
      if (part.to_s && part.from_s >= *part.to_s) break;
    }
  }
  whole.finish();
}

}  // namespace

ImageFindings examine_images(const Recording& recording, const Progress& progress) {
  constexpr double kMostInOnePass = 4000.0;  // frames
  const std::size_t pairs = recording.is_folder() ? std::min(kPairs, recording.images.size()) : kPairs;
  Findings findings(pairs, progress);
  const double frames = (recording.to_s - recording.from_s) * recording.frames_per_second;
  if (!recording.is_folder() && recording.parts.size() == 1 && frames < kMostInOnePass) {
    examine_in_one_pass(recording, static_cast<std::size_t>(frames), findings);
    return findings.finish();
  }
  PairFinder finder;
  for (std::size_t i = 0; i < pairs; ++i) {
    try {
      const double share = static_cast<double>(i) / static_cast<double>(std::max<std::size_t>(1, pairs - 1));
      if (const std::optional<FramePair> pair = read_pair(recording, share, finder)) findings.add(*pair);
    } catch (const InputError& fault) {
      if (findings.is_empty()) throw;
      findings.add_fault(fault);
    }
  }
  findings.add_repeats(finder.repeated_share());
  return findings.finish();
}

std::optional<FrameStep> choose_frame_step(const std::vector<MotionSample>& motion, double frames_per_second,
                                           int repeats) {
  constexpr double kFast = 0.9, kMostShare = 0.01, kFewestPerSecond = 10.0;  // chosen by hand
  std::vector<double> shares;
  for (const MotionSample& sample : motion)
    if (sample.share_per_s) shares.push_back(*sample.share_per_s);
  if (shares.size() < kFewestPairs || !(frames_per_second > 0.0)) return std::nullopt;
  const double share_per_frame = base::lower_quantile(shares, kFast) / frames_per_second;
  const double most = std::max(1.0, frames_per_second / kFewestPerSecond);
  const double step = share_per_frame > 0.0 ? std::min(most, kMostShare / share_per_frame) : most;
  const int every = std::max(repeats, static_cast<int>(step) / repeats * repeats);
  return FrameStep{every, every * share_per_frame};
}

}  // namespace tileflight::project
