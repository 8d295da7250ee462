#include "tileflight/evaluation/metrics/voxel_wasserstein.h"

#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <unordered_map>
#include <vector>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/order_statistics.h"
#include "tileflight/core/base/strict_section.h"

namespace tileflight::metrics {

using geometry::Mat3;
using geometry::PointCloud;
using geometry::Vec3;

namespace {

/// A voxel's place in the grid; in lexicographic order, neighbours along z follow each other.
using VoxelIndex = std::array<std::int64_t, 3>;

struct VoxelIndexHash {
  std::size_t operator()(const VoxelIndex& v) const {
    std::uint64_t hash = 0;
    for (const std::int64_t i : v) {
      hash = (hash ^ static_cast<std::uint64_t>(i)) * 0x9e3779b97f4a7c15ULL;
      hash ^= hash >> 32;
    }
    return hash;
  }
};

/// Sums of a voxel's points, updated point by point without cancellation (Welford 1962).
struct PointSums {
  std::size_t count = 0;
  Vec3 mean = Vec3::Zero();
  Mat3 scatter = Mat3::Zero();  ///< sum of the squared deviations from the mean

  void add(const Vec3& p) {
    ++count;
    const Vec3 before = p - mean;
    mean += before / static_cast<double>(count);
    scatter += before * (p - mean).transpose();
  }

  /// Returns the normal distribution of at least two points; divisor n - 1.
  Gaussian3 gaussian() const {
    const Mat3 S = scatter / static_cast<double>(count - 1);
    return {mean, 0.5 * (S + S.transpose())};
  }
};

using VoxelSums = std::unordered_map<VoxelIndex, PointSums, VoxelIndexHash>;

/// Cells of the farthest outliers are beyond any integer; those all share the outermost one.
VoxelIndex voxel_of(const Vec3& p, double voxel_m) {
  constexpr double kOutermost = 1e15;
  VoxelIndex index;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double cell = std::floor(p[static_cast<Eigen::Index>(axis)] / voxel_m);
    index[axis] = static_cast<std::int64_t>(std::clamp(cell, -kOutermost, kOutermost));
  }
  return index;
}

VoxelSums sum_by_voxel(const PointVisits& cloud, double voxel_m, const char* name) {
  VoxelSums sums;
  cloud([&](const Vec3& p) {
    if (!p.allFinite()) throw InputError(name, "a point is not finite");
    sums[voxel_of(p, voxel_m)].add(p);
  });
  if (sums.empty()) throw InputError(name, "has no points; there is nothing to score");
  return sums;
}

PointVisits visits_of(const PointCloud& cloud) {
  return [&](const auto& visit) { std::ranges::for_each(cloud.positions, visit); };
}

std::size_t points_of(const VoxelSums& sums) {
  std::size_t points = 0;
  for (const auto& [index, voxel] : sums) points += voxel.count;
  return points;
}

/// Square root of a positive semidefinite matrix; what rounding made negative is 0.
Mat3 square_root(const Mat3& S) {
  const Eigen::SelfAdjointEigenSolver<Mat3> solver(S);
  const Vec3 roots = solver.eigenvalues().cwiseMax(0.0).cwiseSqrt();
  return solver.eigenvectors() * roots.asDiagonal() * solver.eigenvectors().transpose();
}

/// A voxel with enough points of both clouds.
struct ScoredVoxel {
  VoxelIndex index{};
  const PointSums* map = nullptr;
  const PointSums* truth = nullptr;
  double distance_m = 0;  ///< W
};

/// The scored voxels in the order of their indices; counts all others in `result`.
std::vector<ScoredVoxel> select_voxels(const VoxelSums& map, const VoxelSums& truth, VoxelWasserstein& result) {
  std::vector<ScoredVoxel> scored;
  for (const auto& [index, sums] : map) {
    const auto other = truth.find(index);
    if (other == truth.end()) {
      ++result.voxels_map_only;
    } else if (std::min(sums.count, other->second.count) < result.min_points) {
      ++result.voxels_sparse;
    } else {
      scored.push_back({index, &sums, &other->second});
      result.map_points_scored += sums.count;
      result.truth_points_scored += other->second.count;
    }
  }
  result.voxels = scored.size();
  result.voxels_truth_only = truth.size() - result.voxels - result.voxels_sparse;
  std::sort(scored.begin(), scored.end(), [](const auto& a, const auto& b) { return a.index < b.index; });
  return scored;
}

/// Root mean square of W between the normal distributions fitted to as many points as the voxel has of map and truth,
/// if both were drawn from the truth's distribution; to first order in 1/n. Means differ by tr B c with c = 1/n_map +
/// 1/n_truth. Covariances differ by D with E D_ij^2 = (1 + [i = j]) l_i l_j c in the axes of B (Wishart), which lie
/// 1/2 sum_ij D_ij^2 / (l_i + l_j) apart (the Bures metric: Bhatia, Jain and Lim 2019).
double distance_by_chance(const ScoredVoxel& voxel) {
  const double c = 1.0 / static_cast<double>(voxel.map->count) + 1.0 / static_cast<double>(voxel.truth->count);
  const Eigen::SelfAdjointEigenSolver<Mat3> solver(voxel.truth->gaussian().covariance, Eigen::EigenvaluesOnly);
  const Vec3 l = solver.eigenvalues().cwiseMax(0.0);
  double sum = 1.5 * l.sum();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < i; ++j) {
      if (l[i] + l[j] > 0.0) sum += l[i] * l[j] / (l[i] + l[j]);
    }
  }
  return std::sqrt(c * sum);
}

