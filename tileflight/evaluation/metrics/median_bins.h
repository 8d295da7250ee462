#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

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

}  // namespace tileflight::metrics
