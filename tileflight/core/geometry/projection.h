#pragma once

#include <memory>
#include <optional>
#include <string>

#include "tileflight/core/geometry/transform.h"

struct pj_ctx;    // PROJ's PJ_CONTEXT
struct PJconsts;  // PROJ's PJ

namespace tileflight::geometry {

/// A transformation of coordinates by PROJ, which prints nothing and asks no network. One object per thread.
class Projection {
 public:
  /// From a reference system, such as EPSG:32717, to longitude, latitude (degrees) and height (m) on WGS84. Nullopt:
  /// PROJ does not know it.
  static std::optional<Projection> to_geodetic(const std::string& reference_system);
  /// A transformation in PROJ's own words ("+proj=…"), its angles in radians. Nullopt: PROJ lacks a grid that it names,
  /// or does not understand it.
  static std::optional<Projection> from_definition(const std::string& definition);

  /// Nullopt where the transformation is not defined.
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

}  // namespace tileflight::geometry
