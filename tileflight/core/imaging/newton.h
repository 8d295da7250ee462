#pragma once

#include <algorithm>
#include <cmath>

namespace tileflight::imaging {

inline constexpr double kNewtonTolerance =
    1e-14;                                  ///< relative step to stop at: below 1e-9 px at any focal length in use
inline constexpr int kMaxNewtonSteps = 60;  ///< bisection alone needs about 52; Newton takes 3 to 6

/// Solves value(t) = target for an increasing function on [lower, upper] by Newton's method inside a shrinking bracket.
template <class Value, class Slope>
double solve_increasing(double target, double start, double lower, double upper, const Value& value,
                        const Slope& slope) {
  constexpr double kLastStep = 1e-9;
  double t = std::clamp(start, lower, upper);
  for (int i = 0; i < kMaxNewtonSteps; ++i) {
    const double excess = value(t) - target;
    (excess > 0.0 ? upper : lower) = t;
    double next = t - excess / slope(t);
    const bool newton = next >= lower && next <= upper;
    if (!newton) next = 0.5 * (lower + upper);
    const double step = std::abs(next - t);
    t = next;
    // Newton's error is squared by each step: after a step of 1e-9 the remaining value - target is below rounding.
    if (step <= (newton ? kLastStep : kNewtonTolerance) * (1.0 + std::abs(t))) break;
  }
  return t;
}

}  // namespace tileflight::imaging
