#pragma once

#include <cstddef>
#include <limits>
#include <numbers>
#include <vector>

#include "tileflight/core/imaging/camera.h"
#include "tileflight/core/imaging/image.h"
#include "tileflight/tiles/tileset/selection.h"

namespace tileflight::tileset {

/// Field of view of one image, or of one sensor revolution, as a cone. It contains all valid pixels of the lens, so a
/// cut selected for it covers everything they see.
struct ViewCone {
  geometry::Vec3 position = geometry::Vec3::Zero();  ///< local frame, metres
  geometry::Vec3 axis = geometry::Vec3::UnitZ();     ///< unit, local frame
  double half_angle_rad = std::numbers::pi;          ///< pi: all around
  double pixels_per_rad = 0.0;                       ///< maximum pixels per radian anywhere in the image
};

/// Returns the cone and resolution of a lens, from its pixels' rays on a grid (exact on the grid, which includes the
/// corners and the centre; lenses change slowly in between). Position and axis keep ViewCone's defaults.
ViewCone view_cone_of(const imaging::Camera& camera);

/// Returns the lens's view cone at each pose (camera to local).
std::vector<ViewCone> view_cones_along(const imaging::Camera& camera, const std::vector<geometry::SE3>& T_local_camera);

/// Widens view cones to all directions, for a spinning lidar or a drone that turns.
std::vector<ViewCone> widen_to_all_directions(std::vector<ViewCone> eyes);

/// A range of a flight's view cones, by index: from `begin` up to, not including, `end`.
struct ViewConeRange {
  std::size_t begin = 0;
  std::size_t end = std::numeric_limits<std::size_t>::max();
};

/// Requests everything that any of the view cones sees, such that a tile's geometric error, seen from the position
/// nearest to the tile's volume, covers at most `error_px` pixels: error_m * pixels_per_rad <= error_px * distance_m.
/// One cut serves the whole flight; it does not change during the flight. `part`: restricts the cut to the tiles that
/// these view cones see, at the resolution required by all of them.
RefinementCriterion flight_criterion(std::vector<ViewCone> eyes, const geometry::SE3& T_local_tileset, double error_px,
                                     const ViewConeRange& part = {});

/// Returns the criterion `wanted`, but does not refine tiles whose geometric error is at most `error_m`.
RefinementCriterion limit_refinement(RefinementCriterion wanted, double error_m);

/// The camera of an interactive viewer.
struct ViewerCamera {
  geometry::SE3 T_local_camera;  ///< x right, y down, z forward
  int width = 1920;
  int height = 1080;
  double horizontal_fov_deg = 90.0;  ///< Unreal's default
  double max_error_px = 16.0;        ///< Cesium's default screen-space error
};

/// Selects what such a viewer loads for one camera once loading has finished, by the reference algorithm of 3D Tiles
/// (screen space error: geometric error * height / (2 distance tan(vertical field of view / 2)), refined unless below
/// the maximum; volumes entirely outside one of the frustum's sides are culled).
RefinementCriterion viewer_criterion(const ViewerCamera& camera, const geometry::SE3& T_local_tileset);

/// Returns the distance from a point of the local frame to the volume: 0 inside, never overestimated. Exact for spheres
/// and right-angled boxes.
double distance_m(const BoundingVolume& volume, const geometry::SE3& T_local_tileset,
                  const geometry::Vec3& point_local);

}  // namespace tileflight::tileset
