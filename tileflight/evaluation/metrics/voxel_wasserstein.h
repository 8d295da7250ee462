#pragma once

namespace tileflight::base {
class StrictSection;
}

// Scores of a cloud that is not held in memory.

#include <cstddef>
#include <functional>
#include <limits>
#include <nlohmann/json_fwd.hpp>

#include "tileflight/core/geometry/point_cloud.h"

namespace tileflight::metrics {

/// A normal distribution in space.
struct Gaussian3 {
  geometry::Vec3 mean = geometry::Vec3::Zero();        ///< metres
  geometry::Mat3 covariance = geometry::Mat3::Zero();  ///< square metres; positive semidefinite
};

/// Returns the 2-Wasserstein distance between two normal distributions, metres: W^2 = |m_a - m_b|^2 + tr(A + B - 2
/// (A^1/2 B A^1/2)^1/2) (Dowson and Landau 1982; Olkin and Pukelsheim 1982). It is computed as |m_a - m_b|^2 + min over
/// orthogonal U of |A^1/2 - B^1/2 U|^2 (Bhatia, Jain and Lim 2019, theorem 1), which does not cancel for distributions
/// that are nearly the same or flat.
double gaussian_wasserstein(const Gaussian3& a, const Gaussian3& b);

/// Average Wasserstein distance (AWD) and spatial consistency score (SCS) of a map: Hu et al., "MapEval", RA-L 2025
/// (arXiv 2411.17928). Both clouds are cut into voxels (cubes, one corner at the origin), and in each voxel in which
/// both have enough points these are replaced by their normal distribution. Lower is better for both.
struct VoxelWasserstein {
  double voxel_m = 0;
  std::size_t min_points = 0;

  std::size_t voxels = 0;           ///< scored: min_points of either cloud or more
  std::size_t voxels_sparse = 0;    ///< with points of both clouds, but too few of one
  std::size_t voxels_map_only = 0;  ///< with points of the map alone
  std::size_t voxels_truth_only = 0;
  std::size_t map_points = 0, map_points_scored = 0;      ///< all, and those in scored voxels
  std::size_t truth_points = 0, truth_points_scored = 0;  ///< the same of the truth

  /// Mean over the scored voxels of W, metres. NaN if there is none.
  double awd = std::numeric_limits<double>::quiet_NaN();
  double std = std::numeric_limits<double>::quiet_NaN();  ///< of W over the voxels, divisor n
  double median = std::numeric_limits<double>::quiet_NaN();
  /// Mean over the scored voxels of the distance, by chance, of as many points drawn from the truth's normal
  /// distribution: an upper figure for a map without error, since points that cover a surface evenly scatter less.
  double chance = std::numeric_limits<double>::quiet_NaN();

  /// Mean over the scored voxels with at least two scored neighbours of the standard deviation of the neighbours' W
  /// (divisor n) over their mean. NaN if there is none.
  double scs = std::numeric_limits<double>::quiet_NaN();
  std::size_t scs_voxels = 0;  ///< with two scored neighbours and more
};

struct VoxelWassersteinOptions {
  double voxel_m = 3.0;         ///< MapEval's for outdoor maps
  std::size_t min_points = 10;  ///< of either cloud, at least 2; MapEval's program takes 100, for lidar
  int neighborhood_voxels = 5;  ///< neighbours are at most this many voxels away along each axis
};

/// Scores a map by the Wasserstein distance in voxels. Time and memory grow in proportion to the points and the voxels
/// that hold them. Deterministic for any number of threads. Throws InputError for an empty cloud, a point that is not
/// finite, a voxel that is not positive, and fewer than 2 points as minimum.
VoxelWasserstein voxel_wasserstein(const geometry::PointCloud& aligned_map, const geometry::PointCloud& truth,
                                   const VoxelWassersteinOptions& options = {});

/// Returns the key `wasserstein` of metrics.json (docs/formats.md).
nlohmann::json to_json(const VoxelWasserstein& scores);

/// Reads the object that to_json() returns. Throws InputError as StrictSection does.
VoxelWasserstein read_voxel_wasserstein(base::StrictSection section);

/// Calls its argument for each point of a cloud, in order.
using PointVisits = std::function<void(const std::function<void(const geometry::Vec3& p)>&)>;

/// Scores a map whose points are visited one by one. The result equals that of the map in memory to the last digit.
VoxelWasserstein voxel_wasserstein(const PointVisits& aligned_map, const geometry::PointCloud& truth,
                                   const VoxelWassersteinOptions& options = {});

}  // namespace tileflight::metrics
