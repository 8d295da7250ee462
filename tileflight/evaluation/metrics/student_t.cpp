#include "tileflight/evaluation/metrics/student_t.h"

#include <cassert>
#include <cmath>

namespace tileflight::metrics {

namespace {

/// Coefficient k of the continued fraction, DLMF 8.17.23.
double fraction_coefficient(int k, double x, double a, double b) {
  const double m = k / 2;
  if (k % 2 == 0) return m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m));
  return -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1));
}

}  // namespace

// DLMF 8.17.22, from the innermost term outwards.
double incomplete_beta(double x, double a, double b) {
  if (x <= 0.0) return 0.0;
  if (x >= 1.0) return 1.0;
  if (x > (a + 1) / (a + b + 2)) return 1.0 - incomplete_beta(1.0 - x, b, a);
  constexpr int kTerms = 100;
  double fraction = 1.0;
  for (int k = kTerms; k > 0; --k) fraction = 1.0 + fraction_coefficient(k, x, a, b) / fraction;
  const double log_beta = std::lgamma(a) + std::lgamma(b) - std::lgamma(a + b);
  return std::exp(a * std::log(x) + b * std::log1p(-x) - log_beta) / (a * fraction);
}

double student_t_cdf(double t, double degrees_of_freedom) {
  assert(degrees_of_freedom > 0.0);
  const double outside =
      incomplete_beta(degrees_of_freedom / (degrees_of_freedom + t * t), degrees_of_freedom / 2, 0.5);
  return t > 0.0 ? 1.0 - outside / 2 : outside / 2;
}

double student_t_quantile(double probability, double degrees_of_freedom) {
  assert(probability > 0.0 && probability < 1.0);
  if (probability < 0.5) return -student_t_quantile(1.0 - probability, degrees_of_freedom);
  double high = 1.0;
  while (student_t_cdf(high, degrees_of_freedom) < probability && high < 1e300) high *= 2;
  double low = 0.0;
  for (int halvings = 0; halvings < 200 && low < high; ++halvings) {
    const double middle = low + (high - low) / 2;
    if (middle == low || middle == high) break;
    (student_t_cdf(middle, degrees_of_freedom) < probability ? low : high) = middle;
  }
  return high;
}

}  // namespace tileflight::metrics
