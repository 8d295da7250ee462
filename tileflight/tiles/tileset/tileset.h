#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/tiles/tile_content/content.h"
#include "tileflight/tiles/tileset/bounding_volume.h"
#include "tileflight/tiles/tileset/implicit_tiling.h"

namespace tileflight::tileset {

/// Relation of a tile's content to that of its children.

enum class Refine { kReplace, kAdd };

/// A content of a tile.
struct Content {
  std::string uri;                                ///< as written, relative to the tileset.json
  std::optional<BoundingVolume> bounding_volume;  ///< in the tile's frame; tighter than the tile's own
};

/// A tile as stated in its file.
struct Tile {
  BoundingVolume bounding_volume;                             ///< in the tile's frame
  geometry::Mat4 T_parent_tile = geometry::Mat4::Identity();  ///< affine; may carry scale
  double geometric_error_m = 0.0;
  std::optional<Refine> refine;  ///< including inheritance inside this file; nullopt: not stated
  std::vector<Content> contents;
  std::vector<std::uint32_t> children;  ///< indices into Tileset::tiles
  /// Set if a subtree file defines this part of the tree (implicit tiling); then there are no contents and children.
  std::optional<ImplicitSubtree> implicit_subtree;
  std::optional<BoundingVolume> viewer_request_volume;  ///< in the tile's frame: viewers inside see the tile
  std::string unsupported;  ///< unsupported feature that the tile needs (a kind of bounding volume); empty: none
  std::string path;         ///< "root/0/3": which child of which child
  int level = 0;            ///< root: 0
};

/// One tileset.json (OGC 3D Tiles 1.0, 18-053r2, and 1.1, 22-025r4), without the external tilesets that it names.
struct Tileset {
  std::string version;
  std::optional<double> geometric_error_m;  ///< error if the whole tileset is not rendered
  tile_content::UpAxis gltf_up_axis = tile_content::UpAxis::kY;
  std::string copyright;
  std::string generator;
  std::optional<bool> georeferenced;  ///< set if asset.extras.ion states it
  bool movable = false;               ///< asset.extras.ion: its transform is only an arbitrary placement
  std::vector<std::string> extensions_used;
  std::vector<std::string> extensions_required;
  std::vector<Tile> tiles;  ///< parents before children, depth first; 0 is the root
  bool is_subtree = false;  ///< part of an implicit tree, made from a subtree file and the tileset that names it
  std::vector<std::string> warnings;
};

/// Limits for an untrusted tileset.json.
struct TilesetLimits {
  std::size_t max_bytes = std::size_t{256} << 20;
  int max_levels = 250;
  std::size_t max_tiles = std::size_t{4} << 20;
};

/// Reads another file named by a tileset.json (a metadata schema), given its URI as written.
using TextReader = std::function<std::string(const std::string& uri)>;

/// Parses a tileset.json. `name` is used in messages; `read_text` is called only if the external file is needed. Common
/// deviations are accepted with a warning (null members, `url`, lower-case refine, a missing geometric error); anything
/// that would change what is loaded throws InputError (name, tile, cause).
Tileset parse_tileset_json(std::string_view text, const std::string& name, const TilesetLimits& limits = {},
                           const TextReader& read_text = {});

/// Returns the entries of `extensionsRequired` that this reader does not support.
std::vector<std::string> unsupported_extensions(const Tileset& tileset);

}  // namespace tileflight::tileset
