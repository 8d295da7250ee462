#pragma once

#include <optional>
#include <span>

namespace tileflight::imaging {

/// Value of c[0] + c[1] x + c[2] x^2 + ... (Horner).
double evaluate_polynomial(std::span<const double> c, double x);

/// Smallest x in (0, upper] at which the polynomial is zero or negative; its value at 0 must be positive. nullopt if it
/// stays positive. Searches between the roots of the derivative, so that no sign change is missed.
std::optional<double> first_nonpositive(std::span<const double> c, double upper);

}  // namespace tileflight::imaging
