#pragma once

#include <variant>

#include "tileflight/capture/flight_path/cubic_spline.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::flight_path {

/// First and second derivative of an orientation R by a curve's parameter u, in the camera frame: R' = R [rate]x.
struct AngularMotion {
  geometry::Vec3 rate = geometry::Vec3::Zero();          ///< radians per unit of u
  geometry::Vec3 acceleration = geometry::Vec3::Zero();  ///< d rate / du
};

/// A point that moves with u.
struct MovingPoint {
  geometry::Vec3 position, first_derivative, second_derivative;  ///< position and its derivatives by u
};

/// Blends unit quaternions by a spline in four dimensions and normalizes the result. Multiplying all quaternions by a
/// rotation from either side is a rotation of the four-dimensional space, which commutes with splines, so the blend
/// does not depend on the choice of frames.
struct BlendedOrientation {
  CubicSpline<4> quaternion;  ///< x, y, z, w

  Eigen::Quaterniond at(double u) const;
  AngularMotion angular_motion(double u) const;
};

/// Looks from the camera's position at a moving target, with a roll angle.
struct TargetOrientation {
  CubicSpline<4> target_and_roll;  ///< x, y, z of the target in metres, roll in degrees

  Eigen::Quaterniond at(double u, const geometry::Vec3& position) const;
  AngularMotion angular_motion(double u, const MovingPoint& camera) const;
};

using OrientationCurve = std::variant<BlendedOrientation, TargetOrientation>;

/// Orientation of a camera that looks along `to_target` (not vertical) with a level horizon, rolled by `roll_deg`
/// (positive: right side down).
Eigen::Quaterniond orientation_looking_along(const geometry::Vec3& to_target, double roll_deg);

}  // namespace tileflight::flight_path
