#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "tileflight/capture/render/appearance.h"
#include "tileflight/capture/render/image_formation.h"
#include "tileflight/capture/render/render_flight.h"
#include "tileflight/core/geometry/transform.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::sensors {

// Beam directions of lidars. Lidar frame: x forward, y left, z up (as Velodyne's, Ouster's sensor frame and ROS's REP
// 103).

/// Direction and firing time of a beam.
struct LidarBeam {
  geometry::Vec3 direction;  ///< unit length, lidar frame
  double time_s = 0.0;       ///< after the scan's start
  std::uint16_t ring = 0;    ///< spinning lidars: the channel, counted from the lowest; raster: the row
};

/// A column of channels that rotates about z, clockwise seen from above; a scan is a full turn.
struct SpinningPattern {
  double rate_hz = 10.0;               ///< turns a second
  int columns = 1800;                  ///< firings per turn, evenly spaced in time and azimuth
  std::vector<double> elevations_deg;  ///< of each channel, positive upwards, in the order of firing
  double channel_delay_s = 0.0;        ///< between successive channels of a column; 0: all fire at once
  double azimuth_from_deg = -180.0;    ///< beams outside these limits are dropped; counted clockwise from x
  double azimuth_to_deg = 180.0;
};

/// Two counter-rotating prisms of equal deflection: a rosette that differs from scan to scan.
struct RosettePattern {
  double rate_hz = 10.0;  ///< scans per second (the pattern continues from scan to scan)
  double points_per_second = 1e5;
  double fov_deg = 38.4;  ///< full angle of the cone
  double first_prism_rpm = 7294.0;
  double second_prism_rpm = -4664.0;
};

/// Rows from top to bottom, each from left to right.
struct RasterPattern {
  double rate_hz = 10.0;
  int columns = 256, rows = 64;
  double horizontal_fov_deg = 60.0, vertical_fov_deg = 20.0;
};

using LidarPattern = std::variant<SpinningPattern, RosettePattern, RasterPattern>;

/// Returns the time from one scan's start to the next one's, seconds.
double scan_period_s(const LidarPattern& pattern);

/// Generates the beams of a scan, in the order of their times.
std::vector<LidarBeam> generate_beams(const LidarPattern& pattern, std::uint64_t scan);

/// Throws InputError for patterns without beams, with reversed limits, or with more than ten million beams per scan.
void check(const LidarPattern& pattern);

/// Selects how the lidar's own motion during a scan affects its points.
enum class ScanMotion {
  kDistorted,  ///< each beam starts from the lidar's pose at its time; points are in the lidar's frame at that time, as
               ///< a real lidar gives them
  kCorrected,  ///< the same beams, but points are transformed into the lidar's frame at the scan's start by the true
               ///< motion
  kFrozen,     ///< all beams start at the scan's start
};

/// A lidar, its mounting and its errors.
struct LidarOptions {
  std::uint64_t seed = 1;
  LidarPattern pattern = RasterPattern{};
  /// Pose of the lidar (x forward, y left, z up) in the camera frame (x right, y down, z forward).
  geometry::SE3 T_camera_lidar = upright_on_camera();
  ScanMotion motion = ScanMotion::kDistorted;

  double min_range_m = 0.5, max_range_m = 100.0;
  double range_sigma_m = 0.02;     ///< standard deviation of the range
  double range_sigma_share = 0.0;  ///< plus this share of the range
  double divergence_rad = 3e-3;    ///< full angle of a beam, over which the surface's colour is averaged

  /// Factor on the albedo of the tiles' textures, clamped to 1: surfaces that look dark may reflect a laser well
  /// (plants in infrared some five times as much).
  double albedo_gain = 1.0;
  /// Intensity is albedo * cos(incidence), from 0 to 1; if true, it is also divided by the squared range over
  /// `intensity_reference_m` (a receiver without range compensation).
  bool intensity_falls_with_range = false;
  double intensity_reference_m = 10.0;

  // Lost returns.
  /// Maximum range of a white surface at normal incidence; other surfaces are seen while albedo * cos(incidence) >=
  /// (range / this)^2. Infinite: nothing is lost.
  double white_range_m = std::numeric_limits<double>::infinity();
  double signal_spread = 0.0;       ///< standard deviation of the logarithm of the signal (speckle), for the test above
  double max_incidence_deg = 90.0;  ///< beams with a greater incidence angle are lost
  double dropout_share = 0.0;       ///< share of all beams, lost at random

  static geometry::SE3 upright_on_camera();
};

/// Throws InputError for options out of range.
void check(const LidarOptions& options);

/// Returns the lidar of a public data sheet: "vlp-16", "os1-64", "hdl-64e", "livox-mid-40"; lidar.cpp cites the source
/// of each number. Throws InputError that lists them for other names.
LidarOptions lidar_preset(const std::string& name);

/// A lidar return.
struct LidarPoint {
  Eigen::Vector3f position;  ///< metres, lidar frame (at the point's time or the scan's start, see ScanMotion)
  float intensity = 0.0F;
  float time_s = 0.0F;     ///< after the scan's start
  std::uint16_t ring = 0;  ///< LidarBeam::ring
};

/// The points of one scan.
struct LidarScan {
  double time_s = 0.0;             ///< of its start
  geometry::SE3 T_local_lidar;     ///< lidar pose at the scan's start
  std::vector<LidarPoint> points;  ///< returns, in the order of firing
  std::size_t beams = 0;           ///< beams fired
};

/// A lidar in a scene. Immutable: several threads may scan at once. Results are bit-identical for any number of
/// threads, and a scan depends only on its number and time.
class Lidar {
 public:
  /// `placed`: what moves in the scene. Throws InputError for options out of range. The scene must outlive it.
  Lidar(const scene::Scene& scene, LidarOptions options, render::PlacedParts placed = {});

  /// Simulates scan `number`, which starts at `start_s`.
  LidarScan scan(std::uint64_t number, double start_s, const render::PoseFunction& T_local_camera_at) const;

 private:
  struct BeamReturn;
  /// `time`: of the scene (scene::Ray::time).
  BeamReturn trace_beam(const scene::Scene& scene, const LidarBeam& beam, std::uint64_t counter,
                        const geometry::SE3& T_local_lidar, double time) const;

  const scene::Scene& scene_;
  LidarOptions options_;
  render::PlacedParts placed_;
  std::shared_ptr<const render::Appearance> appearance_;
  std::vector<LidarBeam> beams_;  ///< of every scan, if all scans have the same beams
};

}  // namespace tileflight::sensors
