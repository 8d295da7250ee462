#pragma once

#include <optional>

#include "tileflight/geometry/transform.h"
#include "tileflight/imaging/camera.h"

/// Lenses that project by way of one or two unit spheres, in normalised coordinates m = (x, y) / D(x, y, z): double
/// sphere, unified (a sphere and a pinhole) and extended unified (an ellipsoid and a pinhole). Notation: theta is the
/// ray's angle from the axis; phi its angle as seen from the centre shifted by xi, tan phi = sin theta / (xi + cos
/// theta).
namespace tileflight::imaging::sphere_lenses {

struct Denominator {
  double value = 0.0;
  geometry::Vec3 by_point = geometry::Vec3::Zero();
};

/// D of a point with its derivative.
Denominator denominator(const DoubleSphere& m, const geometry::Vec3& point);
Denominator denominator(const Unified& m, const geometry::Vec3& point);
Denominator denominator(const ExtendedUnified& m, const geometry::Vec3& point);

/// A ray (any length) of normalised, undistorted coordinates; nullopt where no ray goes.
std::optional<geometry::Vec3> ray_of(const DoubleSphere& m, const geometry::Vec2& normalized);
std::optional<geometry::Vec3> ray_of(const Unified& m, const geometry::Vec2& normalized);
std::optional<geometry::Vec3> ray_of(const ExtendedUnified& m, const geometry::Vec2& normalized);

/// Angle from the axis at which |m| stops growing or becomes infinite. (The bound that the double sphere's paper gives
/// is another one, which keeps less than all.)
double max_theta_rad(const DoubleSphere& m);
double max_theta_rad(const Unified& m);
double max_theta_rad(const ExtendedUnified& m);

}  // namespace tileflight::imaging::sphere_lenses
