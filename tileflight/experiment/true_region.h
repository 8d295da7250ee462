#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "tileflight/geometry/mesh.h"
#include "tileflight/geometry/point_cloud.h"
#include "tileflight/geometry/prism.h"

namespace tileflight::experiment {

/// What the truth is of: a box, or the polygons in it.
struct TrueRegion {
  geometry::Box3 box;
  std::vector<geometry::PolygonArea> polygons;

  bool is_over_or_under(const geometry::Vec3& p) const;
};

/// From extract.json.
TrueRegion region_of(const nlohmann::json& extract_json);

/// Points over the scored region; what lies beside it has no truth to be measured against.
geometry::PointCloud over_region(const geometry::PointCloud& cloud, const TrueRegion& region);

}  // namespace tileflight::experiment
