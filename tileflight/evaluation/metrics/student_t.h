#pragma once

namespace tileflight::metrics {

/// The 97.5 % quantile of the normal distribution.
inline constexpr double kNormal975 = 1.959963984540054;

/// Returns the regularised incomplete beta function I_x(a, b) (NIST Digital Library of Mathematical Functions, 8.17);
/// a and b are positive.
double incomplete_beta(double x, double a, double b);

/// Returns the distribution function of Student's t. The degrees of freedom are positive and need not be integers.
double student_t_cdf(double t, double degrees_of_freedom);

/// Returns the inverse of student_t_cdf() for a probability between 0 and 1 (exclusive).
double student_t_quantile(double probability, double degrees_of_freedom);

}  // namespace tileflight::metrics
