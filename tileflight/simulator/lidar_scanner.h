#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "tileflight/simulator/place.h"
#include "tileflight/simulator/sensor_settings.h"

namespace tileflight::simulator {

/// A ray of a lidar that met a surface.
struct LidarReturn {
  geometry::Vec3 point_sensor = geometry::Vec3::Zero();  ///< sensor axes: x forward, y right, z down
  float intensity = 0.0F;                                ///< albedo times cosine of the incidence
  float time_offset_s = 0.0F;                            ///< after the turn's start
  std::uint16_t ring = 0;                                ///< channel, counted from the lowest
  std::uint32_t object = 0;                              ///< index into Place::objects()
};

/// A whole turn from one pose, against the triangles that pictures show, without noise: points per second and turns per
/// second give the columns, which are fired clockwise from above. In the order of firing; rays that meet nothing within
/// range are left out. The same for any number of threads.
std::vector<LidarReturn> scan(const Place& place, const LidarSettings& settings, const geometry::SE3& T_local_sensor);

/// The most rays for a small angle, per radian: what the lidar needs of the tiles.
double rays_per_rad(const LidarSettings& settings);

}  // namespace tileflight::simulator
