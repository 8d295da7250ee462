#include "tileflight/capture/flight_path/rotation_spline.h"

namespace tileflight::flight_path {
namespace {

using geometry::Mat3;
using geometry::SE3;
using geometry::so3_exp;
using geometry::so3_log;
using geometry::Vec3;
using geometry::Vec6;

/// Rotation vector from control point j of a segment to the next.
Vec3 step(const RotationSpline& spline, std::size_t segment, std::size_t j) {
  return so3_log(spline.controls[segment + j].conjugate() * spline.controls[segment + j + 1]);
}

Vec6 twist(const Vec3& translation, const Vec3& omega_rad) {
  Vec6 result;
  result << translation, omega_rad;
  return result;
}

}  // namespace

/// The right Jacobian at w is the left Jacobian at -w, computed column by column: the exponential of a twist applies it
/// to the translation.
Mat3 right_jacobian(const Vec3& omega_rad) {
  Mat3 jacobian;
  for (int i = 0; i < 3; ++i) jacobian.col(i) = SE3::exp(twist(Vec3::Unit(i), -omega_rad)).translation;
  return jacobian;
}

Mat3 right_jacobian_inverse(const Vec3& omega_rad) {
  const Eigen::Quaterniond rotation = so3_exp(-omega_rad);
  Mat3 inverse;
  for (int i = 0; i < 3; ++i) inverse.col(i) = SE3(rotation, Vec3::Unit(i)).log().head<3>();
  return inverse;
}

Eigen::Quaterniond RotationSpline::at(double time_s) const {
  const auto [segment, u] = knots.find_span(time_s);
  const Weights3 weights = cumulative_weights(basis(u));
  Eigen::Quaterniond rotation = controls[segment];
  for (std::size_t j = 0; j < 3; ++j) rotation = rotation * so3_exp(weights[j] * step(*this, segment, j));
  return rotation.normalized();
}

AngularMotion RotationSpline::angular_motion(double time_s) const {
  const auto [segment, u] = knots.find_span(time_s);
  const Weights3 weights = cumulative_weights(basis(u)), first = cumulative_weights(basis_derivative(u)),
                 second = cumulative_weights(basis_second_derivative(u));
  const double per_s = 1.0 / knots.spacing_s;
  AngularMotion turning;
  for (std::size_t j = 0; j < 3; ++j) {
    const Vec3 d = step(*this, segment, j);
    const Eigen::Quaterniond back = so3_exp(-weights[j] * d);
    const Vec3 rate = back * turning.rate + per_s * first[j] * d;
    turning.acceleration =
        per_s * first[j] * rate.cross(d) + back * turning.acceleration + per_s * per_s * second[j] * d;
    turning.rate = rate;
  }
  return turning;
}

/// A rotated control point changes the steps before and after it; the rotation of a step's end is transformed by the
/// steps that follow.
RotationSpline::Sensitivity RotationSpline::sensitivity(double time_s) const {
  const auto [segment, u] = knots.find_span(time_s);
  const Weights3 weights = cumulative_weights(basis(u));
  Sensitivity result{segment, Eigen::Quaterniond::Identity(), {}};
  result.control_jacobians.fill(Mat3::Zero());
  Eigen::Quaterniond behind = Eigen::Quaterniond::Identity();  // product of the steps after step j
  for (std::size_t j = 3; j-- > 0;) {
    const Vec3 d = step(*this, segment, j);
    const Mat3 by_step = behind.conjugate().toRotationMatrix() * right_jacobian(weights[j] * d) * weights[j];
    const Mat3 inverse = right_jacobian_inverse(d);
    result.control_jacobians[j + 1] += by_step * inverse;
    result.control_jacobians[j] -= by_step * inverse.transpose();
    behind = so3_exp(weights[j] * d) * behind;
  }
  result.control_jacobians[0] += behind.conjugate().toRotationMatrix();
  result.rotation = (controls[segment] * behind).normalized();
  return result;
}

}  // namespace tileflight::flight_path
