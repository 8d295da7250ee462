#include "tileflight/tiles/tileset_tree.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "tileflight/base/input_error.h"
#include "tileflight/base/raw_bytes.h"
#include "tileflight/tiles/subtree.h"
#include "tileflight/transport/uri.h"

namespace tileflight::tiles {
namespace {

constexpr std::array<std::string_view, 12> kTileEndings = {"b3dm", "i3dm", "pnts",    "cmpt",    "glb",     "gltf",
                                                           "vctr", "geom", "terrain", "subtree", "geojson", "bin"};

/// Whether it is JSON with a member "root", which glTF lacks: distinguishes the two without parsing.
bool looks_like_tileset(std::string_view text) {
  const std::size_t start = text.find_first_not_of(" \t\r\n\xEF\xBB\xBF");
  return start != std::string_view::npos && text[start] == '{' && text.find("\"root\"") != std::string_view::npos;
}

/// Converts a tile of a subtree to the form of a tileset.json. Child subtrees become tiles that wait for their files.
class SubtreeConverter {
 public:
  SubtreeConverter(const Subtree& subtree, const Tile& stands_at, const Tileset& named_by, const std::string& where)
      : subtree_(subtree), tiling_(stands_at.implicit_subtree->tiling), anchor_(stands_at), where_(where) {
    out_.version = named_by.version;
    out_.gltf_up_axis = named_by.gltf_up_axis;
    out_.is_subtree = true;
    out_.warnings = subtree.warnings;
  }

  Tileset convert() {
    out_.tiles.resize(subtree_.tiles.size());
    for (std::size_t i = 0; i < subtree_.tiles.size(); ++i) fill(i);
    return std::move(out_);
  }

 private:
  void fill(std::size_t index) {
    const SubtreeTile& from = subtree_.tiles[index];
    Tile tile = tile_at(from.coordinates);
    tile.bounding_volume = from.bounding_volume;
    tile.geometric_error_m = from.geometric_error_m;
    tile.refine = from.refine;
    tile.children = from.children;
    for (const SubtreeContent& content : from.contents) tile.contents.push_back(content_of(content, from.coordinates));
    for (const TileCoordinates& root : from.subtrees) {
      tile.children.push_back(static_cast<std::uint32_t>(out_.tiles.size()));
      out_.tiles.push_back(tile_at(root));
      out_.tiles.back().implicit_subtree = ImplicitSubtree{tiling_, root};
    }
    out_.tiles[index] = std::move(tile);
  }

  Tile tile_at(const TileCoordinates& coordinates) const {
    Tile tile;
    tile.bounding_volume = implicit_volume(*tiling_, coordinates);
    tile.geometric_error_m = implicit_geometric_error_m(*tiling_, coordinates);
    tile.path = anchor_.path.substr(0, anchor_.path.find(':')) + ": " + coordinates_text(coordinates, tiling_->octree);
    tile.level = static_cast<int>(coordinates.level);
    return tile;
  }

  Content content_of(const SubtreeContent& content, const TileCoordinates& at) const {
    if (content.uri) return {*content.uri, content.bounding_volume};
    return {expand_template(tiling_->content_templates[content.template_index], *tiling_, at, where_),
            content.bounding_volume};
  }

