#include "tileflight/world/place/truth_region.h"

#include <nlohmann/json.hpp>

#include <algorithm>

namespace tileflight::place {
namespace {

using nlohmann::json;

geometry::PolygonArea polygon_from_json(const json& polygon) {
  std::vector<geometry::Ring> rings;
  for (const json& ring : polygon.at("rings")) {
    rings.emplace_back();
    for (const json& corner : ring) rings.back().emplace_back(corner.at(0).get<double>(), corner.at(1).get<double>());
  }
  return geometry::PolygonArea(std::move(rings));
}

}  // namespace

bool TruthRegion::contains_horizontally(const geometry::Vec3& p) const {
  const auto beside = [&](int axis) { return p[axis] < box.min()[axis] || p[axis] > box.max()[axis]; };
  if (beside(0) || beside(1)) return false;
  return polygons.empty() ||
         std::ranges::any_of(polygons, [&](const auto& polygon) { return polygon.contains(p.head<2>()); });
}

TruthRegion region_from_json(const nlohmann::json& extract_json) {
  const json& region = extract_json.at("region");
  const std::vector<double> center = region.at("center");
  const std::vector<double> size = region.at("size");
  const geometry::Vec3 c(center[0], center[1], center[2]);
  const geometry::Vec3 half = 0.5 * geometry::Vec3(size[0], size[1], size[2]);
  TruthRegion out{{c - half, c + half}, {}};
  for (const json& polygon : region.value("polygons", json::array()))
    out.polygons.push_back(polygon_from_json(polygon));
  return out;
}

geometry::PointCloud crop_to_region(const geometry::PointCloud& cloud, const TruthRegion& region) {
  std::vector<bool> keep(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) keep[i] = region.contains_horizontally(cloud.positions[i]);
  return geometry::filter_points(cloud, keep);
}

}  // namespace tileflight::place
