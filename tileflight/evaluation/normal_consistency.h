#pragma once

#include <cstddef>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>

#include "tileflight/geometry/point_cloud.h"
#include "tileflight/geometry/triangle_index.h"

namespace tileflight::evaluation {

/// Whether a map's surface faces the way the true one does. Normals that mean nothing come to a mean |cos| of 1/2 and a
/// share of 1 - cos 30 = 0.134.
struct NormalConsistency {
  std::size_t points = 0;     ///< of the map
  std::size_t asked = 0;      ///< of them: all, or an even choice of a large map's
  std::size_t judged = 0;     ///< of those asked, with a normal, and within `within_m` of the surface
  double within_m = 0;        ///< farther points' nearest triangle says little of them
  std::size_t neighbors = 0;  ///< that the normals were estimated from; 0: the map's own
  double mean_abs_cos = std::numeric_limits<double>::quiet_NaN();
  double share_within_30_deg = std::numeric_limits<double>::quiet_NaN();
};

/// Angle between each point's normal and that of the nearest triangle, either side. A zero normal is none, and a
/// triangle without area has none. `asked` must have normals: all points of the map, or evenly chosen ones of a large
/// one, whose size is then to be noted as `points`. `neighbors` is only noted.
NormalConsistency normal_consistency(const geometry::PointCloud& asked, const geometry::TriangleMesh& surface,
                                     const geometry::TriangleIndex& index, double within_m, std::size_t neighbors);

/// {points, asked, judged, share_judged (of those asked), within, neighbors, mean_abs_cos, share_within_30_deg}.
nlohmann::json to_json(const NormalConsistency& consistency);

/// The inverse; throws InputError (`where`, key, cause).
NormalConsistency normals_from_json(const nlohmann::json& json, const std::string& where);

}  // namespace tileflight::evaluation
