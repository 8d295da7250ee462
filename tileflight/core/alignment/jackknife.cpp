#include "tileflight/core/alignment/jackknife.h"

#include <cmath>
#include <limits>

namespace tileflight::alignment {

double jackknife_sigma_m(const geometry::Sim3& whole, std::size_t groups, const PointSpread& points,
                         const std::function<geometry::Sim3(std::size_t group)>& without) {
  if (groups < 2) return std::numeric_limits<double>::quiet_NaN();
  double sum = 0.0;
  for (std::size_t g = 0; g < groups; ++g) {
    const double moved_m = rms_motion_m(whole, without(g), points);
    sum += moved_m * moved_m;
  }
  const auto n = static_cast<double>(groups);
  return std::sqrt((n - 1.0) / n * sum);
}

}  // namespace tileflight::alignment
