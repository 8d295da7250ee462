#include "tileflight/tiles/tile_writer/tileset_json.h"

#include <algorithm>
#include <nlohmann/json.hpp>

namespace tileflight::tile_writer {
namespace {

using geometry::Vec3;
using nlohmann::json;

json box_json(const geometry::Box3& box) {
  const Vec3 c = box.center(), h = box.sizes() / 2 + Vec3::Constant(1e-3);
  return {{"box", {c.x(), c.y(), c.z(), h.x(), 0, 0, 0, h.y(), 0, 0, 0, h.z()}}};
}

json tile_json(const TileEntry& tile) {
  json out{{"boundingVolume", box_json(tile.bounds)}, {"geometricError", tile.geometric_error_m}};
  if (!tile.uri.empty()) out["content"] = {{"uri", tile.uri}, {"boundingVolume", box_json(tile.content)}};
  for (const TileEntry& child : tile.children) out["children"].push_back(tile_json(child));
  return out;
}

}  // namespace

std::array<double, 12> box_numbers(const geometry::Box3& bounds) {
  const Vec3 c = bounds.center(), h = bounds.sizes() / 2 + Vec3::Constant(1e-3);
  return {c.x(), c.y(), c.z(), h.x(), 0, 0, 0, h.y(), 0, 0, 0, h.z()};
}

void compute_bounds(TileEntry& tile) {
  tile.bounds = tile.content;
  for (TileEntry& child : tile.children) {
    compute_bounds(child);
    tile.bounds.extend(child.bounds);
  }
}

std::string tileset_json(const TileEntry& root, const std::optional<geometry::SE3>& T_ecef_local) {
  json tile = tile_json(root);
  tile["refine"] = "REPLACE";
  if (T_ecef_local) {
    const geometry::Mat4 m = T_ecef_local->matrix();
    tile["transform"] = std::vector<double>(m.data(), m.data() + 16);  // column-major, as in the specification
  }
  const json tileset{{"asset", {{"version", "1.1"}, {"generator", "tileflight"}}},
                     {"geometricError", std::max(root.bounds.diagonal().norm(), root.geometric_error_m)},
                     {"root", tile}};
  return tileset.dump(1);
}

}  // namespace tileflight::tile_writer
