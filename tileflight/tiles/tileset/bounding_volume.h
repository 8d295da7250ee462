#pragma once

#include <variant>

#include "tileflight/core/geometry/mesh.h"
#include "tileflight/core/geometry/transform.h"
#include "tileflight/tiles/tileset/s2_cell.h"

namespace tileflight::tileset {

/// Parallelepiped: center + half_axes * u for u in [-1, 1]^3. Half-axes may be reflected, zero, or (after a shearing
/// transform) not orthogonal.
struct OrientedBox {
  geometry::Vec3 center = geometry::Vec3::Zero();
  geometry::Mat3 half_axes = geometry::Mat3::Zero();  ///< one per column, metres
};

/// A sphere.
struct BoundingSphere {
  geometry::Vec3 center = geometry::Vec3::Zero();
  double radius_m = 0.0;
};

/// The region between two parallels, two meridians and two heights above WGS84. west_rad > east_rad: it crosses the
/// antimeridian. Always earth-fixed: no transform applies (3D Tiles 1.1, section "Tile transforms").
struct GeographicRegion {
  double west_rad = 0.0;
  double south_rad = 0.0;
  double east_rad = 0.0;
  double north_rad = 0.0;
  double min_height_m = 0.0;
  double max_height_m = 0.0;
};

/// An S2 cell between two heights above WGS84, along the ellipsoid's normals (3DTILES_bounding_volume_S2). Always
/// earth-fixed.
struct S2Volume {
  S2Cell cell;
  double min_height_m = 0.0;
  double max_height_m = 0.0;
};

using BoundingVolume = std::variant<OrientedBox, BoundingSphere, GeographicRegion, S2Volume>;

/// Transforms the volume from frame b to frame a (affine). A sphere's radius is scaled by the largest stretch;
/// earth-fixed volumes do not change.
BoundingVolume transformed(const geometry::Mat4& T_a_b, const BoundingVolume& volume_b);

/// Returns a volume that contains all points within `margin_m` of this one (of an S2 cell: those above and below).
BoundingVolume widened(const BoundingVolume& volume, double margin_m);

/// Returns the centre of the volume, in the tileset's frame (earth-centred for earth-fixed volumes).
geometry::Vec3 center_of(const BoundingVolume& volume);

/// Returns the axis-aligned bounding box, in the local frame, of a volume in the tileset's frame. It is tight for
/// oriented boxes and spheres, and conservative for a geographic region or S2 cell, with an excess below the patch's
/// own curvature (for an S2 cell, it bounds the box oriented like the cell).
geometry::Box3 local_bounding_box(const BoundingVolume& volume, const geometry::SE3& T_local_tileset);

/// Returns whether the volume and an axis-aligned box of the local frame share a point. Touching counts, with a
/// tolerance of a micrometre. Exact for boxes (separating axes) and spheres; never falsely negative for earth-fixed
/// volumes.
bool intersects(const BoundingVolume& volume, const geometry::SE3& T_local_tileset, const geometry::Box3& box_local);

}  // namespace tileflight::tileset
