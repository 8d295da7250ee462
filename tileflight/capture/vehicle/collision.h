#pragma once

#include <functional>
#include <optional>
#include <string>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::vehicle {

/// The first intersection of a segment with a surface: its point and unit normal (of either sign).
struct SurfaceHit {
  geometry::Vec3 point;
  geometry::Vec3 normal;
  std::string object{};  ///< name of what was hit, as the query calls it; empty: the place
};

/// Ray query: the first surface on the segment between two points (local frame), or nothing. A function, so that a
/// vehicle does not depend on a scene.
using ObstacleQuery = std::function<std::optional<SurfaceHit>(const geometry::Vec3& from, const geometry::Vec3& to)>;

/// First contact of a moving sphere: its centre at contact, and the surface.
struct Contact {
  geometry::Vec3 center;
  geometry::Vec3 point;   ///< surface point that was hit
  geometry::Vec3 normal;  ///< unit length, from the surface to the sphere
  std::string object{};   ///< SurfaceHit::object
};

/// Finds the first contact of a sphere that moves along a segment: its centre keeps at least `radius_m` from the plane
/// of each surface found; nothing if there is no contact. Surfaces are found by a ray along the centre's path, so the
/// centre never passes through one whatever the length, and by probe rays in 26 directions around the sphere at least
/// every radius. A plane is found exactly; a curved body is approximated by its tangent plane where it was hit (contact
/// slightly early); a thin object beside the path is found only if a probe ray hits it. A sphere that already touches a
/// surface and moves away from it makes no contact.
std::optional<Contact> first_contact(const ObstacleQuery& obstacles, const geometry::Vec3& from,
                                     const geometry::Vec3& to, double radius_m);

/// Tells whether a sphere at rest intersects a surface, as far as the probe rays detect.
bool touches(const ObstacleQuery& obstacles, const geometry::Vec3& center, double radius_m);

/// Parameters of bounces off a surface.
struct BounceOptions {
  double restitution = 0.55;          ///< AirSim's
  double friction = 0.5;              ///< AirSim's; Coulomb's coefficient
  double min_bounce_speed_m_s = 0.3;  ///< slower impacts do not bounce
};

/// Computes the velocity after contact with a surface at rest: the normal component is reversed and scaled by the
/// restitution, the tangential one is reduced by Coulomb friction of the same impulse. The impulse is central and
/// causes no rotation. A velocity that points away from the surface is unchanged.
geometry::Vec3 bounce_velocity(const geometry::Vec3& velocity_m_s, const geometry::Vec3& normal,
                               const BounceOptions& options);

}  // namespace tileflight::vehicle
