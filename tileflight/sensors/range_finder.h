#pragma once

#include <cstdint>
#include <vector>

#include "tileflight/scene/scene.h"
#include "tileflight/sensors/image_formation.h"
#include "tileflight/sensors/sample_times.h"

namespace tileflight::sensors {

/// An altimeter or rangefinder that looks in one direction. Its reach is that of LightWare's SF11/C (product manual:
/// 120 m), its noise a third of that part's stated accuracy (0.1 m).
struct RangeFinderOptions {
  std::uint64_t seed = 1;
  double rate_hz = 20.0;
  geometry::Vec3 position_camera = geometry::Vec3::Zero();  ///< of the sensor in the camera frame, metres
  geometry::Vec3 direction = -geometry::Vec3::UnitZ();      ///< any length
  bool direction_is_local = true;  ///< the direction is of the local frame (a body that keeps level); else the camera's
  double beam_width_deg = 0.5;     ///< full angle of the cone
  int rays = 19;                   ///< over the cone; the nearest surface that one of them meets counts
  double min_range_m = 0.2;
  double max_range_m = 120.0;
  double noise_m = 0.03;     ///< standard deviation
  double noise_share = 0.0;  ///< and this share of the range
};

/// Beyond reach: +infinity; nearer than the least range: -infinity (ROS's REP 117).
struct RangeSample {
  double time_s = 0.0;
  double range_m = 0.0;
};

/// Throws InputError for options out of range.
void check(const RangeFinderOptions& options);

/// The samples `first` to `last` - 1 of those at `times`; each depends on its number alone. Checks the options.
std::vector<RangeSample> simulate_range_finder(const scene::Scene& scene, const PoseFunction& T_local_camera_at,
                                               const SampleTimes& times, std::uint64_t first, std::uint64_t last,
                                               const RangeFinderOptions& options = {});

}  // namespace tileflight::sensors
