#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/fetch/tile_source.h"
#include "tileflight/tiles/tileset/subtree.h"
#include "tileflight/tiles/tileset/tileset.h"

namespace tileflight::tileset {

/// Index of a tile in a tree.
using NodeId = std::uint32_t;

/// A tile in the tree: its file, and inherited values.
struct TreeNode {
  std::uint32_t file = 0;  ///< index into TilesetTree's files
  std::uint32_t tile = 0;  ///< index into that file's tiles
  std::optional<NodeId> parent;
  Refine refine = Refine::kReplace;
};

/// Limits of an untrusted tree.
struct TreeLimits {
  TilesetLimits file = {};
  int max_external_chain = 32;                     ///< nesting depth of external tilesets
  std::size_t max_nodes = std::size_t{4} << 20;    ///< tiles visited, and tiles in distinct tileset files
  std::size_t max_files = std::size_t{256} << 10;  ///< external tilesets and subtrees, once per reference
};

/// The requested part of the tree exceeds the limits; going on elsewhere would not help.
class TreeTooLarge : public InputError {
 public:
  using InputError::InputError;
};

/// A tileset and the external tilesets and subtrees that it names, which are read on first use. A tile has a node once
/// its parent's children were requested, so that memory depends on what is visited, not on the tree. Not thread safe,
/// except that node(), tileset() and T_tileset_tile() may be called from several threads while no other function runs.
class TilesetTree {
 public:
  /// Reads the root tileset.json. Throws InputError.
  explicit TilesetTree(fetch::TileSource& source, const TreeLimits& limits = {});

  NodeId root() const { return 0; }
  const TreeNode& node(NodeId id) const { return nodes_[id].node; }
  /// Returns the tile as stated in its file. The call creates a tile of a subtree. Throws InputError if its metadata
  /// are broken.
  std::shared_ptr<const Tile> tile(NodeId id) const;
  /// Returns the file that states the tile's version, axes and extensions: for a tile of a subtree, that of its
  /// implicit root.
  const Tileset& tileset(NodeId id) const { return *files_[node(id).file].tileset; }
  /// Returns the transform from the tile's frame to the tileset's, which is that of the root tileset.json.
  const geometry::Mat4& T_tileset_tile(NodeId id) const { return transforms_[nodes_[id].transform]; }
  /// Returns the number of tiles visited so far.
  std::size_t node_count() const { return nodes_.size(); }

  /// Returns the tile's children in its own file, in file order. Throws TreeTooLarge.
  std::vector<NodeId> children(NodeId id);
  /// Returns the tile's bounding volume in the tileset's frame, widened by volume_margin_m().
  BoundingVolume volume(NodeId id) const;
  /// Returns the volume that the file states for a content, or else for its tile: in the tileset's frame, not widened.
  BoundingVolume stated_volume(NodeId id, std::size_t content) const;
  /// Returns how far volume() and content_volume() reach beyond the volumes that the files state, metres: 0 unless
  /// contents turned out to lie outside of these (widen_to_contents()).
  double volume_margin_m() const { return volume_margin_m_; }
  void set_volume_margin(double margin_m) { volume_margin_m_ = margin_m; }
  /// Returns the tile's geometric error in metres. 3D Tiles 1.0 states it in metres whatever the transform ("does not
  /// apply to geometricError", section "Tile transforms"); 1.1 scales it by the largest scaling factor of the
  /// transform.
  double geometric_error_m(NodeId id) const;
  /// Returns a content's own bounding volume in the tileset's frame, if it has one.
  std::optional<BoundingVolume> content_volume(NodeId id, std::size_t content) const;
  /// Returns the volume in which a viewer must be to see the tile, in the tileset's frame, if the tile has one.
  std::optional<BoundingVolume> viewer_request_volume(NodeId id) const;
  /// Returns a content's URI, resolved against the file that names it.
  std::string content_uri(NodeId id, std::size_t content) const;
  /// Returns the tile's name for messages, such as "tileset.json: tile root/0/3".
  std::string name(NodeId id) const;

