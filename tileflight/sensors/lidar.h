#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "tileflight/scene/scene.h"
#include "tileflight/sensors/appearance.h"
#include "tileflight/sensors/image_formation.h"
#include "tileflight/sensors/lidar_pattern.h"

namespace tileflight::sensors {

/// What becomes of the lidar's own motion during a scan.
enum class ScanMotion {
  kDistorted,  ///< each beam leaves from where the lidar is at its time; points as the lidar gives them, in its frame
               ///< then
  kCorrected,  ///< the same beams, but each point moved into the lidar's frame at the scan's start, by the true motion
  kFrozen,     ///< all beams leave at the scan's start
};

struct LidarOptions {
  std::uint64_t seed = 1;
  LidarPattern pattern = RasterPattern{};
  /// The lidar's axes (x forward, y left, z up) on the camera's (x right, y down, z forward), and its place there.
  geometry::SE3 T_camera_lidar = upright_on_camera();
  ScanMotion motion = ScanMotion::kDistorted;

  double min_range_m = 0.5, max_range_m = 100.0;
  double range_sigma_m = 0.02;     ///< standard deviation of the range
  double range_sigma_share = 0.0;  ///< and this share of it
  double divergence_rad = 3e-3;    ///< full angle of a beam, over which the surface's colour is averaged

  /// On the albedo of the tiles' pictures, up to 1: what is dark to the eye may be bright to a laser (plants in
  /// infrared some five times as much).
  double albedo_gain = 1.0;
  /// Intensity is albedo * cos(incidence), from 0 to 1; with this, also divided by the squared range over
  /// `intensity_reference_m` (what a receiver gets that does not make up for the distance).
  bool intensity_falls_with_range = false;
  double intensity_reference_m = 10.0;

  // What does not come back.
  /// The farthest that a white surface, hit squarely, is seen; others are seen while albedo * cos(incidence) >=
  /// (range / this)^2. Infinite: nothing is lost.
  double white_range_m = std::numeric_limits<double>::infinity();
  double signal_spread = 0.0;       ///< standard deviation of the logarithm of the signal (speckle), for that test
  double max_incidence_deg = 90.0;  ///< beams that graze more than this are lost
  double dropout_share = 0.0;       ///< of all beams, lost at random

  static geometry::SE3 upright_on_camera();
};

/// Throws InputError for options out of range.
void check(const LidarOptions& options);

/// A lidar by its public data sheet: "vlp-16", "os1-64", "hdl-64e", "livox-mid-40"; lidar.cpp says which number comes
/// from where. Throws InputError that lists them.
LidarOptions lidar_preset(const std::string& name);

struct LidarPoint {
  Eigen::Vector3f position;  ///< metres, lidar frame (at the point's time or at the scan's start: ScanMotion)
  float intensity = 0.0F;
  float time_s = 0.0F;     ///< after the scan's start
  std::uint16_t ring = 0;  ///< LidarBeam::ring
};

struct LidarScan {
  double time_s = 0.0;             ///< of its start
  geometry::SE3 T_local_lidar;     ///< at its start
  std::vector<LidarPoint> points;  ///< those that came back, in the order of firing
  std::size_t beams = 0;           ///< that were sent
};

/// A lidar in a scene. Immutable: several threads may scan at once. The same bytes for any number of threads, and a
/// scan depends on its number and time alone.
class Lidar {
 public:
  /// Throws InputError for options out of range. The scene must outlive it.
  Lidar(const scene::Scene& scene, LidarOptions options);

  LidarScan scan(std::uint64_t number, double start_s, const PoseFunction& T_local_camera_at) const;

 private:
  struct Shot;
  Shot shoot(const LidarBeam& beam, std::uint64_t counter, const geometry::SE3& T_local_lidar) const;

  const scene::Scene& scene_;
  LidarOptions options_;
  std::shared_ptr<const Appearance> appearance_;
  std::vector<LidarBeam> beams_;  ///< of all scans, where they are the same
};

}  // namespace tileflight::sensors
