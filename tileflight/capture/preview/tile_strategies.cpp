#include "tileflight/capture/preview/tile_strategies.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tileflight::preview {
namespace {

using geometry::Mat3;
using geometry::SE3;
using geometry::Vec3;
using tileset::RefinementCriterion;

constexpr double kMaxPinholeFov_deg = 170.0;

/// Camera pose that looks straight down, with north at the top of the image.
SE3 nadir_pose(const Vec3& from) {
  Mat3 r;
  r << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  return {r, from};
}

/// A pose above the region's centre at the lowest height at which the region's top fills the view.
SE3 overview_pose(const StrategySettings& s) {
  const double tan_x = std::tan(s.viewer.horizontal_fov_deg * std::numbers::pi / 360.0);
  const double tan_y = tan_x * s.viewer.height / s.viewer.width;
  const double above_m = std::max(s.region.size.x() / 2 / tan_x, s.region.size.y() / 2 / tan_y);
  return nadir_pose(s.region.center + Vec3(0, 0, s.region.size.z() / 2 + above_m));
}

/// The flight's own lens as a viewer's camera.
tileset::ViewerCamera sensor_viewer(const StrategySettings& s) {
  tileset::ViewerCamera viewer = s.viewer;
  viewer.width = s.camera.width();
  viewer.height = s.camera.height();
  viewer.horizontal_fov_deg = std::min(s.camera.horizontal_fov_deg(), kMaxPinholeFov_deg);
  return viewer;
}

RefinementCriterion criterion_from_pose(tileset::ViewerCamera viewer, const SE3& pose, const StrategySettings& s) {
  viewer.T_local_camera = pose;
  return limit_refinement(viewer_criterion(viewer, s.T_local_tileset), s.error_m);
}

}  // namespace

std::vector<TileStrategy> make_tile_strategies(const StrategySettings& s) {
  const auto above_drone = [s](const SE3& pose) {
    return criterion_from_pose(s.viewer, nadir_pose(pose.translation + Vec3(0, 0, s.follow_height_m)), s);
  };
  const RefinementCriterion high = criterion_from_pose(s.viewer, overview_pose(s), s);
  const RefinementCriterion flight = limit_refinement(
      tileset::flight_criterion(tileset::view_cones_along(s.camera, s.T_local_camera), s.T_local_tileset, s.error_px),
      s.error_m);
  const RefinementCriterion region = tileset::region_criterion(s.region, s.T_local_tileset, s.error_m);
  return {
      {"view-follow", "a viewer's camera above the drone, looking down", false, above_drone},
      {"view-high", "a viewer's camera high above the region", true, [high](const SE3&) { return high; }},
      {"sensor", "a viewer with the sensor's own view", false,
       [s](const SE3& pose) { return criterion_from_pose(sensor_viewer(s), pose, s); }},
      {"flight", "one set of tiles for all frames, by screen-space error", true,
       [flight](const SE3&) { return flight; }},
      {"region", "one set of tiles for the region, by geometric error", true, [region](const SE3&) { return region; }}};
}

RefinementCriterion full_detail_criterion(const StrategySettings& s) {
  return limit_refinement(
      tileset::flight_criterion(tileset::view_cones_along(s.camera, s.T_local_camera), s.T_local_tileset, 0.0), s.error_m);
}

}  // namespace tileflight::preview
