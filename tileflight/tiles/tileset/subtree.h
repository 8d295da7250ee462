#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/tiles/tileset/implicit_tiling.h"
#include "tileflight/tiles/tileset/tileset.h"

namespace tileflight::tileset {

/// Availability and contents of the tiles in a part of an implicit tree (3D Tiles 1.1, section "Subtrees").

/// A content of an available tile.
struct SubtreeContent {
  std::size_t template_index = 0;  ///< index into the tiling's content templates
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
};

/// A parsed subtree file. It keeps the file's bits; tiles are made when they are requested. A tile is named by its
/// index: levels from the root (0) down, in Morton order within a level; the level below the last holds the roots of
/// child subtrees. Immutable; several threads may ask at once.
class Subtree {
 public:
  struct Parts;
  explicit Subtree(std::shared_ptr<const Parts> parts) : parts_(std::move(parts)) {}

  const ImplicitTiling& tiling() const { return *shared_tiling(); }
  const std::shared_ptr<const ImplicitTiling>& shared_tiling() const;
  std::size_t tile_count() const;  ///< available tiles whose ancestors are available, too
  const std::vector<std::string>& warnings() const;

  /// Returns the available children of a tile, roots of child subtrees included, in Morton order.
  std::vector<std::uint32_t> children(std::uint32_t tile) const;
  bool is_child_subtree(std::uint32_t tile) const;
  TileCoordinates coordinates(std::uint32_t tile) const;
  /// Returns the refinement that metadata state for a tile; nullopt if they state none or are broken.
  std::optional<Refine> refine(std::uint32_t tile) const;
  /// Returns a tile, which must be available and not a child subtree. Throws InputError (name, tile, cause) if its
  /// metadata are broken.
  SubtreeTile tile(std::uint32_t tile) const;

 private:
  std::shared_ptr<const Parts> parts_;
};

/// Parses a .subtree file, binary or JSON. `read_resource` receives the URIs of external buffers as written in the
/// file. Sizes are checked before allocation. Throws InputError (name, part, cause).
Subtree parse_subtree(std::vector<std::byte> bytes, const ImplicitSubtree& place, const std::string& name,
                      const std::function<std::vector<std::byte>(const std::string& uri)>& read_resource = {});

}  // namespace tileflight::tileset
