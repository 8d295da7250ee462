#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/tiles/tile_source.h"
#include "tileflight/tiles/tileset.h"

namespace tileflight::tiles {

using NodeId = std::uint32_t;

/// A tile in its place: which file it stands in, and what it inherits.
struct TreeNode {
  std::uint32_t file = 0;  ///< index into TilesetTree's files
  std::uint32_t tile = 0;  ///< index into that file's tiles
  std::optional<NodeId> parent;
  geometry::Mat4 T_tileset_tile = geometry::Mat4::Identity();  ///< the tileset's frame: that of the root tileset.json
  Refine refine = Refine::kReplace;
};

struct TreeLimits {
  TilesetLimits file = {};
  int max_external_chain = 32;                   ///< tilesets inside each other
  std::size_t max_nodes = std::size_t{4} << 20;  ///< over all external tilesets, each counted as often as it is named
};

/// A tileset and the external tilesets it names, which are read when they are first asked for. Not for use from several
/// threads at once.
class TilesetTree {
 public:
  /// Reads the root tileset.json. Throws InputError.
  explicit TilesetTree(TileSource& source, const TreeLimits& limits = {});

  NodeId root() const { return 0; }
  const TreeNode& node(NodeId id) const { return nodes_[id]; }
  const Tile& tile(NodeId id) const { return files_[nodes_[id].file].tileset->tiles[nodes_[id].tile]; }
  const Tileset& tileset(NodeId id) const { return *files_[nodes_[id].file].tileset; }
  std::size_t node_count() const { return nodes_.size(); }

  /// The tile's children in its own file, in the file's order.
  std::vector<NodeId> children(NodeId id) const;
  /// The tile's bounding volume in the tileset's frame.
  BoundingVolume volume(NodeId id) const;
  /// The tile's geometric error in metres. 1.0 gives it in metres whatever the transform ("does not apply to
  /// geometricError", section "Tile transforms"); 1.1 scales it by the largest scaling factor of the transform.
  double geometric_error_m(NodeId id) const;
  /// A content's own bounding volume in the tileset's frame, where it has one.
  std::optional<BoundingVolume> content_volume(NodeId id, std::size_t content) const;
  /// Where a viewer has to be to see the tile, in the tileset's frame, where it says so.
  std::optional<BoundingVolume> viewer_request_volume(NodeId id) const;
  /// A content's URI, resolved against the file that names it.
  std::string content_uri(NodeId id, std::size_t content) const;
  /// "tileset.json: tile root/0/3".
  std::string name(NodeId id) const;

  /// Whether the content is an external tileset: by its URI's ending, and where that says nothing, by its first bytes
  /// (then it is read here). Throws InputError when it cannot be read.
  bool is_external_tileset(NodeId id, std::size_t content);
  /// The root of the external tileset that a content names. Read at the first call. A root without `refine` takes it
  /// from the tile that names it. Throws InputError: unreadable, a cycle (named), or past the limits.
  NodeId external_root(NodeId id, std::size_t content);

  /// The root of the part of an implicit tree that stands at this tile (whose `implicit` is set). Its subtree file is
  /// read at the first call. Throws InputError.
  NodeId implicit_root(NodeId id);

  /// A file that the tree goes on in: the external tileset that a content names, or (no content) the subtree of a tile.
  struct Branch {
    NodeId node = 0;
    std::optional<std::size_t> content;
  };
  /// Whether it has been read.
  bool is_read(const Branch& branch) const;
  /// Reads these files; where reading means waiting, all at once. What cannot be read is left for `external_root` and
  /// `implicit_root` to tell.
  void read_branches(const std::vector<Branch>& branches);
  /// Whether reading means waiting, so that it pays to read several at once.
  bool reading_waits() { return source_.prefetch({}); }

  /// The distinct tileset files read so far (no subtrees), in the order of first reading: URI and content.
  std::vector<std::pair<std::string, std::shared_ptr<const Tileset>>> files_read() const;

  /// What was warned of in all files read so far, subtrees included; distinct.
  std::vector<std::string> warnings() const;

 private:
  struct File {
    std::string uri;
    std::shared_ptr<const Tileset> tileset;
    NodeId first_node = 0;
    std::optional<NodeId> named_by;  ///< the tile whose content this external tileset or subtree is
  };

  std::shared_ptr<const Tileset> read_tileset(const std::string& uri);
  std::shared_ptr<const Tileset> read_subtree(NodeId id);
  std::string subtree_uri(NodeId id) const;
  NodeId add_file(const std::string& uri, std::shared_ptr<const Tileset> tileset, std::optional<NodeId> named_by);
  void check_chain(const std::string& uri, NodeId named_by) const;

  TileSource& source_;
  TreeLimits limits_;
  std::vector<File> files_;
  std::vector<TreeNode> nodes_;
  std::map<std::pair<NodeId, std::size_t>, NodeId> external_roots_;
  std::map<NodeId, NodeId> implicit_roots_;
  std::vector<std::pair<std::string, std::shared_ptr<const Tileset>>> files_read_;
  std::map<std::string, bool> sniffed_;
};

/// Throws InputError naming the tileset when it needs an extension that this reader lacks.
void require_supported_extensions(const Tileset& tileset, const std::string& name);

}  // namespace tileflight::tiles
