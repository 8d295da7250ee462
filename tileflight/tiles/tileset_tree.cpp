#include "tileflight/tiles/tileset_tree.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "tileflight/geometry/input_error.h"
#include "tileflight/tiles/uri.h"

namespace tileflight::tiles {
namespace {

constexpr std::array<std::string_view, 12> kTileEndings = {"b3dm", "i3dm", "pnts",    "cmpt",    "glb",     "gltf",
                                                           "vctr", "geom", "terrain", "subtree", "geojson", "bin"};

std::string_view as_text(const std::vector<std::byte>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// JSON with a member "root", which a glTF has not: enough to tell the two apart without parsing.
bool looks_like_tileset(std::string_view text) {
  const std::size_t start = text.find_first_not_of(" \t\r\n\xEF\xBB\xBF");
  return start != std::string_view::npos && text[start] == '{' && text.find("\"root\"") != std::string_view::npos;
}

}  // namespace

void require_supported_extensions(const Tileset& tileset, const std::string& name) {
  const std::vector<std::string> lacking = unsupported_extensions(tileset);
  if (lacking.empty()) return;
  std::string list = lacking[0];
  for (std::size_t i = 1; i < lacking.size(); ++i) list += ", " + lacking[i];
  throw InputError(name, "needs extensions that are not supported: " + list);
}

TilesetTree::TilesetTree(TileSource& source, const TreeLimits& limits) : source_(source), limits_(limits) {
  add_file(source.root_uri(), std::nullopt);
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

std::string TilesetTree::content_uri(NodeId id, std::size_t content) const {
  return resolve_uri(files_[nodes_[id].file].uri, tile(id).contents[content].uri);
}

std::string TilesetTree::name(NodeId id) const {
  return uri_for_message(files_[nodes_[id].file].uri) + ": tile " + tile(id).path;
}

bool TilesetTree::is_external_tileset(NodeId id, std::size_t content) {
  const std::string uri = content_uri(id, content);
  const std::string ending = uri_ending(uri);
  if (ending == "json") return true;
  if (std::find(kTileEndings.begin(), kTileEndings.end(), ending) != kTileEndings.end()) return false;
  const auto known = sniffed_.find(uri);
  if (known != sniffed_.end()) return known->second;
  return sniffed_[uri] = looks_like_tileset(as_text(read_uri(source_, uri)));
}

NodeId TilesetTree::external_root(NodeId id, std::size_t content) {
  const auto known = external_roots_.find({id, content});
  if (known != external_roots_.end()) return known->second;
  const NodeId root = add_file(content_uri(id, content), id);
  external_roots_[{id, content}] = root;
  return root;
}

std::vector<std::pair<std::string, std::shared_ptr<const Tileset>>> TilesetTree::files_read() const {
  return files_read_;
}

std::shared_ptr<const Tileset> TilesetTree::read_tileset(const std::string& uri) {
  for (const auto& [read_uri_, tileset] : files_read_) {
    if (read_uri_ == uri) return tileset;
  }
  const std::vector<std::byte> bytes = read_uri(source_, uri);
  auto tileset =
      std::make_shared<const Tileset>(parse_tileset_json(as_text(bytes), uri_for_message(uri), limits_.file));
  files_read_.emplace_back(uri, tileset);
  return tileset;
}

void TilesetTree::check_chain(const std::string& uri, NodeId named_by) const {
  std::vector<std::string> chain = {uri};
  for (std::optional<NodeId> id = named_by; id; id = files_[nodes_[*id].file].named_by) {
    const std::string& outer = files_[nodes_[*id].file].uri;
    chain.push_back(outer);
    if (outer != uri) continue;
    std::string way = uri_for_message(chain.back());
    for (std::size_t i = chain.size() - 1; i-- > 0;) way += " → " + uri_for_message(chain[i]);
    throw InputError(name(named_by), "external tilesets form a cycle: " + way);
  }
  if (chain.size() > static_cast<std::size_t>(limits_.max_external_chain)) {
    throw InputError(name(named_by), "external tilesets inside each other more than " +
                                         std::to_string(limits_.max_external_chain) + " deep");
  }
}

NodeId TilesetTree::add_file(const std::string& uri, std::optional<NodeId> named_by) {
  if (named_by) check_chain(uri, *named_by);
  const std::shared_ptr<const Tileset> tileset = read_tileset(uri);
  if (nodes_.size() + tileset->tiles.size() > limits_.max_nodes) {
    throw InputError(uri_for_message(uri), "the tree with its external tilesets has more than " +
                                               std::to_string(limits_.max_nodes) + " tiles");
  }
  const auto file = static_cast<std::uint32_t>(files_.size());
  const auto first = static_cast<NodeId>(nodes_.size());
  files_.push_back({uri, tileset, first, named_by});
  nodes_.resize(nodes_.size() + tileset->tiles.size());
  nodes_[first].parent = named_by;
  for (std::uint32_t i = 0; i < tileset->tiles.size(); ++i) {  // parents stand before their children
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
