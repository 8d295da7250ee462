#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <numbers>

namespace tileflight::geometry {

inline constexpr double kRadiansPerDegree = std::numbers::pi / 180.0;

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;
using Mat4 = Eigen::Matrix4d;
using Vec6 = Eigen::Matrix<double, 6, 1>;
using Vec7 = Eigen::Matrix<double, 7, 1>;

/// Returns the matrix [v]x with [v]x w = v x w.
Mat3 skew(const Vec3& v);

/// Converts a rotation vector (axis times angle, radians) to a unit quaternion, and back (angle in [0, pi]).
Eigen::Quaterniond so3_exp(const Vec3& omega_rad);
Vec3 so3_log(const Eigen::Quaterniond& rotation);

/// Rigid motion. `T_a_b` maps coordinates in frame b to frame a: p_a = T_a_b * p_b.
struct SE3 {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  ///< unit length
  Vec3 translation = Vec3::Zero();                               ///< metres

  SE3() = default;
  SE3(const Eigen::Quaterniond& r, const Vec3& t) : rotation(r.normalized()), translation(t) {}
  SE3(const Mat3& r, const Vec3& t) : rotation(Eigen::Quaterniond(r).normalized()), translation(t) {}

  Vec3 operator*(const Vec3& p) const { return rotation * p + translation; }
  SE3 operator*(const SE3& o) const { return {rotation * o.rotation, rotation * o.translation + translation}; }
  SE3 inverse() const {
    const Eigen::Quaterniond inverse_rotation = rotation.conjugate();
    return {inverse_rotation, -(inverse_rotation * translation)};
  }
  Mat4 matrix() const;

  /// Exponential of a twist (translation first, rotation last), and its inverse. Barfoot, State Estimation for
  /// Robotics, section 7.1.
  static SE3 exp(const Vec6& twist);
  Vec6 log() const;
};

/// Similarity: p_a = scale * (rotation * p_b) + translation.
struct Sim3 {
  double scale = 1.0;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  ///< unit length
  Vec3 translation = Vec3::Zero();                               ///< metres (of frame a)

  Sim3() = default;
  Sim3(double s, const Eigen::Quaterniond& r, const Vec3& t) : scale(s), rotation(r.normalized()), translation(t) {}
  explicit Sim3(const SE3& T) : rotation(T.rotation), translation(T.translation) {}

  Vec3 operator*(const Vec3& p) const { return scale * (rotation * p) + translation; }
  Sim3 operator*(const Sim3& o) const {
    return {scale * o.scale, rotation * o.rotation, scale * (rotation * o.translation) + translation};
  }
  Sim3 inverse() const {
    const Eigen::Quaterniond inverse_rotation = rotation.conjugate();
    return {1.0 / scale, inverse_rotation, -(inverse_rotation * translation) / scale};
  }
  Mat4 matrix() const;

  /// Transforms a pose from frame b to frame a: the similarity applies to the position, its rotation to the
  /// orientation.
  SE3 operator*(const SE3& T_b_c) const { return {rotation * T_b_c.rotation, *this * T_b_c.translation}; }

  /// From a 4x4 matrix with uniform scale; throws InputError if it is not a similarity.
  static Sim3 from_matrix(const Mat4& m);
};

/// Returns the left Jacobian J of SO(3), and its inverse: so3_exp(omega + d) = so3_exp(J d) so3_exp(omega) to first
/// order in d. Barfoot, State Estimation for Robotics, (7.37) and (7.38); the inverse for angles below 2 pi.
Mat3 so3_left_jacobian(const Vec3& omega_rad);
Mat3 so3_left_jacobian_inverse(const Vec3& omega_rad);

/// Returns the right Jacobian J of SO(3), and its inverse: so3_exp(omega + d) = so3_exp(omega) so3_exp(J d).
inline Mat3 so3_right_jacobian(const Vec3& omega_rad) { return so3_left_jacobian(-omega_rad); }
inline Mat3 so3_right_jacobian_inverse(const Vec3& omega_rad) { return so3_left_jacobian_inverse(-omega_rad); }

}  // namespace tileflight::geometry
