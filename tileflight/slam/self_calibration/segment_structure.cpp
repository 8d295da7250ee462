#include "tileflight/slam/self_calibration/segment_structure.h"

#include <algorithm>
#include <cstdint>
#include <utility>

#include "tileflight/slam/initialization/bundle_adjustment.h"
#include "tileflight/slam/initialization/two_view.h"

namespace tileflight::self_calibration {
namespace {

using geometry::SE3;
using geometry::Vec2;
using geometry::Vec3;
using initialization::CornerTrack;
using initialization::RayPair;

// Chosen by hand. The thresholds are wide, because the lens may be wrong.
constexpr std::size_t kFewestCorners = 30;
constexpr double kShareInCommon = 0.4;  // of the first keyframe's corners, in the last one of the start
constexpr double kInlier_px = 3.0;
constexpr int kIterations = 12;
constexpr double kLeastParallax_px = 2.0;
constexpr double kMostBehind = 0.25;
constexpr std::size_t kFewestKeyframes = 4;
constexpr std::uint32_t kSeed = 1;

/// Corners of the first keyframe, with their pixels in keyframes 1 to `last`.
struct StartTracks {
  std::vector<CornerTrack> tracks;
  std::vector<std::size_t> track_of_segment;
};

std::size_t count_in(const Segment& segment, std::size_t keyframe) {
  return static_cast<std::size_t>(std::ranges::count_if(
      segment.tracks, [&](const SegmentTrack& track) { return track.points[0] && track.points[keyframe]; }));
}

StartTracks start_tracks(const keyframes::Lens& lens, const Segment& segment, std::size_t last) {
  StartTracks start;
  for (std::size_t i = 0; i < segment.tracks.size(); ++i) {
    const auto& points = segment.tracks[i].points;
    if (!points[0] || !points[last]) continue;
    const auto ray = lens.unproject(points[0]->pixel);
    if (!ray) continue;
    CornerTrack track{*ray, {}};
    for (std::size_t k = 1; k <= last; ++k)
      track.pixels.push_back(points[k] ? std::optional<Vec2>(points[k]->pixel) : std::nullopt);
    start.tracks.push_back(std::move(track));
    start.track_of_segment.push_back(i);
  }
  return start;
}

/// The last keyframe that shares enough corners with the first.
std::size_t last_of_start(const Segment& segment) {
  const auto enough =
      std::max(static_cast<double>(kFewestCorners), kShareInCommon * static_cast<double>(count_in(segment, 0)));
  std::size_t last = 0;
  for (std::size_t k = 1; k < segment.keyframes.size(); ++k)
    if (static_cast<double>(count_in(segment, k)) >= enough) last = k;
  return last;
}

std::optional<initialization::InitializationBundle> best_start(const keyframes::Lens& lens, const StartTracks& start,
                                                               std::size_t last) {
  std::vector<RayPair> pairs;
  for (const CornerTrack& track : start.tracks)
    if (const auto ray = lens.unproject(*track.pixels[last - 1])) pairs.push_back({track.ray, *ray});
  // Without parallax any lens fits.
  if (initialization::fit_rotation(pairs).median_rad * lens.focal_px() < kLeastParallax_px) return std::nullopt;
  std::optional<initialization::InitializationBundle> best;
  for (const SE3& pose : initialization::relative_pose_candidates(pairs, kInlier_px / lens.focal_px(), kSeed)) {
    auto bundle = initialization::bundle_adjust(lens, start.tracks, last, pose, kIterations);
    if (bundle.behind_share < kMostBehind && (!best || bundle.cost < best->cost)) best = std::move(bundle);
  }
  return best;
}

/// Tracks of the known corners for initialization::resect, whose only image is the one that `pixel_of` names.
template <class PixelOf>
std::pair<std::vector<CornerTrack>, std::vector<double>> known_corners(const Segment& segment,
                                                                       const SegmentStructure& structure,
                                                                       const PixelOf& pixel_of) {
  std::pair<std::vector<CornerTrack>, std::vector<double>> known;
  for (std::size_t i = 0; i < segment.tracks.size(); ++i) {
    const StructurePoint& point = structure.points[i];
    if (!point.fits) continue;
    const std::optional<Vec2> pixel = pixel_of(segment.tracks[i]);
    if (!pixel) continue;
    known.first.push_back({point.direction, {pixel}});
    known.second.push_back(point.rho);
  }
  return known;
}

std::optional<Vec2> pixel_in(const SegmentTrack& track, std::size_t keyframe) {
  return track.points[keyframe] ? std::optional<Vec2>(track.points[keyframe]->pixel) : std::nullopt;
}

/// Triangulates corners that are seen in keyframe `last` and were first seen at least two keyframes before.
void add_points(const keyframes::Lens& lens, const Segment& segment, std::size_t last, SegmentStructure& structure) {
  constexpr std::size_t kApart = 2;
  for (std::size_t i = 0; i < segment.tracks.size(); ++i) {
    StructurePoint& point = structure.points[i];
    const auto& seen = segment.tracks[i].points;
    if (point.fits || !seen[last]) continue;
    const auto host = static_cast<std::size_t>(std::ranges::find_if(seen, [](const auto& p) { return p.has_value(); }) -
                                               seen.begin());
    if (host + kApart > last) continue;
    const auto ray = lens.unproject(seen[host]->pixel), other = lens.unproject(seen[last]->pixel);
    if (!ray || !other) continue;
    const SE3 T_segment_host = structure.T_camera_segment[host].inverse();
    const SE3 T_last_host = structure.T_camera_segment[last] * T_segment_host;
    const double rho = std::max(0.0, initialization::triangulate_inverse_distance(T_last_host, {*ray, *other}));
    const Vec3 direction = T_segment_host.rotation * *ray + rho * T_segment_host.translation;
    const double length = direction.norm();
    point = {direction / length, rho / length, true, true};
  }
}

}  // namespace

std::optional<SegmentStructure> start_structure(const imaging::Camera& camera, const Segment& segment) {
  if (segment.keyframes.size() < kFewestKeyframes) return std::nullopt;
  const keyframes::Lens lens(camera);
  const std::size_t last = last_of_start(segment);
  if (last < 2) return std::nullopt;
  const StartTracks start = start_tracks(lens, segment, last);
  if (start.tracks.size() < kFewestCorners) return std::nullopt;
  const auto bundle = best_start(lens, start, last);
  if (!bundle) return std::nullopt;
  SegmentStructure structure;
  structure.points.resize(segment.tracks.size());
  structure.T_camera_segment = {SE3()};
  structure.T_camera_segment.insert(structure.T_camera_segment.end(), bundle->T_camera_first.begin(),
                                    bundle->T_camera_first.end());
  for (std::size_t i = 0; i < start.tracks.size(); ++i)
    structure.points[start.track_of_segment[i]] = {start.tracks[i].ray, bundle->rho[i], true, true};
  for (std::size_t k = 2; k <= last; ++k) add_points(lens, segment, k, structure);
  for (std::size_t k = last + 1; k < segment.keyframes.size(); ++k) {
    const auto [tracks, rho] =
        known_corners(segment, structure, [&](const SegmentTrack& track) { return pixel_in(track, k); });
    if (tracks.size() < kFewestCorners) break;
    structure.T_camera_segment.push_back(
        initialization::resect(lens, tracks, rho, 0, structure.T_camera_segment.back()));
    add_points(lens, segment, k, structure);
  }
  if (structure.T_camera_segment.size() < kFewestKeyframes) return std::nullopt;
  structure.velocities.assign(structure.T_camera_segment.size(), geometry::Vec6::Zero());
  return structure;
}

void estimate_velocities(const imaging::Camera& camera, const Segment& segment, SegmentStructure& structure) {
  const keyframes::Lens lens(camera);
  for (std::size_t k = 0; k < structure.T_camera_segment.size(); ++k) {
    const SE3& T = structure.T_camera_segment[k];
    const auto pose_by = [&](std::optional<Vec2> TrackPoint::*side) {
      const auto [tracks, rho] = known_corners(segment, structure, [&](const SegmentTrack& track) {
        return track.points[k] ? (*track.points[k]).*side : std::nullopt;
      });
      return tracks.size() < kFewestCorners ? T : initialization::resect(lens, tracks, rho, 0, T);
    };
    const SegmentKeyframe& times = segment.keyframes[k];
    const SE3 T_before = times.before_s < times.time_s ? pose_by(&TrackPoint::before) : T;
    const SE3 T_after = times.after_s > times.time_s ? pose_by(&TrackPoint::after) : T;
    const double interval_s = times.after_s - times.before_s;
    structure.velocities[k] =
        interval_s > 0.0 ? geometry::Vec6((T_after * T_before.inverse()).log() / interval_s) : geometry::Vec6::Zero();
  }
}

}  // namespace tileflight::self_calibration