void add_average(const std::vector<ScoredVoxel>& voxels, VoxelWasserstein& result) {
  if (voxels.empty()) return;
  const auto n = static_cast<double>(voxels.size());
  double sum = 0.0, chance = 0.0, squares = 0.0;
  std::vector<double> distances;
  for (const ScoredVoxel& voxel : voxels) {
    sum += voxel.distance_m;
    chance += distance_by_chance(voxel);
    distances.push_back(voxel.distance_m);
  }
  result.awd = sum / n;
  result.chance = chance / n;
  for (const double w : distances) squares += (w - result.awd) * (w - result.awd);
  result.std = std::sqrt(squares / n);
  result.median = base::median(distances);
}

/// Standard deviation over mean of the distances of voxel `k`'s neighbours; NaN for fewer than two, or if all are 0.
double variation_around(const std::vector<ScoredVoxel>& voxels, std::size_t k, std::int64_t radius) {
  const VoxelIndex& center = voxels[k].index;
  std::vector<double> around;
  for (std::int64_t x = center[0] - radius; x <= center[0] + radius; ++x) {
    for (std::int64_t y = center[1] - radius; y <= center[1] + radius; ++y) {
      // One search for the column; its voxels follow each other.
      auto at = std::lower_bound(voxels.begin(), voxels.end(), VoxelIndex{x, y, center[2] - radius},
                                 [](const ScoredVoxel& v, const VoxelIndex& index) { return v.index < index; });
      for (; at != voxels.end() && at->index <= VoxelIndex{x, y, center[2] + radius}; ++at) {
        if (at->index != center) around.push_back(at->distance_m);
      }
    }
  }
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  if (around.size() < 2) return kNone;
  const auto n = static_cast<double>(around.size());
  double sum = 0.0, squares = 0.0;
  for (const double w : around) sum += w;
  const double mean = sum / n;
  for (const double w : around) squares += (w - mean) * (w - mean);
  return mean > 0.0 ? std::sqrt(squares / n) / mean : kNone;
}

void add_consistency(const std::vector<ScoredVoxel>& voxels, int radius, VoxelWasserstein& result) {
  std::vector<double> variations(voxels.size());
  tbb::parallel_for(std::size_t{0}, voxels.size(),
                    [&](std::size_t k) { variations[k] = variation_around(voxels, k, radius); });
  double sum = 0.0;
  for (const double v : variations) {
    if (std::isnan(v)) continue;
    sum += v;
    ++result.scs_voxels;
  }
  if (result.scs_voxels > 0) result.scs = sum / static_cast<double>(result.scs_voxels);
}

void check_options(const VoxelWassersteinOptions& options) {
  if (!(options.voxel_m > 0.0) || !std::isfinite(options.voxel_m))
    throw InputError("voxel of the Wasserstein distance", "must be above zero, in metres");
  if (options.min_points < 2)
    throw InputError("points of a voxel for the Wasserstein distance", "must be at least 2: one has no covariance");
  if (options.neighborhood_voxels < 1)
    throw InputError("neighbourhood of the spatial consistency", "must be at least 1 voxel");
}

