#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tileflight/tile_contents/property_table.h"
#include "tileflight/tiles/implicit_tiling.h"
#include "tileflight/tiles/tileset.h"

namespace tileflight::tiles {

/// Availability and contents of the tiles in a part of an implicit tree (3D Tiles 1.1, section "Subtrees").

/// A content of an available tile.
struct SubtreeContent {
  std::size_t template_index = 0;  ///< which of the tiling's content templates
  std::optional<std::string> uri;  ///< set if metadata names another file than the template
  std::optional<BoundingVolume> bounding_volume;
};

/// An available tile, with its metadata applied.
struct SubtreeTile {
  TileCoordinates coordinates;
  BoundingVolume bounding_volume;
  double geometric_error_m = 0.0;
  std::optional<Refine> refine;  ///< set if metadata states it
  std::vector<SubtreeContent> contents;
  std::vector<std::uint32_t> children;    ///< indices into the subtree's tiles
  std::vector<TileCoordinates> subtrees;  ///< roots of the available child subtrees
};

struct Subtree {
  std::vector<SubtreeTile> tiles;  ///< parents before children; 0 is the root
  std::vector<std::string> warnings;
};

/// Parses a .subtree file, binary or JSON. `read_resource` receives the URIs of external buffers as written in the
/// file. Sizes are checked before allocation. Throws InputError (name, part, cause).
Subtree parse_subtree(std::span<const std::byte> bytes, const ImplicitSubtree& place, const std::string& name,
                      const std::function<std::vector<std::byte>(const std::string& uri)>& read_resource = {});

}  // namespace tileflight::tiles
