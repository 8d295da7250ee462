#pragma once

struct pj_ctx;    // PROJ's PJ_CONTEXT
struct PJconsts;  // PROJ's PJ

#include <memory>
#include <optional>
#include <string>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::geometry {

/// A transformation of coordinates by PROJ, which prints nothing and asks no network. One object per thread.
class Projection {
 public:
  /// Makes a transformation from a reference system, such as EPSG:32717, to longitude, latitude (degrees) and height
  /// (m) on WGS84. nullopt: PROJ does not know the system.
  static std::optional<Projection> to_geodetic(const std::string& reference_system);
  /// Makes a transformation from PROJ's own syntax ("+proj=…"), with angles in radians. nullopt: PROJ lacks a grid that
  /// it names, or does not understand it.
  static std::optional<Projection> from_definition(const std::string& definition);

  /// Transforms coordinates; nullopt where the transformation is not defined.
  std::optional<Vec3> operator()(const Vec3& coordinates) const;

 private:
  struct Deleter {
    void operator()(pj_ctx* context) const;
    void operator()(PJconsts* transformation) const;
  };

  Projection();

  std::unique_ptr<pj_ctx, Deleter> context_;
  std::unique_ptr<PJconsts, Deleter> transformation_;
};

/// Height above the WGS84 ellipsoid, metres.
struct EllipsoidalHeight {
  double m = 0.0;
};

/// Height above mean sea level (the EGM96 geoid), metres. A separate type, so that the two cannot be mixed up.
struct OrthometricHeight {
  double m = 0.0;
};

/// A position on WGS84. Degrees are used only here and in files edited by people.
struct Geodetic {
  double latitude_deg = 0.0;
  double longitude_deg = 0.0;
  EllipsoidalHeight height;
};

/// Converts WGS84 geodetic coordinates to earth-centred earth-fixed metres, and back (GeographicLib).
Vec3 ecef_from_geodetic(const Geodetic& place);
Geodetic geodetic_from_ecef(const Vec3& ecef_m);

/// Adds the geoid undulation at the given position (PROJ, EGM96). Throws InputError if the geoid grid is not installed.
EllipsoidalHeight ellipsoidal_from_orthometric(double latitude_deg, double longitude_deg, OrthometricHeight height);
/// Subtracts the geoid undulation: the inverse of ellipsoidal_from_orthometric(), with the same errors.
OrthometricHeight orthometric_from_ellipsoidal(const Geodetic& place);

/// Right-handed east-north-up frame at `origin`; up is the ellipsoid's normal.
class LocalFrame {
 public:
  explicit LocalFrame(const Geodetic& origin);

  const Geodetic& origin() const { return origin_; }
  const SE3& T_ecef_local() const { return T_ecef_local_; }
  const SE3& T_local_ecef() const { return T_local_ecef_; }

  Vec3 local_from_geodetic(const Geodetic& place) const;
  Geodetic geodetic_from_local(const Vec3& local_m) const;

 private:
  Geodetic origin_;
  SE3 T_ecef_local_;
  SE3 T_local_ecef_;
};

}  // namespace tileflight::geometry