  const Subtree& subtree_;
  std::shared_ptr<const ImplicitTiling> tiling_;
  const Tile& anchor_;
  std::string where_;
  Tileset out_;
};

Tileset to_tileset(const Subtree& subtree, const Tile& stands_at, const Tileset& named_by, const std::string& where) {
  return SubtreeConverter(subtree, stands_at, named_by, where).convert();
}

}  // namespace

void require_supported_extensions(const Tileset& tileset, const std::string& name) {
  const std::vector<std::string> lacking = unsupported_extensions(tileset);
  if (lacking.empty()) return;
  std::string list = lacking[0];
  for (std::size_t i = 1; i < lacking.size(); ++i) list += ", " + lacking[i];
  throw InputError(name, "needs extensions that are not supported: " + list);
}

TilesetTree::TilesetTree(transport::TileSource& source, const TreeLimits& limits) : source_(source), limits_(limits) {
  add_file(source.root_uri(), read_tileset(source.root_uri()), std::nullopt);
}

std::vector<NodeId> TilesetTree::children(NodeId id) const {
  const NodeId first = files_[nodes_[id].file].first_node;
  const std::vector<std::uint32_t>& tiles = tile(id).children;
  std::vector<NodeId> ids(tiles.size());
  std::transform(tiles.begin(), tiles.end(), ids.begin(), [&](std::uint32_t index) { return first + index; });
  return ids;
}

BoundingVolume TilesetTree::volume(NodeId id) const {
  return transformed(nodes_[id].T_tileset_tile, tile(id).bounding_volume);
}

double TilesetTree::geometric_error_m(NodeId id) const {
  const double error_m = tile(id).geometric_error_m;
  if (tileset(id).version == "1.0") return error_m;
  return error_m * nodes_[id].T_tileset_tile.topLeftCorner<3, 3>().colwise().norm().maxCoeff();
}

std::optional<BoundingVolume> TilesetTree::content_volume(NodeId id, std::size_t content) const {
  const std::optional<BoundingVolume>& own = tile(id).contents[content].bounding_volume;
  return own ? std::optional(transformed(nodes_[id].T_tileset_tile, *own)) : std::nullopt;
}

std::optional<BoundingVolume> TilesetTree::viewer_request_volume(NodeId id) const {
  const std::optional<BoundingVolume>& own = tile(id).viewer_request_volume;
  return own ? std::optional(transformed(nodes_[id].T_tileset_tile, *own)) : std::nullopt;
}

std::string TilesetTree::content_uri(NodeId id, std::size_t content) const {
  return transport::resolve_uri(files_[nodes_[id].file].uri, tile(id).contents[content].uri);
}

std::string TilesetTree::name(NodeId id) const {
  return transport::uri_for_message(files_[nodes_[id].file].uri) + ": tile " + tile(id).path;
}

bool TilesetTree::is_external_tileset(NodeId id, std::size_t content) {
  const std::string uri = content_uri(id, content);
  const std::string ending = transport::uri_extension(uri);
  if (ending == "json") return true;
  if (std::find(kTileEndings.begin(), kTileEndings.end(), ending) != kTileEndings.end()) return false;
  const auto known = sniffed_.find(uri);
  if (known != sniffed_.end()) return known->second;
  return sniffed_[uri] = looks_like_tileset(base::as_text(transport::read_uri(source_, uri)));
}

NodeId TilesetTree::external_root(NodeId id, std::size_t content) {
  const auto known = external_roots_.find({id, content});
  if (known != external_roots_.end()) return known->second;
  const std::string uri = content_uri(id, content);
  check_chain(uri, id);
  const NodeId root = add_file(uri, read_tileset(uri), id);
  external_roots_[{id, content}] = root;
  return root;
}

NodeId TilesetTree::implicit_root(NodeId id) {
  const auto known = implicit_roots_.find(id);
  if (known != implicit_roots_.end()) return known->second;
  const std::string uri = files_[nodes_[id].file].uri;
  const NodeId root = add_file(uri, read_subtree(id), id);
  implicit_roots_[id] = root;
  return root;
}

bool TilesetTree::is_read(const NestedFile& branch) const {
  return branch.content ? external_roots_.contains({branch.node, *branch.content})
                        : implicit_roots_.contains(branch.node);
}

void TilesetTree::read_nested_files(const std::vector<NestedFile>& branches) {
  std::vector<std::string> uris;
  for (const NestedFile& branch : branches) {
    try {
      uris.push_back(branch.content ? content_uri(branch.node, *branch.content) : subtree_uri(branch.node));
    } catch (const InputError&) {
      continue;
    }
  }
  source_.prefetch(uris);
  for (const NestedFile& branch : branches) {
    try {
      if (branch.content) {
        external_root(branch.node, *branch.content);
      } else {
        implicit_root(branch.node);
      }
    } catch (const InputError&) {
      continue;  // the error is reported when that branch is visited
    }
  }
}

std::vector<std::pair<std::string, std::shared_ptr<const Tileset>>> TilesetTree::files_read() const {
  return files_read_;
}

std::vector<std::string> TilesetTree::warnings() const {
  std::vector<std::string> out;
  for (const File& file : files_) {
    for (const std::string& warning : file.tileset->warnings) {
      if (std::find(out.begin(), out.end(), warning) == out.end()) out.push_back(warning);
    }
  }
  return out;
}

std::shared_ptr<const Tileset> TilesetTree::read_tileset(const std::string& uri) {
  for (const auto& [read_uri_, tileset] : files_read_) {
    if (read_uri_ == uri) return tileset;
  }
  const std::vector<std::byte> bytes = transport::read_uri(source_, uri);
  const TextReader read_text = [&](const std::string& reference) {
    return std::string(base::as_text(transport::read_uri(source_, transport::resolve_uri(uri, reference))));
  };
  auto tileset = std::make_shared<const Tileset>(
      parse_tileset_json(base::as_text(bytes), transport::uri_for_message(uri), limits_.file, read_text));
  files_read_.emplace_back(uri, tileset);
  return tileset;
}

void TilesetTree::check_chain(const std::string& uri, NodeId named_by) const {
  std::vector<std::string> chain = {uri};
  for (std::optional<NodeId> id = named_by; id; id = files_[nodes_[*id].file].referenced_by) {
    if (tileset(*id).is_subtree) continue;
    const std::string& outer = files_[nodes_[*id].file].uri;
    chain.push_back(outer);
    if (outer != uri) continue;
    std::string way = transport::uri_for_message(chain.back());
    for (std::size_t i = chain.size() - 1; i-- > 0;) way += " → " + transport::uri_for_message(chain[i]);
    throw InputError(name(named_by), "external tilesets form a cycle: " + way);
  }
  if (chain.size() > static_cast<std::size_t>(limits_.max_external_chain)) {
    throw InputError(name(named_by),
                     "external tilesets are nested more than " + std::to_string(limits_.max_external_chain) + " deep");
  }
}

std::string TilesetTree::subtree_uri(NodeId id) const {
  const ImplicitSubtree& place = *tile(id).implicit_subtree;
  return transport::resolve_uri(files_[nodes_[id].file].uri,
                                expand_template(place.tiling->subtree_template, *place.tiling, place.root, name(id)));
}

std::shared_ptr<const Tileset> TilesetTree::read_subtree(NodeId id) {
  const Tile& stands_at = tile(id);
  const ImplicitSubtree& place = *stands_at.implicit_subtree;
  const std::string uri = subtree_uri(id);
  const Subtree subtree =
      parse_subtree(transport::read_uri(source_, uri), place, transport::uri_for_message(uri),
                    [&](const std::string& r) { return transport::read_uri(source_, transport::resolve_uri(uri, r)); });
  return std::make_shared<const Tileset>(to_tileset(subtree, stands_at, tileset(id), name(id)));
}

NodeId TilesetTree::add_file(const std::string& uri, std::shared_ptr<const Tileset> added,
                             std::optional<NodeId> named_by) {
  const std::shared_ptr<const Tileset> tileset = std::move(added);
  if (nodes_.size() + tileset->tiles.size() > limits_.max_nodes) {
    throw InputError(transport::uri_for_message(uri), "the tree with its external tilesets has more than " +
                                                          std::to_string(limits_.max_nodes) + " tiles");
  }
  const auto file = static_cast<std::uint32_t>(files_.size());
  const auto first = static_cast<NodeId>(nodes_.size());
  files_.push_back({uri, tileset, first, named_by});
  nodes_.resize(nodes_.size() + tileset->tiles.size());
  nodes_[first].parent = named_by;
  for (std::uint32_t i = 0; i < tileset->tiles.size(); ++i) {  // parents precede children
    const Tile& tile = tileset->tiles[i];
    TreeNode& node = nodes_[first + i];
    node.file = file;
    node.tile = i;
    if (node.parent)
      node.T_tileset_tile = nodes_[*node.parent].T_tileset_tile * tile.T_parent_tile;
    else
      node.T_tileset_tile = tile.T_parent_tile;
    node.refine = tile.refine.value_or(node.parent ? nodes_[*node.parent].refine : Refine::kReplace);
    for (const std::uint32_t child : tile.children) nodes_[first + child].parent = first + i;
  }
  return first;
}

}  // namespace tileflight::tiles
