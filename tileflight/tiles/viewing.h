#pragma once

#include <cstddef>
#include <limits>
#include <numbers>
#include <vector>

#include "tileflight/imaging/camera.h"
#include "tileflight/tiles/selection.h"

namespace tileflight::tiles {

/// What one picture, or one turn of a sensor, can see: everything within a cone. All of a lens's valid pixels lie in
/// it, so a cut made for it lacks nothing that they look at.
struct Eye {
  geometry::Vec3 position = geometry::Vec3::Zero();  ///< local frame, metres
  geometry::Vec3 axis = geometry::Vec3::UnitZ();     ///< unit, local frame
  double half_angle_rad = std::numbers::pi;          ///< pi: all around
  double pixels_per_rad = 0.0;  ///< the most pixels that a small angle covers anywhere in the image
};

/// The cone and the sharpness of a lens, from its pixels' own rays on a grid (exact on the grid, which has the corners
/// and the middle; lenses change slowly between). Poses are left as they are in Eye{}.
Eye eye_of(const imaging::Camera& camera);

/// The lens at each pose (camera to local).
std::vector<Eye> eyes_along(const imaging::Camera& camera, const std::vector<geometry::SE3>& T_local_camera);

/// The same places, but looking all around (a spinning lidar, or a drone that turns).
std::vector<Eye> all_around(std::vector<Eye> eyes);

/// Some of a flight's eyes, by index: from `begin` on, before `end`.
struct EyeRange {
  std::size_t begin = 0;
  std::size_t end = std::numeric_limits<std::size_t>::max();
};

/// Everything that any of the eyes looks at, such that a tile's geometric error, seen from where the eye is nearest to
/// the tile's volume, covers at most `error_px` pixels: error_m * pixels_per_rad <= error_px * distance_m. A cut for it
/// serves a whole flight; it never changes on the way.
/// `part`: only what these of the eyes look at, but as fine as all of them want it: those of the whole cut's tiles that
/// a part of the flight sees.
Wanted wanted_flight(std::vector<Eye> eyes, const geometry::SE3& T_local_tileset, double error_px,
                     const EyeRange& part = {});

/// The same, but a tile whose geometric error is at most `error_m` is never refined.
Wanted no_finer_than(Wanted wanted, double error_m);

/// The camera of a program that shows tiles to people.
struct ViewerCamera {
  geometry::SE3 T_local_camera;  ///< x right, y down, z forward
  int width = 1920;
  int height = 1080;
  double horizontal_fov_deg = 90.0;  ///< Unreal's default
  double max_error_px = 16.0;        ///< Cesium's default screen-space error
};

/// What such a program loads for one camera once it has caught up, after the reference algorithm of 3D Tiles (screen
/// space error: geometric error * height / (2 distance tan(vertical field of view / 2)), refined unless below the
/// maximum; volumes wholly outside one of the frustum's sides are culled).
Wanted wanted_view(const ViewerCamera& camera, const geometry::SE3& T_local_tileset);

/// Distance from a point of the local frame to the volume: 0 inside, never too large. Exact for spheres and
/// right-angled boxes.
double distance_m(const BoundingVolume& volume, const geometry::SE3& T_local_tileset,
                  const geometry::Vec3& point_local);

}  // namespace tileflight::tiles
