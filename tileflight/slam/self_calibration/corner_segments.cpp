#include "tileflight/slam/self_calibration/corner_segments.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "tileflight/core/base/order_statistics.h"
#include "tileflight/slam/initialization/klt.h"

namespace tileflight::self_calibration {
namespace {

// Chosen by hand.
constexpr std::size_t kFewestFollowed = 40;
constexpr double kShareOfKeyframe = 0.7;  // of a keyframe's corners: when fewer are left, the next keyframe is due
constexpr double kApart = 1.0 / 40.0;     // new corners are as far from the others, as a share of the width
constexpr std::ptrdiff_t kFewestKeyframesSeen = 3;

/// Clears the rays around a pixel.
void clear_around(const Eigen::Vector2f& pixel, int reach, keyframes::RayTable& table) {
  const int x0 = static_cast<int>(pixel.x()), y0 = static_cast<int>(pixel.y());
  for (int y = std::max(0, y0 - reach); y <= std::min(table.height - 1, y0 + reach); ++y)
    for (int x = std::max(0, x0 - reach); x <= std::min(table.width - 1, x0 + reach); ++x)
      table.rays[static_cast<std::size_t>(y) * table.width + x].setZero();
}

}  // namespace

bool SegmentFollower::add(double time_s, const std::shared_ptr<const keyframes::Pyramid>& pyramid) {
  if (keyframes_.size() >= options_.keyframes && !follows_keyframe_) return false;
  if (previous_) {
    follow(*pyramid);
    if (follows_keyframe_) note_after(time_s);
    if (keyframes_.size() >= options_.keyframes || images_ >= options_.images || alive() < kFewestFollowed)
      return false;
  }
  ++images_;
  follows_keyframe_ = !previous_ || is_keyframe_due();
  if (follows_keyframe_) add_keyframe(time_s, *pyramid);
  previous_ = pyramid;
  previous_s_ = time_s;
  return true;
}

Segment SegmentFollower::finish() {
  Segment segment{std::move(keyframes_), {}};
  for (Corner& corner : corners_) {
    corner.points.resize(segment.keyframes.size());
    const auto views = std::ranges::count_if(corner.points, [](const auto& point) { return point.has_value(); });
    if (views >= kFewestKeyframesSeen) segment.tracks.push_back({std::move(corner.points)});
  }
  return segment;
}

void SegmentFollower::follow(const keyframes::Pyramid& pyramid) {
  std::vector<Eigen::Vector2f> from;
  for (const Corner& corner : corners_)
    if (corner.pixel) from.push_back(*corner.pixel);
  const auto found = initialization::track_corners(*previous_, pyramid, from);
  std::size_t next = 0;
  for (Corner& corner : corners_) {
    if (!corner.pixel) continue;
    corner.before = corner.pixel;
    corner.pixel = found[next++];
  }
}

/// Takes up where the corners of the last keyframe are in the image after it.
void SegmentFollower::note_after(double time_s) {
  keyframes_.back().after_s = time_s;
  const std::size_t last = keyframes_.size() - 1;
  for (Corner& corner : corners_) {
    if (corner.pixel && corner.points.size() > last && corner.points[last])
      corner.points[last]->after = corner.pixel->cast<double>();
  }
  follows_keyframe_ = false;
}

bool SegmentFollower::is_keyframe_due() const {
  std::vector<float> motions;
  std::size_t seen = 0;
  for (const Corner& corner : corners_) {
    if (corner.points.size() < keyframes_.size() || !corner.points.back()) continue;
    ++seen;
    if (corner.pixel) motions.push_back((*corner.pixel - corner.points.back()->pixel.cast<float>()).norm());
  }
  if (motions.empty() || static_cast<double>(motions.size()) < kShareOfKeyframe * static_cast<double>(seen))
    return true;
  return base::upper_median(std::move(motions)) > options_.keyframe_motion * region_.width;
}

/// Moves the corners to where their patches are. Corners whose patches are not found are lost.
void SegmentFollower::align_patches(const keyframes::PyramidLevel& image) {
  tbb::parallel_for(std::size_t{0}, corners_.size(), [&](std::size_t i) {
    Corner& corner = corners_[i];
    if (!corner.pixel) return;
    const auto warp = corner.patch.align(image, {corner.warp.shape, corner.pixel->cast<double>()});
    if (!warp) {
      corner.pixel.reset();
      return;
    }
    const Eigen::Vector2f pixel = warp->pixel.cast<float>();
    if (corner.before) *corner.before += pixel - *corner.pixel;
    corner.pixel = pixel;
    corner.warp = *warp;
  });
}

void SegmentFollower::add_keyframe(double time_s, const keyframes::Pyramid& pyramid) {
  align_patches(pyramid.levels.front());
  const std::size_t index = keyframes_.size();
  keyframes_.push_back({time_s, previous_ ? previous_s_ : time_s, time_s});
  for (Corner& corner : corners_) {
    if (!corner.pixel) continue;
    corner.points.resize(index);
    corner.points.emplace_back(TrackPoint{corner.pixel->cast<double>(), {}, {}});
    if (corner.before) corner.points.back()->before = corner.before->cast<double>();
  }
  find_new_corners(pyramid);
}

void SegmentFollower::find_new_corners(const keyframes::Pyramid& pyramid) {
  const auto missing = options_.corners - static_cast<int>(alive());
  if (missing <= 0) return;
  keyframes::RayTable free = region_;
  const int reach = static_cast<int>(kApart * region_.width);
  for (const Corner& corner : corners_)
    if (corner.pixel) clear_around(*corner.pixel, reach, free);
  std::vector<Eigen::Vector2f> found = initialization::find_corners(pyramid, free, options_.corners);
  if (static_cast<int>(found.size()) > missing) found.resize(missing);
  for (const Eigen::Vector2f& pixel : found) {
    const Patch patch(pyramid.levels.front(), static_cast<int>(pixel.x()), static_cast<int>(pixel.y()));
    Corner corner{.points = {}, .pixel = pixel, .before = {}, .patch = patch, .warp = {}};
    corner.points.resize(keyframes_.size() - 1);
    corner.points.emplace_back(TrackPoint{pixel.cast<double>(), {}, {}});
    corners_.push_back(std::move(corner));
  }
}

std::size_t SegmentFollower::alive() const {
  return static_cast<std::size_t>(std::ranges::count_if(corners_, [](const auto& c) { return c.pixel.has_value(); }));
}

}  // namespace tileflight::self_calibration
