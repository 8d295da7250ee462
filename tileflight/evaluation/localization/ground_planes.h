#pragma once

#include <optional>
#include <vector>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::localization {

struct GroundPlaneOptions {
  double tolerance = 0.02;  ///< largest distance of a point from the plane, as a share of the cameras' median distance
                            ///< to the points
  int samples = 1000;       ///< planes sampled by RANSAC
  std::size_t max_planes = 2;  ///< planes
  std::uint64_t seed = 1;
};

/// A plane through many of a map's points.
struct GroundPlane {
  geometry::Vec3 up = geometry::Vec3::UnitZ();  ///< unit normal, towards the cameras
  double share = 0.0;                           ///< share of the points on the plane
};

/// Returns candidates for the up direction of a map, best first: normals of the planes that contain most of its points
/// and lie below the cameras (RANSAC, Fischler and Bolles, CACM 24(6), 1981). The points of each plane are removed
/// before the next one is searched.
std::vector<GroundPlane> find_ground_planes(const std::vector<geometry::Vec3>& points,
                                            const std::vector<geometry::SE3>& T_map_camera,
                                            const GroundPlaneOptions& options = {});

}  // namespace tileflight::localization
