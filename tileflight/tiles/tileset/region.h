#pragma once

#include <optional>
#include <vector>

#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/core/geometry/mesh.h"
#include "tileflight/core/geometry/prism.h"
#include "tileflight/tiles/tileset/bounding_volume.h"

namespace tileflight::tileset {

/// A polygon on a map, with its holes.
struct GeographicArea {
  /// Longitude and latitude, degrees, outer rings and holes alike; edges are straight in these coordinates (RFC 7946,
  /// section 3.1.1).
  std::vector<geometry::Ring> rings;
  std::optional<double> min_height_m, max_height_m;  ///< above the ellipsoid; nullopt: heights of the region's box
};

/// The selected part of a site: an axis-aligned box in the local frame, or the polygons in it.
struct Region {
  geometry::Vec3 center = geometry::Vec3::Zero();  ///< metres, local frame
  geometry::Vec3 size = geometry::Vec3::Zero();    ///< metres east, north, up
  std::vector<geometry::Prism> parts = {};         ///< inside the box; empty: the whole box

  geometry::Box3 box() const { return {center - size / 2, center + size / 2}; }
};

/// Returns the region from far below to far above, and a little wider: the places where tiles may hold its surface
/// although their bounding volumes state wrong heights or are too small.
Region column_of(Region region);

/// Returns whether the volume may intersect the region: for a box, by the volume's own test; for polygons, if the
/// volume meets a polygon's box and its projection on the ground plane meets the polygon. Never falsely negative.
bool intersects(const BoundingVolume& volume, const geometry::SE3& T_local_tileset, const Region& region);

/// Converts an area to a prism of the local frame. Its heights are converted to heights above the frame's plane at the
/// area's centre; `box` provides those that it does not state.
geometry::Prism to_local_prism(const GeographicArea& area, const geometry::LocalFrame& frame,
                               const geometry::Box3& box);

}  // namespace tileflight::tileset