  /// Returns whether the content is an external tileset, by its URI's extension or, if that is inconclusive, by its
  /// first bytes (then the file is read). Throws InputError if it cannot be read.
  bool is_external_tileset(NodeId id, std::size_t content);
  /// Returns the root of the external tileset that a content names, which is read at the first call. A root without
  /// `refine` inherits it from the referring tile. Throws InputError if it is unreadable or part of a cycle, and
  /// TreeTooLarge.
  NodeId external_root(NodeId id, std::size_t content);

  /// Returns the root of the implicit subtree at this tile (whose `implicit_subtree` is set). Its subtree file is read
  /// at the first call. Throws InputError, TreeTooLarge.
  NodeId implicit_root(NodeId id);

  /// A nested file of the tree: the external tileset that a content names, or (no content) the subtree of a tile.
  struct NestedFile {
    NodeId node = 0;
    std::optional<std::size_t> content;
  };
  /// Returns whether a nested file has been read.
  bool is_read(const NestedFile& branch) const;
  /// Reads these files, in parallel if the source has latency. Errors are reported later by `external_root` and
  /// `implicit_root`.
  void read_nested_files(const std::vector<NestedFile>& branches);
  /// Returns whether the source has latency, so that reading several files at once is worthwhile.
  bool is_high_latency() { return source_.prefetch({}); }

  /// Returns the distinct tileset files read so far (without subtrees), in order of first reading: URI and content.
  const std::vector<std::pair<std::string, std::shared_ptr<const Tileset>>>& files_read() const { return files_read_; }

  /// Returns the distinct warnings of all files read so far, including subtrees.
  const std::vector<std::string>& warnings() const { return warnings_; }

 private:
  struct File {
    std::string uri;
    std::shared_ptr<const Tileset> tileset;  ///< for a subtree, the tileset that names it
    std::optional<Subtree> subtree;
    std::string path;  ///< for a subtree, the path of the implicit root, with which its tiles' paths begin
    std::optional<NodeId> referenced_by;  ///< the tile whose content this external tileset or subtree is
  };
  struct StoredNode {
    TreeNode node;
    NodeId first_child = 0;  ///< 0: its children were not requested
    std::uint32_t transform = 0;
  };

  std::shared_ptr<const Tileset> read_tileset(const std::string& uri);
  Subtree read_subtree(NodeId id);
  std::string subtree_uri(NodeId id) const;
  NodeId add_file(File file);
  NodeId add_nodes(std::uint32_t file, const std::vector<std::uint32_t>& tiles, std::optional<NodeId> parent);
  StoredNode make_node(std::uint32_t file, std::uint32_t tile, std::optional<NodeId> parent);
  std::vector<std::uint32_t> tiles_below(NodeId id) const;
  void check_chain(const std::string& uri, NodeId named_by) const;
  void add_warnings(const std::vector<std::string>& warnings);

  fetch::TileSource& source_;
  TreeLimits limits_;
  std::vector<File> files_;
  std::vector<StoredNode> nodes_;
  std::vector<geometry::Mat4> transforms_;  ///< distinct along each way down
  std::map<std::pair<NodeId, std::size_t>, NodeId> external_roots_;
  std::map<NodeId, NodeId> implicit_roots_;
  std::vector<std::pair<std::string, std::shared_ptr<const Tileset>>> files_read_;
  std::unordered_map<std::string, std::size_t> file_of_uri_;  ///< index into files_read_
  double volume_margin_m_ = 0.0;
  std::size_t tiles_read_ = 0;  ///< number of tiles in files_read_
  std::map<std::string, bool> sniffed_;
  std::vector<std::string> warnings_;
  mutable std::pair<NodeId, std::shared_ptr<const Tile>> latest_;  ///< the tile of a subtree that was made last
};

/// Throws InputError, naming the tileset, if it requires an unsupported extension.
void require_supported_extensions(const Tileset& tileset, const std::string& name);

}  // namespace tileflight::tileset
