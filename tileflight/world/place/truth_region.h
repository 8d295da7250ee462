#pragma once

#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "tileflight/core/geometry/mesh.h"
#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/core/geometry/prism.h"

namespace tileflight::place {

/// Region of the ground truth: a box, or the polygons in it.
struct TruthRegion {
  geometry::Box3 box;
  std::vector<geometry::PolygonArea> polygons;

  bool contains_horizontally(const geometry::Vec3& p) const;
};

/// The region stored in extract.json.
TruthRegion region_from_json(const nlohmann::json& extract_json);

/// The points over the scored region; there is no ground truth outside it.
geometry::PointCloud crop_to_region(const geometry::PointCloud& cloud, const TruthRegion& region);

}  // namespace tileflight::place
