#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "tileflight/geometry/transform.h"

namespace tileflight::geometry {

/// Points with what is known of them. Every array that is not empty has as many entries as `positions`.
struct PointCloud {
  std::vector<Vec3> positions;                        ///< metres
  std::vector<Eigen::Vector3f> normals;               ///< unit length
  std::vector<std::array<std::uint8_t, 3>> colors;    ///< red, green, blue
  std::map<std::string, std::vector<float>> scalars;  ///< further named values, e.g. "inverse_depth_variance"

  std::size_t size() const { return positions.size(); }
  bool empty() const { return positions.empty(); }
};

/// The cloud moved by a similarity: positions by all of it, normals by its rotation.
PointCloud transformed(const Sim3& T_target_source, PointCloud cloud);

/// Points whose index is kept by `keep` (same size as the cloud), with all their values.
PointCloud filtered(const PointCloud& cloud, const std::vector<bool>& keep);

}  // namespace tileflight::geometry
