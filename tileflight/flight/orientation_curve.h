#pragma once

#include <variant>

#include "tileflight/flight/cubic_spline.h"
#include "tileflight/geometry/transform.h"

namespace tileflight::flight {

/// How an orientation changes with a curve's parameter u. Both in the camera frame: R' = R [rate]x.
struct Turning {
  geometry::Vec3 rate = geometry::Vec3::Zero();          ///< radians per unit of u
  geometry::Vec3 acceleration = geometry::Vec3::Zero();  ///< d rate / du
};

/// A point that moves with u.
struct MovingPoint {
  geometry::Vec3 position, first, second;  ///< and its derivatives by u
};

/// Blends unit quaternions by a spline in four dimensions, brought back to unit length. Turning all of them from either
/// side is a rotation of the four-dimensional space, which splines commute with: the blend does not depend on the
/// choice of frames.
struct BlendedOrientation {
  CubicSpline<4> quaternion;  ///< x, y, z, w

  Eigen::Quaterniond at(double u) const;
  Turning turning(double u) const;
};

/// Looks from the camera's place at a moving target, with a roll.
struct TargetOrientation {
  CubicSpline<4> target_and_roll;  ///< target in metres, roll in degrees

  Eigen::Quaterniond at(double u, const geometry::Vec3& position) const;
  Turning turning(double u, const MovingPoint& camera) const;
};

using OrientationCurve = std::variant<BlendedOrientation, TargetOrientation>;

/// Orientation of a camera that looks along `to_target`, which is not vertical, with the horizon level but for a roll
/// (degrees, positive: right side down).
Eigen::Quaterniond looking_along(const geometry::Vec3& to_target, double roll_deg);

}  // namespace tileflight::flight
