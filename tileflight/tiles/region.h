#pragma once

#include <optional>
#include <vector>

#include "tileflight/geometry/geodesy.h"
#include "tileflight/geometry/mesh.h"
#include "tileflight/geometry/prism.h"
#include "tileflight/tiles/bounding_volume.h"

namespace tileflight::tiles {

/// A polygon of a map, with its holes.
struct GeographicArea {
  /// Longitude and latitude, degrees, outer rings and holes alike; edges are straight in these numbers (RFC 7946,
  /// section 3.1.1).
  std::vector<geometry::Ring> rings;
  std::optional<double> min_height_m, max_height_m;  ///< above the ellipsoid; nullopt: as the region's box reaches
};

/// The part of a place that is wanted: an upright box in the local frame, or the polygons in it.
struct Region {
  geometry::Vec3 center = geometry::Vec3::Zero();  ///< metres, local frame
  geometry::Vec3 size = geometry::Vec3::Zero();    ///< metres east, north, up
  std::vector<geometry::Prism> parts = {};         ///< inside the box; empty: all of it

  geometry::Box3 box() const { return {center - size / 2, center + size / 2}; }
};

/// Whether anything inside the volume may lie in the region: for a box as the volume's own test says, for polygons if
/// the volume meets a polygon's box and its shadow on the ground plane meets the polygon. Never wrongly false.
bool meets(const BoundingVolume& volume, const geometry::SE3& T_local_tileset, const Region& region);

/// An area as a prism of the local frame. Its heights become heights over the frame's plane as they are at the area's
/// middle; `box` gives those that it does not name.
geometry::Prism prism_of(const GeographicArea& area, const geometry::LocalFrame& frame, const geometry::Box3& box);

}  // namespace tileflight::tiles
