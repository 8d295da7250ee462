#pragma once

#include <cstddef>
#include <limits>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/core/geometry/triangle_index.h"

namespace tileflight::base {
class StrictSection;
}

namespace tileflight::metrics {

/// Agreement of a map's normals with those of the true surface. Random normals give a mean |cos| of 1/2 and a share of
/// 1 - cos 30 deg = 0.134.
struct NormalConsistency {
  std::size_t points = 0;     ///< of the map
  std::size_t sampled = 0;    ///< of them: all, or an even subsample of a large map
  std::size_t evaluated = 0;  ///< of the sampled ones: with a normal, within `within_m` of the surface
  double within_m = 0;        ///< largest distance to the surface; for farther points the nearest triangle is not
                              ///< meaningful
  std::size_t neighbors = 0;  ///< number of neighbours used to estimate the normals; 0: the map's own normals
  double mean_abs_cos = std::numeric_limits<double>::quiet_NaN();
  double share_within_30_deg = std::numeric_limits<double>::quiet_NaN();
};

/// Compares each point's normal with that of the nearest triangle, by their unsigned angle. Zero normals and triangles
/// without area are skipped. `asked` must have normals. It holds all points of the map, or an even subsample, in which
/// case the caller sets `points` to the map's size. `neighbors` is only recorded in the result.
NormalConsistency normal_consistency(const geometry::PointCloud& asked, const geometry::TriangleMesh& surface,
                                     const geometry::TriangleIndex& index, double within_m, std::size_t neighbors);

/// Computes the consistency from the normal, of any length, of the nearest triangle to each point; zero where there is
/// none within `within_m`.
NormalConsistency normal_consistency(const geometry::PointCloud& asked, const std::vector<geometry::Vec3>& nearest,
                                     double within_m, std::size_t neighbors);

/// Normal of a triangle, not normalised; zero for a triangle without area.
geometry::Vec3 triangle_direction(const geometry::TriangleMesh& mesh, std::size_t triangle);

/// Returns {points, asked, judged, share_judged (of those asked), within, neighbors, mean_abs_cos,
/// share_within_30_deg}.
nlohmann::json to_json(const NormalConsistency& consistency);

/// Reads the object that to_json() returns. Throws InputError as StrictSection does.
NormalConsistency read_normal_consistency(base::StrictSection section);

}  // namespace tileflight::metrics
