#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tileflight/tiles/implicit_tiling.h"
#include "tileflight/tiles/property_table.h"
#include "tileflight/tiles/tileset.h"

namespace tileflight::tiles {

/// Which tiles of a part of an implicit tree there are, and what each of them shows (3D Tiles 1.1, section "Subtrees").

/// A content of an available tile.
struct SubtreeContent {
  std::size_t template_index = 0;  ///< which of the tiling's content templates
  std::optional<std::string> uri;  ///< where metadata names another file than the template does
  std::optional<BoundingVolume> bounding_volume;
};

/// An available tile, with its metadata applied.
struct SubtreeTile {
  TileCoordinates coordinates;
  BoundingVolume bounding_volume;
  double geometric_error_m = 0.0;
  std::optional<Refine> refine;  ///< where metadata says so
  std::vector<SubtreeContent> contents;
  std::vector<std::uint32_t> children;    ///< indices into the subtree's tiles
  std::vector<TileCoordinates> subtrees;  ///< roots of the child subtrees that there are
};

struct Subtree {
  std::vector<SubtreeTile> tiles;  ///< parents before children; 0 is the root
  std::vector<std::string> warnings;
};

/// Reads a .subtree file, binary or JSON. `read_resource` takes the URIs of outside buffers as they stand in the file.
/// Everything is checked before it is allocated. Throws InputError (name, part, cause).
Subtree parse_subtree(std::span<const std::byte> bytes, const ImplicitPlace& place, const std::string& name,
                      const std::function<std::vector<std::byte>(const std::string& uri)>& read_resource = {});

}  // namespace tileflight::tiles
