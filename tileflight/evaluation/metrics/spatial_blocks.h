#pragma once

// Spatial block bootstrap for two maps of one place. Errors of neighbouring points are correlated, over tens of metres
// where a camera flew higher or saw less. Hence blocks are drawn instead of points: columns over squares of the ground,
// each with the data of both maps, so that ground that is hard to map affects both. A block reached by one map only
// contributes to that map only. Kuensch, Annals of Statistics 17, 1989; Efron and Tibshirani, An Introduction to the
// Bootstrap, 1993.

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/evaluation/metrics/distances.h"

namespace tileflight::metrics {

/// Histogram of distances with logarithmic bins, for medians over drawn blocks. Bin 0 is below the first edge, the last
/// bin above the last edge.
class MedianBins {
 public:
  static constexpr Eigen::Index kBins = 512;

  /// Bins cover the distances of both maps except a few at either end.
  MedianBins(const std::vector<double>& a, const std::vector<double>& b) {
    const Percentiles pa = compute_percentiles(a), pb = compute_percentiles(b);
    const double high = std::max({pa.at(95), pb.at(95), 1e-9});
    low_ = std::log(std::max(0.02 * std::min(pa.at(25), pb.at(25)), 1e-6 * high));
    step_ = (std::log(high) - low_) / static_cast<double>(kBins - 2);
  }

  Eigen::Index bin_of(double distance_m) const {
    const double at = (std::log(std::max(distance_m, 1e-300)) - low_) / step_;
    return 1 + static_cast<Eigen::Index>(std::clamp(std::floor(at), -1.0, static_cast<double>(kBins - 2)));
  }

  /// Median of a histogram (kBins counts, not necessarily whole, not all zero), linearly interpolated within its bin.
  double median(const Eigen::Ref<const Eigen::RowVectorXd>& counts) const {
    const double half = 0.5 * counts.sum();
    double before = 0.0;
    for (Eigen::Index k = 0; k < kBins; ++k) {
      if (before + counts[k] < half) {
        before += counts[k];
        continue;
      }
      const double part = counts[k] > 0.0 ? (half - before) / counts[k] : 0.5;
      return std::exp(low_ + (static_cast<double>(k - 1) + part) * step_);
    }
    return std::numeric_limits<double>::quiet_NaN();
  }

 private:
  double low_ = 0.0, step_ = 1.0;  ///< in logarithms
};

/// Division of the ground into squares.
struct BlockGrid {
  double east_m = 0, north_m = 0;  ///< corner of the grid
  double edge_m = 0;
  /// Effective number of blocks, (sum w)^2 / sum w^2 (Kish 1965), of the map that has fewer.
  double effective = 0;
};

/// Chooses the largest squares that give each of two point sets at least `wanted` effective blocks; the smallest tried
/// if none do. Returns nullopt if a set is empty or all points coincide.
std::optional<BlockGrid> choose_block_grid(const std::vector<geometry::Vec3>& a, const std::vector<geometry::Vec3>& b,
                                           double wanted);

/// Assignment of the points of two sets to blocks and quarter blocks (squares of half the edge), in spatial order.
struct BlockAssignment {
  std::array<std::vector<std::uint32_t>, 2> quarter_of;  ///< quarter of each point: [set][point]
  std::vector<std::uint32_t> block_of;                   ///< block of each quarter
  std::size_t blocks = 0;
  std::array<std::size_t, 2> exclusive{};  ///< blocks reached only by the first, only by the second set
};
BlockAssignment assign_blocks(const BlockGrid& blocks, const std::vector<geometry::Vec3>& a,
                              const std::vector<geometry::Vec3>& b);

/// A statistic computed from sums over blocks, such as a ratio; NaN if undefined.
using BlockStatistic = std::function<double(const Eigen::RowVectorXd& sums)>;

/// Bootstrap distribution of statistics of two maps over resampled blocks of the place.
class BlockBootstrap {
 public:
  /// `quarters`: sums over the quarter blocks, one row each, with columns as the statistics read them. The draws depend
  /// only on the seed, not on the number of threads.
  BlockBootstrap(const BlockGrid& blocks, const BlockAssignment& numbers, const Eigen::MatrixXd& quarters,
                 int resamples, std::uint64_t seed);

  /// Value of the statistic over all blocks.
  double value(const BlockStatistic& statistic) const { return statistic(total_); }

  /// Standard error of the value. Correlation across block edges makes the variance V too small by about c / edge; the
  /// variance from quarter blocks is too small by twice as much, so 2 V(blocks) - V(quarters) corrects it (Richardson
  /// extrapolation). Never below either. NaN if too few draws have a value.
  double standard_error(const BlockStatistic& statistic) const;

  /// Two-sided p-value that two exchangeable maps differ at least as much: the sign of each block's difference is drawn
  /// at random, as often as the bootstrap draws (Fisher, The Design of Experiments, 1935, 21). Square roots are summed,
  /// so that one large block does not dominate. The test is conditional on this place: it only tests which map the
  /// differences belong to.
  double exchange_p(const std::function<Eigen::VectorXd(const Eigen::MatrixXd& blocks)>& differences) const;

  /// Degrees of freedom for Student's t.
  double degrees_of_freedom() const { return effective_ - 1.0; }

 private:
  Eigen::RowVectorXd total_;
  Eigen::MatrixXd blocks_;  ///< [block][column]
  std::uint64_t seed_ = 0;
  Eigen::MatrixXd of_blocks_, of_quarters_;  ///< [draw][column], sums over the drawn
  double effective_ = 0;
};

}  // namespace tileflight::metrics