double share_of(std::size_t part, std::size_t all) {
  return all > 0 ? static_cast<double>(part) / static_cast<double>(all) : 0.0;
}

}  // namespace

double gaussian_wasserstein(const Gaussian3& a, const Gaussian3& b) {
  const Mat3 root_a = square_root(a.covariance), root_b = square_root(b.covariance);
  // The U that minimises |root_a - root_b U| is the orthogonal factor of root_b^T root_a (Schoenemann 1966).
  const Eigen::JacobiSVD<Mat3> svd(root_b.transpose() * root_a, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Mat3 U = svd.matrixU() * svd.matrixV().transpose();
  return std::sqrt((a.mean - b.mean).squaredNorm() + (root_a - root_b * U).squaredNorm());
}

VoxelWasserstein voxel_wasserstein(const PointCloud& aligned_map, const PointCloud& truth,
                                   const VoxelWassersteinOptions& options) {
  return voxel_wasserstein(visits_of(aligned_map), truth, options);
}

VoxelWasserstein voxel_wasserstein(const PointVisits& aligned_map, const PointCloud& truth,
                                   const VoxelWassersteinOptions& options) {
  check_options(options);
  const VoxelSums of_map = sum_by_voxel(aligned_map, options.voxel_m, "map"),
                  of_truth = sum_by_voxel(visits_of(truth), options.voxel_m, "surface samples");
  VoxelWasserstein result{.voxel_m = options.voxel_m,
                          .min_points = options.min_points,
                          .map_points = points_of(of_map),
                          .truth_points = truth.size()};
  std::vector<ScoredVoxel> voxels = select_voxels(of_map, of_truth, result);
  tbb::parallel_for(std::size_t{0}, voxels.size(), [&](std::size_t k) {
    voxels[k].distance_m = gaussian_wasserstein(voxels[k].map->gaussian(), voxels[k].truth->gaussian());
  });
  add_average(voxels, result);
  add_consistency(voxels, options.neighborhood_voxels, result);
  return result;
}

nlohmann::json to_json(const VoxelWasserstein& w) {
  return {{"voxel", w.voxel_m},
          {"min_points", w.min_points},
          {"awd", w.awd},
          {"std", w.std},
          {"median", w.median},
          {"chance", w.chance},
          {"scs", w.scs},
          {"scs_voxels", w.scs_voxels},
          {"voxels", w.voxels},
          {"voxels_sparse", w.voxels_sparse},
          {"voxels_map_only", w.voxels_map_only},
          {"voxels_truth_only", w.voxels_truth_only},
          {"map_points", w.map_points},
          {"map_points_scored", w.map_points_scored},
          {"truth_points", w.truth_points},
          {"truth_points_scored", w.truth_points_scored},
          {"share_of_map", share_of(w.map_points_scored, w.map_points)},
          {"share_of_truth", share_of(w.truth_points_scored, w.truth_points)}};
}

VoxelWasserstein read_voxel_wasserstein(base::StrictSection reader) {
  VoxelWasserstein w;
  w.voxel_m = reader.required_number("voxel");
  w.min_points = reader.required_count("min_points");
  w.awd = reader.required_number("awd");
  w.std = reader.required_number("std");
  w.median = reader.required_number("median");
  w.chance = reader.required_number("chance");
  w.scs = reader.required_number("scs");
  w.scs_voxels = reader.required_count("scs_voxels");
  w.voxels = reader.required_count("voxels");
  w.voxels_sparse = reader.required_count("voxels_sparse");
  w.voxels_map_only = reader.required_count("voxels_map_only");
  w.voxels_truth_only = reader.required_count("voxels_truth_only");
  w.map_points = reader.required_count("map_points");
  w.map_points_scored = reader.required_count("map_points_scored");
  w.truth_points = reader.required_count("truth_points");
  w.truth_points_scored = reader.required_count("truth_points_scored");
  for (const char* key : {"share_of_map", "share_of_truth"}) reader.required_number(key);  // follow from the counts
  reader.require_all_keys_used();
  return w;
}

}  // namespace tileflight::metrics
