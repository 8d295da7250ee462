#pragma once

#include <optional>
#include <span>

namespace tileflight::imaging {

/// Value of c[0] + c[1] x + c[2] x^2 + ... (Horner).
double polynomial_value(std::span<const double> c, double x);

/// Smallest x in (0, upper] at which the polynomial is zero or below, for one with a positive value at 0; nullopt where
/// it stays positive. Found between the roots of its derivative, so that no sign change is missed.
std::optional<double> first_nonpositive(std::span<const double> c, double upper);

}  // namespace tileflight::imaging
