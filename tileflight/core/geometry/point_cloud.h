#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::geometry {

/// Points with optional attributes. Every non-empty array has as many entries as `positions`.
struct PointCloud {
  std::vector<Vec3> positions;                        ///< metres
  std::vector<Eigen::Vector3f> normals;               ///< unit length
  std::vector<std::array<std::uint8_t, 3>> colors;    ///< red, green, blue
  std::map<std::string, std::vector<float>> scalars;  ///< further named values, e.g. "inverse_depth_variance"

  std::size_t size() const { return positions.size(); }
  bool empty() const { return positions.empty(); }
};

/// Applies a similarity to a cloud: in full to positions, rotation only to normals.
PointCloud transformed(const Sim3& T_target_source, PointCloud cloud);

/// Returns the points whose entry in `keep` is true (same size as the cloud), with all their attributes.
PointCloud filter_points(const PointCloud& cloud, const std::vector<bool>& keep);

}  // namespace tileflight::geometry
