#pragma once

#include <optional>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/core/imaging/camera.h"

/// Lens models that project by way of one or two unit spheres, in normalised coordinates m = (x, y) / D(x, y, z):
/// double sphere, unified (a sphere and a pinhole) and extended unified (an ellipsoid and a pinhole). Notation: theta
/// is the ray's angle from the axis; phi its angle seen from the centre shifted by xi, tan phi = sin theta / (xi + cos
/// theta).
namespace tileflight::imaging::sphere_lenses {

struct Denominator {
  double value = 0.0;
  geometry::Vec3 gradient = geometry::Vec3::Zero();
};

/// D of a point, with its derivative.
Denominator denominator(const DoubleSphere& m, const geometry::Vec3& point);
Denominator denominator(const UnifiedModel& m, const geometry::Vec3& point);
Denominator denominator(const ExtendedUnifiedModel& m, const geometry::Vec3& point);

/// The ray (any length) of normalised, undistorted coordinates; nullopt if there is none.
std::optional<geometry::Vec3> unproject(const DoubleSphere& m, const geometry::Vec2& normalized);
std::optional<geometry::Vec3> unproject(const UnifiedModel& m, const geometry::Vec2& normalized);
std::optional<geometry::Vec3> unproject(const ExtendedUnifiedModel& m, const geometry::Vec2& normalized);

/// Angle from the axis at which |m| stops increasing or becomes infinite. (The bound given in the double sphere paper
/// differs and is smaller than necessary.)
double max_theta_rad(const DoubleSphere& m);
double max_theta_rad(const UnifiedModel& m);
double max_theta_rad(const ExtendedUnifiedModel& m);

}  // namespace tileflight::imaging::sphere_lenses
