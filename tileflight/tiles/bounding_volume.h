#pragma once

#include <variant>

#include "tileflight/geometry/mesh.h"
#include "tileflight/geometry/transform.h"
#include "tileflight/tiles/s2_cell.h"

namespace tileflight::tiles {

/// Parallelepiped: center + half_axes * u for u in [-1, 1]^3. Half-axes may be negative, zero, or (after a transform
/// that shears) not orthogonal.
struct OrientedBox {
  geometry::Vec3 center = geometry::Vec3::Zero();
  geometry::Mat3 half_axes = geometry::Mat3::Zero();  ///< one a column, metres
};

struct BoundingSphere {
  geometry::Vec3 center = geometry::Vec3::Zero();
  double radius_m = 0.0;
};

/// Between two parallels, two meridians and two heights above WGS84. West of east: it crosses the antimeridian.
/// Always earth-fixed: no transform applies (3D Tiles 1.1, section "Tile transforms").
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

/// The volume in frame a, given it in frame b (affine). A sphere grows by the largest stretch; earth-fixed volumes
/// stay.
BoundingVolume transformed(const geometry::Mat4& T_a_b, const BoundingVolume& volume_b);

/// Middle of the volume, in the tileset's frame (earth-centred for earth-fixed ones).
geometry::Vec3 center_of(const BoundingVolume& volume);

/// Upright box in the local frame that holds all of the volume (given in the tileset's frame). Tight for oriented boxes
/// and spheres; a geographic region or S2 cell it holds for certain and is loose by less than the patch's own curvature
/// (of an S2 cell it holds the box that stands as the cell does).
geometry::Box3 bounds_local(const BoundingVolume& volume, const geometry::SE3& T_local_tileset);

/// Whether the volume and an upright box of the local frame share a point; touching counts, and a micrometre of
/// rounding too. Exact for boxes (separating axes) and spheres; for earth-fixed ones never wrongly false.
bool meets(const BoundingVolume& volume, const geometry::SE3& T_local_tileset, const geometry::Box3& box_local);

}  // namespace tileflight::tiles
