#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "tileflight/live/simulator/resident_scene.h"
#include "tileflight/live/simulator/sensor_settings.h"

namespace tileflight::simulator {

/// A lidar return.
struct LidarReturn {
  geometry::Vec3 point_sensor = geometry::Vec3::Zero();  ///< sensor axes: x forward, y right, z down
  float intensity = 0.0F;                                ///< albedo times cosine of the incidence
  float time_offset_s = 0.0F;                            ///< after the start of the rotation
  std::uint16_t ring = 0;                                ///< channel, counted from the lowest
  std::uint32_t object = 0;                              ///< index into ResidentScene::objects()
};

/// Simulates a full rotation from a fixed pose against the rendered triangles, without noise. Points per second and
/// rotations per second determine the columns, which are fired clockwise seen from above. Returns are in the order of
/// firing; rays without a hit in range are left out. Does not depend on the number of threads.
std::vector<LidarReturn> scan_lidar(const ResidentScene& place, const LidarSettings& settings,
                                    const geometry::SE3& T_local_sensor);

/// Returns the highest angular density of rays per radian, which determines the tiles' resolution.
double rays_per_rad(const LidarSettings& settings);

/// An echo: where the signal was reflected last before it came back.
struct EchoReturn {
  geometry::Vec3 point_sensor = geometry::Vec3::Zero();  ///< sensor axes: x forward, y right, z down
  double attenuation_db = 0.0;                           ///< 0 or below
  double distance_m = 0.0;                               ///< of the whole way, back to the sensor
  int reflections = 0;
  std::uint32_t object = 0;  ///< index into ResidentScene::objects()
};

/// Returns the directions in which the signal is sent, in sensor axes: evenly over the solid angle within the limits
/// (Fibonacci lattice, Gonzalez 2010), or over the horizontal angle for a sensor that senses in its plane only.
std::vector<geometry::Vec3> echo_directions(const EchoSettings& settings);

/// Simulates a sonar or radar by geometrical acoustics, with Cosys-AirSim's settings and a model of our own. Each ray
/// is mirrored at the surfaces that it meets. The first surface that scatters back to the sensor, within the opening
/// angle around the mirrored direction and with nothing between, makes an echo. There is no interference, noise or
/// Doppler shift. Returns are in the order of the directions and do not depend on the number of threads.
std::vector<EchoReturn> sense_echoes(const ResidentScene& place, const EchoSettings& settings,
                                     const geometry::SE3& T_local_sensor);

}  // namespace tileflight::simulator
