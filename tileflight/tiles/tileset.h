#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/geometry/transform.h"
#include "tileflight/tiles/bounding_volume.h"
#include "tileflight/tiles/implicit_tiling.h"

namespace tileflight::tiles {

/// One tileset.json as it is written (OGC 3D Tiles 1.0, 18-053r2, and 1.1, 22-025r4), without the external ones it
/// names.

enum class Refine { kReplace, kAdd };

/// The axis of a glTF content that points up; all but kY come from the legacy `asset.gltfUpAxis`.
enum class UpAxis { kX, kY, kZ };

struct Content {
  std::string uri;                                ///< as written, relative to the tileset.json
  std::optional<BoundingVolume> bounding_volume;  ///< in the tile's frame; tighter than the tile's own
};

struct Tile {
  BoundingVolume bounding_volume;                             ///< in the tile's frame
  geometry::Mat4 T_parent_tile = geometry::Mat4::Identity();  ///< affine; may carry scale
  double geometric_error_m = 0.0;
  std::optional<Refine> refine;  ///< as inherited inside this file; nullopt: neither it nor an ancestor says
  std::vector<Content> contents;
  std::vector<std::uint32_t> children;  ///< indices into Tileset::tiles
  /// A part of an implicit tree stands here, and a subtree file says what it holds; then no contents and children.
  std::optional<ImplicitPlace> implicit;
  std::optional<BoundingVolume> viewer_request_volume;  ///< in the tile's frame: where a viewer has to be to see it
  std::string unsupported;  ///< what it needs and we lack (a kind of bounding volume); empty: nothing
  std::string path;         ///< "root/0/3": which child of which child
  int level = 0;            ///< root: 0
};

struct Tileset {
  std::string version;
  std::optional<double> geometric_error_m;  ///< of the whole tileset when nothing is drawn
  UpAxis gltf_up_axis = UpAxis::kY;
  std::string copyright;
  std::string generator;
  std::optional<bool> georeferenced;  ///< where asset.extras.ion says so
  bool movable = false;               ///< asset.extras.ion: its transform is only where somebody has put it down
  std::vector<std::string> extensions_used;
  std::vector<std::string> extensions_required;
  std::vector<Tile> tiles;  ///< parents before children, depth first; 0 is the root
  bool is_subtree = false;  ///< a part of an implicit tree, made from a subtree file and the tileset that names it
  std::vector<std::string> warnings;
};

/// What a tileset.json of unknown origin may be.
struct TilesetLimits {
  std::size_t max_bytes = std::size_t{256} << 20;
  int max_levels = 250;
  std::size_t max_tiles = std::size_t{4} << 20;
};

/// Text of another file that a tileset.json names (a metadata schema), by its URI as it is written.
using ReadText = std::function<std::string(const std::string& uri)>;

/// Reads a tileset.json. `name` stands in messages; `read_text` is asked only where the outside file matters. What is
/// plainly meant is read (null members, `url`, lower-case
/// refine, a missing geometric error) and warned of; anything that would change what is loaded throws InputError (name,
/// tile, cause).
Tileset parse_tileset_json(std::string_view text, const std::string& name, const TilesetLimits& limits = {},
                           const ReadText& read_text = {});

/// Extensions of `extensionsRequired` that this reader has no support for.
std::vector<std::string> unsupported_extensions(const Tileset& tileset);

}  // namespace tileflight::tiles
