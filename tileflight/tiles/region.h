#pragma once

#include <optional>
#include <vector>

#include "tileflight/geometry/geodesy.h"
#include "tileflight/geometry/mesh.h"

namespace tileflight::tiles {

/// The part of a place that is wanted: an upright box in the local frame.
struct Region {
  geometry::Vec3 center = geometry::Vec3::Zero();  ///< metres, local frame
  geometry::Vec3 size = geometry::Vec3::Zero();    ///< metres east, north, up

  geometry::Box3 box() const { return {center - size / 2, center + size / 2}; }
};

}  // namespace tileflight::tiles
