#include "tileflight/core/geometry/so3_jacobians.h"

#include <cmath>

namespace tileflight::geometry {
namespace {

/// Below this angle the Taylor series of the coefficients are accurate to double precision.
constexpr double kSmallJacobianAngle_rad = 1e-4;

}  // namespace

Mat3 so3_left_jacobian(const Vec3& omega_rad) {
  const double angle = omega_rad.norm();
  const double angle2 = angle * angle;
  const bool small = angle < kSmallJacobianAngle_rad;
  const double half_sine = std::sin(0.5 * angle);
  const double a = small ? 0.5 - angle2 / 24.0 : 2.0 * half_sine * half_sine / angle2;  // (1 - cos) / angle^2
  const double b = small ? 1.0 / 6.0 - angle2 / 120.0 : (angle - std::sin(angle)) / (angle2 * angle);
  const Mat3 w = skew(omega_rad);
  return Mat3::Identity() + a * w + b * w * w;
}

Mat3 so3_left_jacobian_inverse(const Vec3& omega_rad) {
  const double angle = omega_rad.norm();
  const double half = 0.5 * angle;
  const double c = angle < kSmallJacobianAngle_rad ? 1.0 / 12.0 + angle * angle / 720.0
                                                   : (1.0 - half * std::cos(half) / std::sin(half)) / (angle * angle);
  const Mat3 w = skew(omega_rad);
  return Mat3::Identity() - 0.5 * w + c * w * w;
}

}  // namespace tileflight::geometry
