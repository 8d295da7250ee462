#include "tileflight/flight/rotation_spline.h"

namespace tileflight::flight {
namespace {

using geometry::Mat3;
using geometry::SE3;
using geometry::so3_exp;
using geometry::so3_log;
using geometry::Vec3;
using geometry::Vec6;

/// From control point j of a segment to the next.
Vec3 step(const RotationSpline& spline, std::size_t segment, std::size_t j) {
  return so3_log(spline.controls[segment + j].conjugate() * spline.controls[segment + j + 1]);
}

Vec6 twist(const Vec3& translation, const Vec3& omega_rad) {
  Vec6 result;
  result << translation, omega_rad;
  return result;
}

}  // namespace

/// The left Jacobian at -w, column by column: it is what the exponential of a twist makes of its translation.
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
  const auto [segment, u] = knots.place(time_s);
  const Weights3 weights = cumulative(basis(u));
  Eigen::Quaterniond rotation = controls[segment];
  for (std::size_t j = 0; j < 3; ++j) rotation = rotation * so3_exp(weights[j] * step(*this, segment, j));
  return rotation.normalized();
}

Turning RotationSpline::turning(double time_s) const {
  const auto [segment, u] = knots.place(time_s);
  const Weights3 weights = cumulative(basis(u)), first = cumulative(basis_first(u)),
                 second = cumulative(basis_second(u));
  const double per_s = 1.0 / knots.spacing_s;
  Turning turning;
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

/// A control point that turns changes the step before it and the step behind it; what a step's end turns by is carried
/// through the steps behind.
RotationSpline::Sensitivity RotationSpline::sensitivity(double time_s) const {
  const auto [segment, u] = knots.place(time_s);
  const Weights3 weights = cumulative(basis(u));
  Sensitivity result{segment, Eigen::Quaterniond::Identity(), {}};
  result.by_control.fill(Mat3::Zero());
  Eigen::Quaterniond behind = Eigen::Quaterniond::Identity();  // of the steps behind step j
  for (std::size_t j = 3; j-- > 0;) {
    const Vec3 d = step(*this, segment, j);
    const Mat3 by_step = behind.conjugate().toRotationMatrix() * right_jacobian(weights[j] * d) * weights[j];
    const Mat3 inverse = right_jacobian_inverse(d);
    result.by_control[j + 1] += by_step * inverse;
    result.by_control[j] -= by_step * inverse.transpose();
    behind = so3_exp(weights[j] * d) * behind;
  }
  result.by_control[0] += behind.conjugate().toRotationMatrix();
  result.rotation = (controls[segment] * behind).normalized();
  return result;
}

}  // namespace tileflight::flight
