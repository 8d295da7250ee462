#include "tileflight/tiles/tileset/implicit_tiling.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/tile_content/json_reader.h"

namespace tileflight::tileset {
namespace {

/// Coordinates are 32-bit numbers.
constexpr std::size_t kMaxLevels = 32;

/// Offset of a tile along each axis, 0..1, and its size, relative to the root volume.
struct RelativeExtent {
  double size = 1.0;
  std::array<double, 3> from{0, 0, 0};
};

RelativeExtent relative_extent(const TileCoordinates& tile) {
  RelativeExtent share;
  share.size = std::ldexp(1.0, -static_cast<int>(tile.level));
  for (std::size_t i = 0; i < 3; ++i) share.from[i] = tile.xyz[i] * share.size;
  return share;
}

OrientedBox subdivide(const OrientedBox& root, const RelativeExtent& share, bool octree) {
  OrientedBox box = root;
  for (int i = 0; i < (octree ? 3 : 2); ++i) {
    const double middle = share.from[static_cast<std::size_t>(i)] + share.size / 2;  // 0..1
    box.center += root.half_axes.col(i) * (2 * middle - 1);
    box.half_axes.col(i) *= share.size;
  }
  return box;
}

double wrapped(double longitude_rad) {
  return longitude_rad > std::numbers::pi ? longitude_rad - 2 * std::numbers::pi : longitude_rad;
}

GeographicRegion subdivide(const GeographicRegion& root, const RelativeExtent& share, bool octree) {
  double width = root.east_rad - root.west_rad;
  if (width < 0) width += 2 * std::numbers::pi;
  const double depth = root.north_rad - root.south_rad;
  GeographicRegion region = root;
  region.west_rad = wrapped(root.west_rad + width * share.from[0]);
  region.east_rad = wrapped(root.west_rad + width * (share.from[0] + share.size));
  region.south_rad = root.south_rad + depth * share.from[1];
  region.north_rad = root.south_rad + depth * (share.from[1] + share.size);
  if (!octree) return region;
  const double height = root.max_height_m - root.min_height_m;
  region.min_height_m = root.min_height_m + height * share.from[2];
  region.max_height_m = root.min_height_m + height * (share.from[2] + share.size);
  return region;
}

/// x runs along the face's u and y along its v, regardless of the Hilbert curve's orientation.
S2Volume subdivide(const S2Volume& root, const TileCoordinates& tile, bool octree) {
  S2Volume out = root;
  out.cell = s2_descendant(root.cell, tile.level, tile.xyz[0], tile.xyz[1]);
  if (!octree) return out;
  const RelativeExtent share = relative_extent(tile);
  const double height = root.max_height_m - root.min_height_m;
  out.min_height_m = root.min_height_m + height * share.from[2];
  out.max_height_m = root.min_height_m + height * (share.from[2] + share.size);
  return out;
}

}  // namespace

ImplicitTiling parse_implicit_tiling(const tile_content::Json& json, const std::string& where) {
  ImplicitTiling out;
  const std::string scheme = tile_content::require_value(tile_content::find_string(json, "subdivisionScheme", where),
                                                         "subdivisionScheme", where);
  if (scheme != "QUADTREE" && scheme != "OCTREE") {
    throw InputError(where, "subdivisionScheme is '" + scheme + "'; expected QUADTREE or OCTREE");
  }
  out.octree = scheme == "OCTREE";
  const auto subtree_levels =
      tile_content::require_value(tile_content::find_index(json, "subtreeLevels", where), "subtreeLevels", where);
  auto available = tile_content::find_index(json, "availableLevels", where);
  if (const auto last = tile_content::find_index(json, "maximumLevel", where); last && !available)
    available = *last + 1;
  const std::size_t levels = tile_content::require_value(available, "availableLevels", where);
  if (subtree_levels < 1 || subtree_levels > (out.octree ? 8U : 12U)) {
    throw InputError(where, "subtreeLevels is " + std::to_string(subtree_levels) + "; supported are 1 to " +
                                (out.octree ? "8 (octree)" : "12 (quadtree)"));
  }
  if (levels < 1 || levels > kMaxLevels) {
    throw InputError(where, "availableLevels is " + std::to_string(levels) + "; supported are 1 to 32");
  }
  out.subtree_levels = static_cast<std::uint32_t>(subtree_levels);
  out.available_levels = static_cast<std::uint32_t>(levels);
  const tile_content::Json* subtrees = tile_content::find_object(json, "subtrees", where);
  if (subtrees == nullptr) throw InputError(where, "subtrees are missing");
  out.subtree_template =
      tile_content::require_value(tile_content::find_string(*subtrees, "uri", where), "subtrees.uri", where);
  return out;
}

BoundingVolume implicit_volume(const ImplicitTiling& tiling, const TileCoordinates& tile) {
  const RelativeExtent share = relative_extent(tile);
  if (const auto* box = std::get_if<OrientedBox>(&tiling.root_volume)) return subdivide(*box, share, tiling.octree);
  if (const auto* s2 = std::get_if<S2Volume>(&tiling.root_volume)) return subdivide(*s2, tile, tiling.octree);
  return subdivide(std::get<GeographicRegion>(tiling.root_volume), share, tiling.octree);
}

double implicit_geometric_error_m(const ImplicitTiling& tiling, const TileCoordinates& tile) {
  return std::ldexp(tiling.root_geometric_error_m, -static_cast<int>(tile.level));
}

std::string expand_template(const std::string& text, const ImplicitTiling& tiling, const TileCoordinates& tile,
                            const std::string& where) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const std::size_t end = text[i] == '{' ? text.find('}', i) : std::string::npos;
    if (end == std::string::npos) {
      out += text[i];
      continue;
    }
    const std::string variable = text.substr(i + 1, end - i - 1);
    if (variable == "level") {
      out += std::to_string(tile.level);
    } else if (variable == "x" || variable == "y" || (variable == "z" && tiling.octree)) {
      out += std::to_string(tile.xyz[static_cast<std::size_t>(variable[0] - 'x')]);
    } else {
      throw InputError(where, "the template '" + text + "' has the unknown variable {" + variable + "}");
    }
    i = end;
  }
  return out;
}

std::string coordinates_text(const TileCoordinates& tile, bool octree) {
  std::string out = "level " + std::to_string(tile.level) + ", x " + std::to_string(tile.xyz[0]) + ", y " +
                    std::to_string(tile.xyz[1]);
  if (octree) out += ", z " + std::to_string(tile.xyz[2]);
  return out;
}

}  // namespace tileflight::tileset
