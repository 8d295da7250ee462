#include "tileflight/core/imaging/plane_distortion.h"

#include <vector>

namespace tileflight::imaging {

namespace {

std::vector<double> derivative(std::span<const double> c) {
  std::vector<double> d;
  for (std::size_t i = 1; i < c.size(); ++i) d.push_back(static_cast<double>(i) * c[i]);
  return d;
}

/// The root between two arguments whose values have opposite signs (or one is zero), to full precision.
double bisect(std::span<const double> c, double lower, double upper) {
  const bool lower_is_positive = evaluate_polynomial(c, lower) > 0.0;
  for (;;) {
    const double middle = 0.5 * (lower + upper);
    if (middle <= lower || middle >= upper) return upper;
    ((evaluate_polynomial(c, middle) > 0.0) == lower_is_positive ? lower : upper) = middle;
  }
}

/// All sign changes in (0, upper], ascending: between neighbouring roots of the derivative the polynomial is monotone.
std::vector<double> sign_changes(std::span<const double> c, double upper) {
  if (c.size() <= 1) return {};
  std::vector<double> ends = sign_changes(derivative(c), upper);
  ends.push_back(upper);
  std::vector<double> roots;
  double lower = 0.0;
  for (const double end : ends) {
    if ((evaluate_polynomial(c, lower) > 0.0) != (evaluate_polynomial(c, end) > 0.0))
      roots.push_back(bisect(c, lower, end));
    lower = end;
  }
  return roots;
}

}  // namespace

double evaluate_polynomial(std::span<const double> c, double x) {
  double value = 0.0;
  for (std::size_t i = c.size(); i-- > 0;) value = value * x + c[i];
  return value;
}

std::optional<double> first_nonpositive(std::span<const double> c, double upper) {
  const std::vector<double> roots = sign_changes(c, upper);
  if (roots.empty()) return std::nullopt;
  return roots.front();
}

}  // namespace tileflight::imaging
