#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::dataset {

/// A point of a lidar scan, in the lidar's frame (x forward, y left, z up).
struct ScanPoint {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  ///< metres
  float intensity = 0.0F;                              ///< 0 to 1
  float time_s = 0.0F;                                 ///< after the scan's start
  std::uint16_t ring = 0;                              ///< channel or row; 0 if there is none
};

/// Writes binary little-endian PLY with x, y, z, intensity, time (float) and ring (ushort).
void write_scan_ply(const std::filesystem::path& file, const std::vector<ScanPoint>& points);

/// Writes KITTI's velodyne/*.bin: x, y, z, intensity as little-endian floats, without times and rings.
void write_scan_bin(const std::filesystem::path& file, const std::vector<ScanPoint>& points);

/// Reads a scan by the file's extension, .ply or .bin; a PLY file needs only x, y and z. Throws InputError (file,
/// cause).
std::vector<ScanPoint> read_scan(const std::filesystem::path& file);

}  // namespace tileflight::dataset
