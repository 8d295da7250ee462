#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/tiles/tileset.h"
#include "tileflight/transport/tile_source.h"

namespace tileflight::tiles {

using NodeId = std::uint32_t;

/// A tile in the tree: its file, and inherited values.
struct TreeNode {
  std::uint32_t file = 0;  ///< index into TilesetTree's files
  std::uint32_t tile = 0;  ///< index into that file's tiles
  std::optional<NodeId> parent;
  geometry::Mat4 T_tileset_tile = geometry::Mat4::Identity();  ///< the tileset's frame: that of the root tileset.json
  Refine refine = Refine::kReplace;
};

struct TreeLimits {
  TilesetLimits file = {};
  int max_external_chain = 32;                   ///< nesting depth of external tilesets
  std::size_t max_nodes = std::size_t{4} << 20;  ///< over all external tilesets, once per reference
};

/// A tileset and the external tilesets it names, which are read on first use. Not thread safe.
class TilesetTree {
 public:
  /// Reads the root tileset.json. Throws InputError.
  explicit TilesetTree(transport::TileSource& source, const TreeLimits& limits = {});

  NodeId root() const { return 0; }
  const TreeNode& node(NodeId id) const { return nodes_[id]; }
  const Tile& tile(NodeId id) const { return files_[nodes_[id].file].tileset->tiles[nodes_[id].tile]; }
  const Tileset& tileset(NodeId id) const { return *files_[nodes_[id].file].tileset; }
  std::size_t node_count() const { return nodes_.size(); }

  /// The tile's children in its own file, in file order.
  std::vector<NodeId> children(NodeId id) const;
  /// The tile's bounding volume in the tileset's frame.
  BoundingVolume volume(NodeId id) const;
  /// The tile's geometric error in metres. 3D Tiles 1.0 states it in metres whatever the transform ("does not apply to
  /// geometricError", section "Tile transforms"); 1.1 scales it by the largest scaling factor of the transform.
  double geometric_error_m(NodeId id) const;
  /// A content's own bounding volume in the tileset's frame, if it has one.
  std::optional<BoundingVolume> content_volume(NodeId id, std::size_t content) const;
  /// The volume in which a viewer must be to see the tile, in the tileset's frame, if the tile has one.
  std::optional<BoundingVolume> viewer_request_volume(NodeId id) const;
  /// A content's URI, resolved against the file that names it.
  std::string content_uri(NodeId id, std::size_t content) const;
  /// Text such as "tileset.json: tile root/0/3".
  std::string name(NodeId id) const;

  /// Whether the content is an external tileset: by its URI's extension or, if that is inconclusive, by its first bytes
  /// (then the file is read). Throws InputError if it cannot be read.
  bool is_external_tileset(NodeId id, std::size_t content);
  /// The root of the external tileset that a content names, read at the first call. A root without `refine` inherits it
  /// from the referring tile. Throws InputError: unreadable, a cycle (named), or beyond the limits.
  NodeId external_root(NodeId id, std::size_t content);

  /// The root of the implicit subtree at this tile (whose `implicit_subtree` is set). Its subtree file is read at the
  /// first call. Throws InputError.
  NodeId implicit_root(NodeId id);

  /// A nested file of the tree: the external tileset that a content names, or (no content) the subtree of a tile.
  struct NestedFile {
    NodeId node = 0;
    std::optional<std::size_t> content;
  };
  /// Whether it has been read.
  bool is_read(const NestedFile& branch) const;
  /// Reads these files, in parallel if the source has latency. Errors are reported later by `external_root` and
  /// `implicit_root`.
  void read_nested_files(const std::vector<NestedFile>& branches);
  /// Whether the source has latency, so that reading several files at once is worthwhile.
  bool is_high_latency() { return source_.prefetch({}); }

  /// The distinct tileset files read so far (without subtrees), in order of first reading: URI and content.
  std::vector<std::pair<std::string, std::shared_ptr<const Tileset>>> files_read() const;

  /// Distinct warnings of all files read so far, including subtrees.
  std::vector<std::string> warnings() const;

 private:
  struct File {
    std::string uri;
    std::shared_ptr<const Tileset> tileset;
    NodeId first_node = 0;
    std::optional<NodeId> referenced_by;  ///< the tile whose content this external tileset or subtree is
  };

  std::shared_ptr<const Tileset> read_tileset(const std::string& uri);
  std::shared_ptr<const Tileset> read_subtree(NodeId id);
  std::string subtree_uri(NodeId id) const;
  NodeId add_file(const std::string& uri, std::shared_ptr<const Tileset> tileset, std::optional<NodeId> named_by);
  void check_chain(const std::string& uri, NodeId named_by) const;

  transport::TileSource& source_;
  TreeLimits limits_;
  std::vector<File> files_;
  std::vector<TreeNode> nodes_;
  std::map<std::pair<NodeId, std::size_t>, NodeId> external_roots_;
  std::map<NodeId, NodeId> implicit_roots_;
  std::vector<std::pair<std::string, std::shared_ptr<const Tileset>>> files_read_;
  std::map<std::string, bool> sniffed_;
};

/// Throws InputError, naming the tileset, if it requires an unsupported extension.
void require_supported_extensions(const Tileset& tileset, const std::string& name);

}  // namespace tileflight::tiles
