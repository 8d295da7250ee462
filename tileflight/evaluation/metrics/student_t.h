#pragma once

namespace tileflight::metrics {

/// Regularised incomplete beta function: NIST Digital Library of Mathematical Functions, 8.17. a, b above zero.
double incomplete_beta(double x, double a, double b);

/// Distribution function of Student's t; the degrees of freedom are positive and need not be integers. By the
/// incomplete beta function: NIST Digital Library of Mathematical Functions, 8.17.
double student_t_cdf(double t, double degrees_of_freedom);

/// Inverse of student_t_cdf(), for probabilities between 0 and 1 (exclusive).
double student_t_quantile(double probability, double degrees_of_freedom);

}  // namespace tileflight::metrics
