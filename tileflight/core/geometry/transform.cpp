#include "tileflight/core/geometry/transform.h"

#include <cmath>

#include "tileflight/core/base/input_error.h"

namespace tileflight::geometry {

namespace {

/// Below this angle the Taylor series of the coefficients are accurate to double precision.
constexpr double kSmallJacobianAngle_rad = 1e-4;

/// Below this angle the Taylor series of the coefficients are accurate to double precision.
constexpr double kSmallAngle_rad = 1e-4;

Mat4 homogeneous(const Mat3& linear, const Vec3& translation) {
  Mat4 m = Mat4::Identity();
  m.topLeftCorner<3, 3>() = linear;
  m.topRightCorner<3, 1>() = translation;
  return m;
}

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

Mat3 skew(const Vec3& v) {
  Mat3 m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

Eigen::Quaterniond so3_exp(const Vec3& omega_rad) {
  const double angle = omega_rad.norm();
  const double half = 0.5 * angle;
  // sin(angle / 2) / angle
  const double factor = angle < kSmallAngle_rad ? 0.5 - angle * angle / 48.0 : std::sin(half) / angle;
  const Vec3 v = factor * omega_rad;
  return Eigen::Quaterniond(std::cos(half), v.x(), v.y(), v.z()).normalized();
}

Vec3 so3_log(const Eigen::Quaterniond& rotation) {
  // q and -q are the same rotation; the one with a non-negative real part has an angle of at most pi.
  const double sign = rotation.w() < 0.0 ? -1.0 : 1.0;
  const Vec3 v = sign * rotation.vec();
  const double w = sign * rotation.w();
  const double sine = v.norm();
  if (sine < 1e-9) return 2.0 * v / w;
  return 2.0 * std::atan2(sine, w) / sine * v;
}

Mat4 SE3::matrix() const { return homogeneous(rotation.toRotationMatrix(), translation); }

SE3 SE3::exp(const Vec6& twist) {
  const Vec3 omega_rad = twist.tail<3>();
  return {so3_exp(omega_rad), so3_left_jacobian(omega_rad) * twist.head<3>()};
}

Vec6 SE3::log() const {
  const Vec3 omega_rad = so3_log(rotation);
  Vec6 twist;
  twist << so3_left_jacobian_inverse(omega_rad) * translation, omega_rad;
  return twist;
}

Mat4 Sim3::matrix() const { return homogeneous(scale * rotation.toRotationMatrix(), translation); }

Sim3 Sim3::from_matrix(const Mat4& m) {
  const char* where = "4x4 matrix";
  if (!m.allFinite()) throw InputError(where, "contains a number that is not finite");
  if (m.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) throw InputError(where, "the last row is not 0 0 0 1");
  const Mat3 linear = m.topLeftCorner<3, 3>();
  const double determinant = linear.determinant();
  if (!(determinant > 0.0))
    throw InputError(where, "is not a similarity: its determinant must be positive (it mirrors or flattens)");
  const double scale = std::cbrt(determinant);
  const Mat3 rotation = linear / scale;
  if (!(rotation * rotation.transpose()).isApprox(Mat3::Identity(), 1e-6)) {
    throw InputError(where, "is not a similarity: its axes are sheared or scaled unequally");
  }
  return {scale, Eigen::Quaterniond(rotation), m.topRightCorner<3, 1>()};
}

}  // namespace tileflight::geometry
