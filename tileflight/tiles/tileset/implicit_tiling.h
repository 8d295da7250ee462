#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/tiles/tile_content/metadata_schema.h"
#include "tileflight/tiles/tileset/bounding_volume.h"

namespace tileflight::tileset {

/// A tile's coordinates in an implicit tree (3D Tiles 1.1, section "Tile Coordinates"): x, y, z count from the root
/// volume's minimum corner; z is 0 in a quadtree.
struct TileCoordinates {
  std::uint32_t level = 0;
  std::array<std::uint32_t, 3> xyz{0, 0, 0};
};

/// A tree defined by a subdivision rule instead of a list of tiles.
struct ImplicitTiling {
  bool octree = false;
  std::uint32_t subtree_levels = 0;
  std::uint32_t available_levels = 0;  ///< levels of the whole tree
  std::string subtree_template;        ///< as written, with {level} {x} {y} {z}
  std::vector<std::string> content_templates;
  BoundingVolume root_volume;  ///< a box, a geographic region or an S2 cell, in the root tile's frame
  double root_geometric_error_m = 0.0;
  std::shared_ptr<const tile_content::MetadataSchema> schema;  ///< schema of the tileset; may be null

  std::uint32_t children_per_tile() const { return octree ? 8 : 4; }
};

/// The part of an implicit tree that one subtree file describes, before that file is read.
struct ImplicitSubtree {
  std::shared_ptr<const ImplicitTiling> tiling;
  TileCoordinates root;  ///< root of the subtree
};

/// Reads `implicitTiling` or 3DTILES_implicit_tiling, without the members of the tile itself (volume, error, contents).
/// Throws InputError.
ImplicitTiling parse_implicit_tiling(const tile_content::Json& json, const std::string& where);

/// Returns a tile's part of the root volume (3D Tiles 1.1, section "Subdivision Rules").
BoundingVolume implicit_volume(const ImplicitTiling& tiling, const TileCoordinates& tile);
/// Returns a tile's geometric error, which halves from level to level.
double implicit_geometric_error_m(const ImplicitTiling& tiling, const TileCoordinates& tile);

/// Expands a template such as "content/{level}/{x}/{y}.glb". Throws InputError for {z} in a quadtree's template or an
/// unknown variable.
std::string expand_template(const std::string& text, const ImplicitTiling& tiling, const TileCoordinates& tile,
                            const std::string& where);

/// Returns coordinates for messages: "level 3, x 5, y 2".
std::string coordinates_text(const TileCoordinates& tile, bool octree);

}  // namespace tileflight::tileset
