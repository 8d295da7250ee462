#pragma once

#include <functional>
#include <optional>

#include "tileflight/geometry/transform.h"

namespace tileflight::flight {

/// A surface that a segment meets first: where, and its normal (unit length, either side).
struct SurfaceHit {
  geometry::Vec3 point;
  geometry::Vec3 normal;
};

/// What stands in the way: the first surface on the segment from one point to another (local frame), or nothing. A
/// function, so that a vehicle needs to know no scene.
using Obstacles = std::function<std::optional<SurfaceHit>(const geometry::Vec3& from, const geometry::Vec3& to)>;

/// The plane at a height, for flights without a scene.
Obstacles level_ground(double height_m);

/// Where a moving ball first touches: its centre then, and the surface.
struct Contact {
  geometry::Vec3 center;
  geometry::Vec3 point;   ///< that was seen of the surface
  geometry::Vec3 normal;  ///< unit, from the surface to the ball
};

/// Where a ball that moves from one point to another touches a surface first, its centre at least `radius_m` from the
/// plane of each surface seen; nothing if it does not. Surfaces are looked for along the centre's way, which therefore
/// never passes through one however long it is, and by feelers in 26 directions around the ball at least every radius:
/// a plane is found exactly, of a body that bulges the plane where it was seen (a little early), of thin things beside
/// the way those that a feeler meets. A ball that already touches and moves away does not touch.
std::optional<Contact> first_contact(const Obstacles& obstacles, const geometry::Vec3& from, const geometry::Vec3& to,
                                     double radius_m);

/// Whether a ball at rest reaches into a surface, as far as feelers see.
bool touches(const Obstacles& obstacles, const geometry::Vec3& center, double radius_m);

struct BounceOptions {
  double restitution = 0.55;  ///< AirSim's
  double friction = 0.5;      ///< AirSim's; Coulomb's coefficient
  double resting_m_s = 0.3;   ///< slower impacts do not bounce
};

/// The velocity after touching a surface at rest: the part along the normal is turned back by the restitution, the one
/// along the surface slowed by Coulomb friction of the same impulse. A central impulse: it gives no spin. A velocity
/// that leads away stays.
geometry::Vec3 bounced(const geometry::Vec3& velocity_m_s, const geometry::Vec3& normal, const BounceOptions& options);

}  // namespace tileflight::flight
