#pragma once

#include <Eigen/Core>
#include <vector>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::alignment {

/// Putative correspondences of two clouds: `source[k]` may correspond to `target[k]`.
struct PutativeMatches {
  std::vector<geometry::Vec3> source;
  std::vector<geometry::Vec3> target;
  std::vector<float> descriptor_distance;  ///< distance of their descriptors
};

/// Pairs each source point with the target point of the nearest descriptor, and vice versa; returns at most `most`
/// pairs, those with the smallest descriptor distance. Descriptors are rows; rows of zeros are not matched.
PutativeMatches match_descriptors(const std::vector<geometry::Vec3>& source, const Eigen::MatrixXf& source_descriptors,
                                  const std::vector<geometry::Vec3>& target, const Eigen::MatrixXf& target_descriptors,
                                  std::size_t most = 1500);

struct ConsistencyOptions {
  double tolerance_m = 2.0;       ///< largest difference between the distance of two points in the two clouds, plus
  double tolerance_share = 0.12;  ///< this share of it, since the scale is only roughly known
  geometry::Vec3 source_up = geometry::Vec3::Zero();  ///< unit length; zero: gravity unknown
  geometry::Vec3 target_up = geometry::Vec3::Zero();
  double up_tolerance_rad = 0.17;
  std::size_t max_groups = 8;  ///< maximum number of groups returned
};

/// Finds groups of mutually consistent pairs, largest first: cliques of the consistency graph, grown greedily from the
/// pairs consistent with most others. Deterministic.
std::vector<std::vector<std::size_t>> find_consistent_groups(const PutativeMatches& pairs,
                                                             const ConsistencyOptions& options);

}  // namespace tileflight::alignment
