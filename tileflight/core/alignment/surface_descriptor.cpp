#include "tileflight/core/alignment/surface_descriptor.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "tileflight/core/alignment/normals.h"

namespace tileflight::alignment {

using geometry::Vec3;

std::vector<Vec3> voxel_downsample(const std::vector<Vec3>& points, double cell_m) {
  struct Mean {
    Vec3 sum = Vec3::Zero();
    double count = 0.0;
  };
  std::map<std::array<std::int64_t, 3>, Mean> cells;
  for (const Vec3& p : points) {
    const Vec3 c = (p / cell_m).array().floor();
    Mean& mean =
        cells[{static_cast<std::int64_t>(c.x()), static_cast<std::int64_t>(c.y()), static_cast<std::int64_t>(c.z())}];
    mean.sum += p;
    mean.count += 1.0;
  }
  std::vector<Vec3> means;
  means.reserve(cells.size());
  for (const auto& [cell, mean] : cells) means.push_back(mean.sum / mean.count);
  return means;
}

namespace {

constexpr int kBins = 11;
constexpr std::size_t kMinNeighbors = 5;

/// Bin of a value in [0, 1].
int bin_index(double value) { return std::clamp(static_cast<int>(value * kBins), 0, kBins - 1); }

/// Neighbourhoods of all points, with their histograms.
class Neighborhoods {
 public:
  Neighborhoods(const std::vector<Vec3>& points, const DescriptorOptions& options)
      : points_(points), options_(options), index_(points), normals_(points.size()), neighbors_(points.size()) {
    tbb::parallel_for(std::size_t{0}, points.size(), [&](std::size_t i) {
      normals_[i] = estimate_normal(points, index_, points[i], options.normal_neighbors);
    });
    tbb::parallel_for(std::size_t{0}, points.size(), [&](std::size_t i) { neighbors_[i] = find_neighbors(i); });
  }

  int histogram_count() const { return options_.up ? 5 : 3; }
  const std::vector<geometry::Neighbor>& neighbors(std::size_t i) const { return neighbors_[i]; }

  /// Simplified point feature histograms of point `i`; each sums to one.
  Eigen::VectorXf spfh(std::size_t i) const {
    Eigen::VectorXf row = Eigen::VectorXf::Zero(kBins * histogram_count());
    if (neighbors_[i].size() < kMinNeighbors) return row;
    const auto share = 1.0f / static_cast<float>(neighbors_[i].size());
    for (const geometry::Neighbor& n : neighbors_[i]) add_pair_features(i, n.index, share, row);
    return row;
  }

 private:
  /// Neighbours at other positions that have a normal; none for a point without a normal.
  std::vector<geometry::Neighbor> find_neighbors(std::size_t i) const {
    if (normals_[i].isZero()) return {};
    std::vector<geometry::Neighbor> found = index_.within(points_[i], options_.radius_m);
    std::erase_if(found, [&](const geometry::Neighbor& n) {
      return n.index == i || !(n.distance_m > 0.0) || normals_[n.index].isZero();
    });
    return found;
  }

  void add_pair_features(std::size_t i, std::size_t j, float share, Eigen::VectorXf& row) const {
    const Vec3 line = (points_[j] - points_[i]).normalized();
    row[bin_index(std::abs(normals_[i].dot(line)))] += share;
    row[kBins + bin_index(std::abs(normals_[j].dot(line)))] += share;
    row[2 * kBins + bin_index(std::abs(normals_[i].dot(normals_[j])))] += share;
    if (!options_.up) return;
    row[3 * kBins + bin_index(std::abs(normals_[j].dot(*options_.up)))] += share;
    row[4 * kBins + bin_index(0.5 + 0.5 * line.dot(*options_.up))] += share;
  }

  const std::vector<Vec3>& points_;
  const DescriptorOptions& options_;
  geometry::NearestIndex index_;
  std::vector<Vec3> normals_;
  std::vector<std::vector<geometry::Neighbor>> neighbors_;
};

}  // namespace

Eigen::MatrixXf compute_surface_descriptors(const std::vector<Vec3>& points, const DescriptorOptions& options) {
  const Neighborhoods around(points, options);
  const auto rows = static_cast<Eigen::Index>(points.size());
  Eigen::MatrixXf simple(rows, kBins * around.histogram_count());
  tbb::parallel_for(Eigen::Index{0}, rows,
                    [&](Eigen::Index i) { simple.row(i) = around.spfh(static_cast<std::size_t>(i)).transpose(); });
  Eigen::MatrixXf result = simple;
  tbb::parallel_for(Eigen::Index{0}, rows, [&](Eigen::Index i) {
    const auto& neighbors = around.neighbors(static_cast<std::size_t>(i));
    if (neighbors.size() < kMinNeighbors) return;
    Eigen::RowVectorXf sum = Eigen::RowVectorXf::Zero(simple.cols());
    float weights = 0.0f;
    for (const geometry::Neighbor& n : neighbors) {
      // Weight 1 / distance of Rusu et al., without its pole.
      const auto weight = static_cast<float>(options.radius_m / (n.distance_m + 0.1 * options.radius_m));
      sum += weight * simple.row(static_cast<Eigen::Index>(n.index));
      weights += weight;
    }
    result.row(i) += sum / weights;
  });
  return result;
}

}  // namespace tileflight::alignment
