#pragma once

#include <optional>
#include <vector>

#include "tileflight/geometry/transform.h"

namespace tileflight::localization {

struct GroundDirectionOptions {
  double tolerance =
      0.02;              ///< of a point's distance to the plane, as a share of the cameras' median distance to points
  int samples = 1000;    ///< planes that are tried
  std::size_t most = 2;  ///< planes
  std::uint64_t seed = 1;
};

/// A plane through many of a map's points.
struct GroundPlane {
  geometry::Vec3 up = geometry::Vec3::UnitZ();  ///< its normal, to the cameras' side
  double share = 0.0;                           ///< of the points, that lie on it
};

/// Directions that may be up in a map, by the planes on which most of its points lie and over which the cameras are
/// (RANSAC, Fischler and Bolles, CACM 24(6), 1981; each plane's points are left out before the next), best first.
std::vector<GroundPlane> ground_planes(const std::vector<geometry::Vec3>& points,
                                       const std::vector<geometry::SE3>& T_map_camera,
                                       const GroundDirectionOptions& options = {});

}  // namespace tileflight::localization
