#pragma once

#include <cstdint>
#include <vector>

#include "tileflight/capture/flight_path/path.h"
#include "tileflight/capture/render/image_formation.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::sensors {

/// A range finder with a fixed viewing direction. Its range is that of LightWare's SF11/C (product manual: 120 m), its
/// noise a third of that part's stated accuracy (0.1 m).
struct RangeFinderOptions {
  std::uint64_t seed = 1;
  double rate_hz = 20.0;
  geometry::Vec3 position_camera = geometry::Vec3::Zero();  ///< of the sensor in the camera frame, metres
  geometry::Vec3 direction = -geometry::Vec3::UnitZ();      ///< any length
  bool direction_is_local = true;  ///< direction in the local frame (a stabilized sensor); else in the camera frame
  double beam_width_deg = 0.5;     ///< full angle of the cone
  int rays = 19;                   ///< within the cone; the range is that of the nearest hit
  double min_range_m = 0.2;
  double max_range_m = 120.0;
  double noise_m = 0.03;     ///< standard deviation
  double noise_share = 0.0;  ///< plus this share of the range
};

/// A range. It is +infinity beyond the maximum range, -infinity below the minimum range (ROS's REP 117).
struct RangeSample {
  double time_s = 0.0;
  double range_m = 0.0;
};

/// Throws InputError for options out of range.
void check(const RangeFinderOptions& options);

/// Simulates samples `first` to `last` - 1 of those at `times`; each depends only on its index. Throws InputError as
/// check() does.
std::vector<RangeSample> simulate_range_finder(const scene::Scene& scene, const render::PoseFunction& T_local_camera_at,
                                               const flight_path::SampleTimes& times, std::uint64_t first,
                                               std::uint64_t last, const RangeFinderOptions& options = {});

}  // namespace tileflight::sensors
