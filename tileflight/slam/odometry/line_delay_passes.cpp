#include "tileflight/slam/odometry/line_delay_passes.h"

#include <cmath>

namespace tileflight::odometry {

LineDelayPasses track_with_line_delay(double given_s, const std::function<OdometryResult(double line_delay_s)>& track) {
  constexpr double kSignificant = 3.0;  // standard deviations
  constexpr double kSettled = 0.2;      // the same: a smaller change is not worth another pass. Chosen by hand
  constexpr int kMostPasses = 4;
  LineDelayPasses found{.result = track(given_s), .line_delay_s = given_s, .estimate = {}, .passes = 1};
  for (;;) {
    found.estimate = found.result.line_delay;
    if (!found.estimate) return found;
    const double change_s = found.estimate->line_delay_s, sigma_s = found.estimate->sigma_s;
    found.estimate->line_delay_s += found.line_delay_s;
    const bool is_significant = std::abs(found.estimate->line_delay_s - given_s) > kSignificant * sigma_s;
    if (!is_significant && found.line_delay_s == given_s) return found;
    if (is_significant && (std::abs(change_s) < kSettled * sigma_s || found.passes == kMostPasses)) return found;
    found.line_delay_s = is_significant ? found.estimate->line_delay_s : given_s;
    found.result = track(found.line_delay_s);
    ++found.passes;
    if (!is_significant) return found;
  }
}

}  // namespace tileflight::odometry
