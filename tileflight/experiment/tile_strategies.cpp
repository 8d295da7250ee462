#include "tileflight/experiment/tile_strategies.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tileflight::experiment {
namespace {

using geometry::Mat3;
using geometry::SE3;
using geometry::Vec3;
using tiles::BoundingVolume;
using tiles::Wanted;

constexpr double kWidestPinhole_deg = 170.0;

/// Camera that looks straight down, image top to the north.
SE3 looking_down(const Vec3& from) {
  Mat3 r;
  r << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  return {r, from};
}

/// Above the middle of the region, just so high that its top fills the view.
SE3 high_above(const StrategySettings& s) {
  const double tan_x = std::tan(s.viewer.horizontal_fov_deg * std::numbers::pi / 360.0);
  const double tan_y = tan_x * s.viewer.height / s.viewer.width;
  const double above_m = std::max(s.region.size.x() / 2 / tan_x, s.region.size.y() / 2 / tan_y);
  return looking_down(s.region.center + Vec3(0, 0, s.region.size.z() / 2 + above_m));
}

/// The flight's own lens, as such a viewer would have it.
tiles::ViewerCamera sensor_viewer(const StrategySettings& s) {
  tiles::ViewerCamera viewer = s.viewer;
  viewer.width = s.camera.width();
  viewer.height = s.camera.height();
  viewer.horizontal_fov_deg = std::min(s.camera.horizontal_fov_deg(), kWidestPinhole_deg);
  return viewer;
}

Wanted view_from(tiles::ViewerCamera viewer, const SE3& pose, const StrategySettings& s) {
  viewer.T_local_camera = pose;
  return no_finer_than(wanted_view(viewer, s.T_local_tileset), s.error_m);
}

}  // namespace

std::vector<TileStrategy> tile_strategies(const StrategySettings& s) {
  const auto above_drone = [s](const SE3& pose) {
    return view_from(s.viewer, looking_down(pose.translation + Vec3(0, 0, s.follow_height_m)), s);
  };
  const Wanted high = view_from(s.viewer, high_above(s), s);
  const Wanted flight = no_finer_than(
      tiles::wanted_flight(tiles::eyes_along(s.camera, s.T_local_camera), s.T_local_tileset, s.error_px), s.error_m);
  const Wanted region = tiles::wanted_region(s.region, s.T_local_tileset, s.error_m);
  return {{"view-follow", "a viewer's camera above the drone, looking down", false, above_drone},
          {"view-high", "a viewer's camera high above the region", true, [high](const SE3&) { return high; }},
          {"sensor", "a viewer with the sensor's own view", false,
           [s](const SE3& pose) { return view_from(sensor_viewer(s), pose, s); }},
          {"flight", "one cut for all frames, by pixels of error", true, [flight](const SE3&) { return flight; }},
          {"region", "one cut for the region, by metres of error", true, [region](const SE3&) { return region; }}};
}

Wanted everything_seen(const StrategySettings& s) {
  return no_finer_than(tiles::wanted_flight(tiles::eyes_along(s.camera, s.T_local_camera), s.T_local_tileset, 0.0),
                       s.error_m);
}

}  // namespace tileflight::experiment
