#include "tileflight/tiles/tileset/tileset_tree.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <string_view>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/tiles/fetch/uri.h"

namespace tileflight::tileset {
namespace {

constexpr std::array<std::string_view, 12> kTileEndings = {"b3dm", "i3dm", "pnts",    "cmpt",    "glb",     "gltf",
                                                           "vctr", "geom", "terrain", "subtree", "geojson", "bin"};

TreeTooLarge too_large(const std::string& uri, std::size_t limit, const std::string& what) {
  return {fetch::uri_for_message(uri), "the tree with its external tilesets has more than " + std::to_string(limit) +
                                           " " + what +
                                           " in what was asked for; ask for a smaller region or coarser tiles"};
}

/// Whether it is JSON with a member "root", which glTF lacks: distinguishes the two without parsing.
bool looks_like_tileset(std::string_view text) {
  const std::size_t start = text.find_first_not_of(" \t\r\n\xEF\xBB\xBF");
  return start != std::string_view::npos && text[start] == '{' && text.find("\"root\"") != std::string_view::npos;
}

/// The path of a tile of an implicit tree: that of the tree's root, and the tile's coordinates.
std::string implicit_path(const std::string& root, const Subtree& subtree, std::uint32_t tile) {
  return root + ": " + coordinates_text(subtree.coordinates(tile), subtree.tiling().octree);
}

/// A tile of a subtree in the form of a tileset.json's. Child subtrees are tiles that wait for their files.
Tile tile_of_subtree(const Subtree& subtree, std::uint32_t index, const std::string& path, const std::string& where) {
  const ImplicitTiling& tiling = subtree.tiling();
  Tile out;
  out.path = path;
  if (subtree.is_child_subtree(index)) {
    const TileCoordinates coordinates = subtree.coordinates(index);
    out.bounding_volume = implicit_volume(tiling, coordinates);
    out.geometric_error_m = implicit_geometric_error_m(tiling, coordinates);
    out.level = static_cast<int>(coordinates.level);
    out.implicit_subtree = ImplicitSubtree{subtree.shared_tiling(), coordinates};
    return out;
  }
  SubtreeTile from = subtree.tile(index);
  out.bounding_volume = from.bounding_volume;
  out.geometric_error_m = from.geometric_error_m;
  out.level = static_cast<int>(from.coordinates.level);
  out.refine = from.refine;
  out.children = subtree.children(index);
  for (SubtreeContent& content : from.contents) {
    std::string uri = content.uri ? *std::move(content.uri)
                                  : expand_template(tiling.content_templates[content.template_index], tiling,
                                                    from.coordinates, where);
    out.contents.push_back({std::move(uri), std::move(content.bounding_volume)});
  }
  return out;
}

/// Whether the transform is exactly the identity, so that applying it changes no digit.
bool is_identity(const geometry::Mat4& transform) { return transform == geometry::Mat4::Identity(); }

}  // namespace

void require_supported_extensions(const Tileset& tileset, const std::string& name) {
  const std::vector<std::string> lacking = unsupported_extensions(tileset);
  if (lacking.empty()) return;
  std::string list = lacking[0];
  for (std::size_t i = 1; i < lacking.size(); ++i) list += ", " + lacking[i];
  throw InputError(name, "needs extensions that are not supported: " + list);
}

TilesetTree::TilesetTree(fetch::TileSource& source, const TreeLimits& limits) : source_(source), limits_(limits) {
  transforms_.push_back(geometry::Mat4::Identity());
  add_file({source.root_uri(), read_tileset(source.root_uri()), std::nullopt, "", std::nullopt});
}

std::shared_ptr<const Tile> TilesetTree::tile(NodeId id) const {
  const File& file = files_[node(id).file];
  const std::uint32_t index = node(id).tile;
  if (!file.subtree) return {file.tileset, &file.tileset->tiles[index]};
  if (latest_.second == nullptr || latest_.first != id) {
    latest_ = {id, std::make_shared<const Tile>(tile_of_subtree(
                       *file.subtree, index, implicit_path(file.path, *file.subtree, index), name(id)))};
  }
  return latest_.second;
}

std::vector<std::uint32_t> TilesetTree::tiles_below(NodeId id) const {
  const File& file = files_[node(id).file];
  return file.subtree ? file.subtree->children(node(id).tile) : file.tileset->tiles[node(id).tile].children;
}

std::vector<NodeId> TilesetTree::children(NodeId id) {
  const std::vector<std::uint32_t> tiles = tiles_below(id);
  if (tiles.empty()) return {};
  if (nodes_[id].first_child == 0) nodes_[id].first_child = add_nodes(node(id).file, tiles, id);
  std::vector<NodeId> ids(tiles.size());
  std::iota(ids.begin(), ids.end(), nodes_[id].first_child);
  return ids;
}

BoundingVolume TilesetTree::volume(NodeId id) const {
  const BoundingVolume stated = transformed(T_tileset_tile(id), tile(id)->bounding_volume);
  return volume_margin_m_ > 0.0 ? widened(stated, volume_margin_m_) : stated;
}

BoundingVolume TilesetTree::stated_volume(NodeId id, std::size_t content) const {
  const std::shared_ptr<const Tile> tile = this->tile(id);
  return transformed(T_tileset_tile(id), tile->contents[content].bounding_volume.value_or(tile->bounding_volume));
}

double TilesetTree::geometric_error_m(NodeId id) const {
  const double error_m = tile(id)->geometric_error_m;
  if (tileset(id).version == "1.0") return error_m;
  return error_m * T_tileset_tile(id).topLeftCorner<3, 3>().colwise().norm().maxCoeff();
}

std::optional<BoundingVolume> TilesetTree::content_volume(NodeId id, std::size_t content) const {
  const std::shared_ptr<const Tile> tile = this->tile(id);
  const std::optional<BoundingVolume>& own = tile->contents[content].bounding_volume;
  if (!own) return std::nullopt;
  const BoundingVolume stated = transformed(T_tileset_tile(id), *own);
  return volume_margin_m_ > 0.0 ? widened(stated, volume_margin_m_) : stated;
}

std::optional<BoundingVolume> TilesetTree::viewer_request_volume(NodeId id) const {
  const std::shared_ptr<const Tile> tile = this->tile(id);
  return tile->viewer_request_volume ? std::optional(transformed(T_tileset_tile(id), *tile->viewer_request_volume))
                                     : std::nullopt;
}

std::string TilesetTree::content_uri(NodeId id, std::size_t content) const {
  return fetch::resolve_reference(source_, files_[node(id).file].uri, tile(id)->contents[content].uri);
}

std::string TilesetTree::name(NodeId id) const {
  const File& file = files_[node(id).file];
  return fetch::uri_for_message(file.uri) + ": tile " +
         (file.subtree ? implicit_path(file.path, *file.subtree, node(id).tile)
                       : file.tileset->tiles[node(id).tile].path);
}

bool TilesetTree::is_external_tileset(NodeId id, std::size_t content) {
  const std::string uri = content_uri(id, content);
  const std::string ending = fetch::uri_extension(uri);
  if (ending == "json") return true;
  if (std::find(kTileEndings.begin(), kTileEndings.end(), ending) != kTileEndings.end()) return false;
  const auto known = sniffed_.find(uri);
  if (known != sniffed_.end()) return known->second;
  return sniffed_[uri] = looks_like_tileset(base::as_text(fetch::read_uri(source_, uri)));
}

NodeId TilesetTree::external_root(NodeId id, std::size_t content) {
  const auto known = external_roots_.find({id, content});
  if (known != external_roots_.end()) return known->second;
  const std::string uri = content_uri(id, content);
  check_chain(uri, id);
  const NodeId root = add_file({uri, read_tileset(uri), std::nullopt, "", id});
  external_roots_[{id, content}] = root;
  return root;
}

NodeId TilesetTree::implicit_root(NodeId id) {
  const auto known = implicit_roots_.find(id);
  if (known != implicit_roots_.end()) return known->second;
  const File& named_by = files_[node(id).file];
  const std::string path = named_by.subtree ? named_by.path : named_by.tileset->tiles[node(id).tile].path;
  const NodeId root = add_file({named_by.uri, named_by.tileset, read_subtree(id), path, id});
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

std::shared_ptr<const Tileset> TilesetTree::read_tileset(const std::string& uri) {
  if (const auto known = file_of_uri_.find(uri); known != file_of_uri_.end()) return files_read_[known->second].second;
  const std::vector<std::byte> bytes = fetch::read_uri(source_, uri);
  const TextReader read_text = [&](const std::string& reference) {
    return std::string(base::as_text(fetch::read_uri(source_, fetch::resolve_reference(source_, uri, reference))));
  };
  auto tileset = std::make_shared<const Tileset>(
      parse_tileset_json(base::as_text(bytes), fetch::uri_for_message(uri), limits_.file, read_text));
  tiles_read_ += tileset->tiles.size();
  if (tiles_read_ > limits_.max_nodes) throw too_large(uri, limits_.max_nodes, "tiles");
  add_warnings(tileset->warnings);
  file_of_uri_.emplace(uri, files_read_.size());
  files_read_.emplace_back(uri, tileset);
  return tileset;
}

void TilesetTree::check_chain(const std::string& uri, NodeId named_by) const {
  std::vector<std::string> chain = {uri};
  for (std::optional<NodeId> id = named_by; id; id = files_[node(*id).file].referenced_by) {
    if (files_[node(*id).file].subtree) continue;
    const std::string& outer = files_[node(*id).file].uri;
    chain.push_back(outer);
    if (outer != uri) continue;
    std::string way = fetch::uri_for_message(chain.back());
    for (std::size_t i = chain.size() - 1; i-- > 0;) way += " → " + fetch::uri_for_message(chain[i]);
    throw InputError(name(named_by), "external tilesets form a cycle: " + way);
  }
  if (chain.size() > static_cast<std::size_t>(limits_.max_external_chain)) {
    throw InputError(name(named_by),
                     "external tilesets are nested more than " + std::to_string(limits_.max_external_chain) + " deep");
  }
}

std::string TilesetTree::subtree_uri(NodeId id) const {
  const std::shared_ptr<const Tile> tile = this->tile(id);
  const ImplicitSubtree& place = *tile->implicit_subtree;
  return fetch::resolve_reference(source_, files_[node(id).file].uri,
                                  expand_template(place.tiling->subtree_template, *place.tiling, place.root, name(id)));
}

Subtree TilesetTree::read_subtree(NodeId id) {
  const std::string uri = subtree_uri(id);
  return parse_subtree(
      fetch::read_uri(source_, uri), *tile(id)->implicit_subtree, fetch::uri_for_message(uri),
      [&](const std::string& r) { return fetch::read_uri(source_, fetch::resolve_reference(source_, uri, r)); });
}

NodeId TilesetTree::add_file(File file) {
  if (files_.size() >= limits_.max_files)
    throw too_large(file.uri, limits_.max_files, "external tilesets and subtrees");
  if (file.subtree) add_warnings(file.subtree->warnings());
  const std::optional<NodeId> named_by = file.referenced_by;
  files_.push_back(std::move(file));
  return add_nodes(static_cast<std::uint32_t>(files_.size() - 1), {0}, named_by);
}

NodeId TilesetTree::add_nodes(std::uint32_t file, const std::vector<std::uint32_t>& tiles,
                              std::optional<NodeId> parent) {
  if (nodes_.size() + tiles.size() > limits_.max_nodes) throw too_large(files_[file].uri, limits_.max_nodes, "tiles");
  const auto first = static_cast<NodeId>(nodes_.size());
  for (const std::uint32_t tile : tiles) nodes_.push_back(make_node(file, tile, parent));
  return first;
}

TilesetTree::StoredNode TilesetTree::make_node(std::uint32_t file, std::uint32_t tile, std::optional<NodeId> parent) {
  StoredNode made;
  made.node.file = file;
  made.node.tile = tile;
  made.node.parent = parent;
  if (parent) {
    made.transform = nodes_[*parent].transform;
    made.node.refine = node(*parent).refine;
  }
  if (files_[file].subtree) {
    made.node.refine = files_[file].subtree->refine(tile).value_or(made.node.refine);
    return made;
  }
  const Tile& own = files_[file].tileset->tiles[tile];
  made.node.refine = own.refine.value_or(made.node.refine);
  if (is_identity(own.T_parent_tile)) return made;
  const geometry::Mat4 T_tileset_tile = transforms_[made.transform] * own.T_parent_tile;
  transforms_.push_back(parent ? T_tileset_tile : own.T_parent_tile);
  made.transform = static_cast<std::uint32_t>(transforms_.size() - 1);
  return made;
}

void TilesetTree::add_warnings(const std::vector<std::string>& warnings) { base::add_distinct(warnings, warnings_); }

}  // namespace tileflight::tileset
