#pragma once

#include <cstdint>
#include <variant>
#include <vector>

#include "tileflight/core/geometry/transform.h"

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

/// Time from one scan's start to the next one's, seconds.
double scan_period_s(const LidarPattern& pattern);

/// The beams of a scan, in the order of their times.
std::vector<LidarBeam> generate_beams(const LidarPattern& pattern, std::uint64_t scan);

/// Throws InputError for patterns without beams, with reversed limits, or with more than ten million beams per scan.
void check(const LidarPattern& pattern);

}  // namespace tileflight::sensors
