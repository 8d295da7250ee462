#pragma once

#include <Eigen/Core>
#include <vector>

#include "tileflight/geometry/transform.h"

namespace tileflight::alignment {

/// Places of two clouds that look alike; `source[k]` belongs to `target[k]` perhaps.
struct PlacePairs {
  std::vector<geometry::Vec3> source;
  std::vector<geometry::Vec3> target;
  std::vector<float> unlikeness;  ///< distance of their descriptors
};

/// For each source place the target place of the nearest descriptor, and the other way round; at most `most` pairs, the
/// likest. Descriptors are rows; rows of zeros pair with nothing.
PlacePairs similar_places(const std::vector<geometry::Vec3>& source, const Eigen::MatrixXf& source_descriptors,
                          const std::vector<geometry::Vec3>& target, const Eigen::MatrixXf& target_descriptors,
                          std::size_t most = 1500);

struct ConsistencyOptions {
  double tolerance_m = 2.0;       ///< by which the distance of two places may differ in the two clouds, and
  double tolerance_share = 0.12;  ///< by this share of it: the scale is known roughly
  geometry::Vec3 source_up = geometry::Vec3::Zero();  ///< unit length, or zero: gravity is not known
  geometry::Vec3 target_up = geometry::Vec3::Zero();
  double up_tolerance_rad = 0.17;
  std::size_t groups = 8;  ///< at most so many are returned
};

/// Groups of pairs of which every two are consistent: cliques grown greedily from the pairs that agree with most
/// others, largest first. Deterministic.
std::vector<std::vector<std::size_t>> consistent_groups(const PlacePairs& pairs, const ConsistencyOptions& options);

}  // namespace tileflight::alignment
