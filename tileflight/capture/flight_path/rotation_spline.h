#pragma once

#include <array>
#include <vector>

#include "tileflight/capture/flight_path/b_spline.h"
#include "tileflight/capture/flight_path/orientation_curve.h"

namespace tileflight::flight_path {

/// Cumulative uniform cubic B-spline of rotations (Kim, Kim, Shin 1995): R(t) = R_i exp(λ1 d1) exp(λ2 d2) exp(λ3 d3)
/// with dj = log(R_(i+j-1)' R_(i+j)). Twice continuously differentiable; reproduces rotation at a constant rate
/// exactly.
struct RotationSpline {
  UniformKnots knots;
  std::vector<Eigen::Quaterniond> controls;  ///< size: knots.control_count(); neighbours differ by less than pi

  Eigen::Quaterniond at(double time_s) const;
  /// Derivatives by time, in the rotated frame. Sommer et al. 2020, (38) to (41).
  AngularMotion angular_motion(double time_s) const;

  /// Rotation at a time, and the Jacobians of a small rotation of it (in the rotated frame) by small rotations of the
  /// segment's four control points (each in its own frame).
  struct Sensitivity {
    std::size_t segment;
    Eigen::Quaterniond rotation;
    std::array<geometry::Mat3, 4> control_jacobians;
  };
  Sensitivity sensitivity(double time_s) const;
};

/// The right Jacobian of rotations and its inverse: exp(w + dw) = exp(w) exp(J dw). Barfoot, State Estimation for
/// Robotics, section 7.1.
geometry::Mat3 right_jacobian(const geometry::Vec3& omega_rad);
geometry::Mat3 right_jacobian_inverse(const geometry::Vec3& omega_rad);

}  // namespace tileflight::flight_path
