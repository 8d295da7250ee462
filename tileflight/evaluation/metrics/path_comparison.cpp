#include "tileflight/evaluation/metrics/path_comparison.h"

#include <algorithm>
#include <cmath>

namespace tileflight::metrics {

namespace {

/// Interval at 1 - alpha of the expected error from the error of one path: chi-square with two degrees of freedom,
/// whose quantile is -2 ln(1 - q).
std::array<double, 2> interval_of(double error_m, double alpha) {
  return {error_m / std::sqrt(-std::log(0.5 * alpha)), error_m / std::sqrt(-std::log1p(-0.5 * alpha))};
}

/// Interval of the difference, by the method of variance estimates recovery (MOVER).
std::array<double, 2> difference_interval(double a_m, double b_m, double alpha) {
  const auto a = interval_of(a_m, alpha), b = interval_of(b_m, alpha);
  return {a_m - b_m - std::hypot(a_m - a[0], b[1] - b_m), a_m - b_m + std::hypot(a[1] - a_m, b_m - b[0])};
}

/// Largest alpha up to `most` at which `holds` is still false for the interval at 1 - alpha, which shrinks as alpha
/// grows; 0 if it is true for all.
template <class Holds>
double last_alpha_without(double most, const Holds& holds) {
  double low = 0.0, high = most;
  if (!holds(high)) return most;
  for (int halvings = 0; halvings < 60; ++halvings) {
    const double middle = 0.5 * (low + high);
    (holds(middle) ? high : low) = middle;
  }
  return low;
}

/// Above this alpha both ends of interval_of() are on the same side of the error.
constexpr double kMaxAlpha = 0.7;

double p_difference_within(double a_m, double b_m, double margin_m) {
  const double p = last_alpha_without(kMaxAlpha, [&](double alpha) {
    const auto interval = difference_interval(a_m, b_m, alpha);
    return interval[0] > margin_m || interval[1] < -margin_m;
  });
  return p < kMaxAlpha ? p : 1.0;
}

double p_difference_beyond(double a_m, double b_m, double margin_m) {
  const double alpha = last_alpha_without(kMaxAlpha, [&](double at) {
    const auto interval = difference_interval(a_m, b_m, at);
    return interval[0] > -margin_m && interval[1] < margin_m;
  });
  return alpha < kMaxAlpha ? 0.5 * alpha : 1.0;  // half for each of the two tests
}

/// Upper tail probability of F(2, 2).
double upper_tail(double x) { return 1.0 / (1.0 + x); }

}  // namespace

void judge_single_paths(double simulated_m, double real_m, ComparedMetric& m) {
  constexpr double kAlpha = 0.05;
  m.simulated = simulated_m;
  m.real = real_m;
  m.difference = simulated_m - real_m;
  m.sampling_unit = "one path";
  if (!(simulated_m > 0.0) || !(real_m > 0.0)) return;
  m.ratio = simulated_m / real_m;
  const double widest = std::sqrt((1.0 - 0.5 * kAlpha) / (0.5 * kAlpha));  // root of the F's quantile q / (1 - q)
  m.ratio_ci95 = {m.ratio / widest, m.ratio * widest};
  m.difference_ci95 = difference_interval(simulated_m, real_m, kAlpha);
  const double farther = std::max(m.ratio, 1.0 / m.ratio) / m.margin;
  const double p_ratio_within = std::min(1.0, 2.0 * upper_tail(farther * farther));
  const double p_ratio_beyond = upper_tail(1.0 / (farther * farther));
  m.p_within = std::max(p_ratio_within, p_difference_within(simulated_m, real_m, m.absolute_margin));
  m.p_beyond = std::min(p_ratio_beyond, p_difference_beyond(simulated_m, real_m, m.absolute_margin));
}

}  // namespace tileflight::metrics
