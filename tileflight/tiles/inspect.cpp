#include "tileflight/tiles/inspect.h"

#include <algorithm>
#include <set>

#include "tileflight/base/input_error.h"
#include "tileflight/base/string_lists.h"
#include "tileflight/tile_contents/attribution.h"
#include "tileflight/tiles/placement.h"
#include "tileflight/tiles/tileset_tree.h"
#include "tileflight/transport/uri.h"

namespace tileflight::tiles {
namespace {

/// Traverses a whole tree, including external tilesets.
class TilesetInspector {
 public:
  TilesetInspector(transport::TileSource& source, const Progress& progress)
      : source_(source), progress_(progress), tree_(source) {}

  TilesetSummary run() {
    const Tileset& root = tree_.tileset(tree_.root());
    out_.version = root.version;
    out_.generator = root.generator;
    out_.geometric_error_m = root.geometric_error_m;
    describe_location();
    if (tree_.is_high_latency()) read_ahead();
    walk();
    describe_files();
    describe_contents();
    return std::move(out_);
  }

 private:
  void describe_location() {
    out_.georeferenced = is_georeferenced(tree_);
    const BoundingVolume volume = tree_.volume(tree_.root());
    geometry::SE3 T_local_tileset = out_.georeferenced ? geometry::SE3() : T_own_tileset(tree_);
    if (out_.georeferenced) {
      out_.center = geometry::geodetic_from_ecef(center_of(volume));
      T_local_tileset = geometry::LocalFrame(*out_.center).T_local_ecef();
    }
    out_.bounds_local = local_bounding_box(volume, T_local_tileset);
  }

  /// Reads nested files level by level, all files of a level at once.
  void read_ahead() {
    std::set<std::pair<NodeId, std::optional<std::size_t>>> tried;
    while (true) {
      std::vector<TilesetTree::NestedFile> level = unread_branches();
      std::erase_if(level, [&](const auto& branch) { return !tried.emplace(branch.node, branch.content).second; });
      if (level.empty()) return;
      report_progress(progress_, static_cast<std::int64_t>(tried.size()), 0, "reading the tree");
      tree_.read_nested_files(level);
    }
  }

  std::vector<TilesetTree::NestedFile> unread_branches() {
    std::vector<TilesetTree::NestedFile> unread;
    std::vector<NodeId> pending = {tree_.root()};
    const auto go_on = [&](const TilesetTree::NestedFile& branch) {
      if (!tree_.is_read(branch)) return unread.push_back(branch);
      pending.push_back(branch.content ? tree_.external_root(branch.node, *branch.content)
                                       : tree_.implicit_root(branch.node));
    };
    while (!pending.empty()) {
      const NodeId id = pending.back();
      pending.pop_back();
      if (tree_.tile(id).implicit_subtree) {
        go_on({id, std::nullopt});
        continue;
      }
      for (const NodeId child : tree_.children(id)) pending.push_back(child);
      for (std::size_t content = 0; content < tree_.tile(id).contents.size(); ++content) {
        if (transport::uri_extension(tree_.tile(id).contents[content].uri) == "json") go_on({id, content});
      }
    }
    return unread;
  }

  void walk() {
    std::vector<std::pair<NodeId, std::size_t>> pending = {{tree_.root(), 0}};
    while (!pending.empty()) {
      const auto [id, level] = pending.back();
      pending.pop_back();
      if (tree_.tile(id).implicit_subtree) {
        if (const auto root = implicit_root(id)) pending.emplace_back(*root, level);
        continue;
      }
      count_tile(id, level);
      for (const NodeId child : tree_.children(id)) pending.emplace_back(child, level + 1);
      for (std::size_t content = 0; content < tree_.tile(id).contents.size(); ++content) {
        if (const auto root = visit_content(id, content)) pending.emplace_back(*root, level + 1);
      }
      if (out_.tiles % 4096 == 0) report_progress(progress_, out_.tiles, 0, "reading the tree");
    }
  }

  void count_tile(NodeId id, std::size_t level) {
    const Tile& tile = tree_.tile(id);
    const double error_m = tree_.geometric_error_m(id);
    ++out_.tiles;
    if (!tile.contents.empty()) ++out_.tiles_with_content;
    if (!tile.unsupported.empty()) ++out_.tiles_unsupported;
    if (tile.children.empty()) ++out_.leaves;
    if (!tile.children.empty()) ++(tree_.node(id).refine == Refine::kAdd ? out_.tiles_add : out_.tiles_replace);
    if (out_.levels.size() <= level) {
      out_.levels.resize(level + 1);
      out_.levels[level] = {0, error_m, error_m};
    }
    LevelSummary& summary = out_.levels[level];
    ++summary.tiles;
    summary.geometric_error_min_m = std::min(summary.geometric_error_min_m, error_m);
    summary.geometric_error_max_m = std::max(summary.geometric_error_max_m, error_m);
  }

  std::optional<NodeId> implicit_root(NodeId id) {
    try {
      const NodeId root = tree_.implicit_root(id);
      ++out_.subtrees;
      return root;
    } catch (const InputError& error) {
      out_.failures.push_back(tree_.name(id) + ": " + error.what());
      return std::nullopt;
    }
  }

  /// Counts a content; returns the root of the tree below it if it is a readable external tileset.
  std::optional<NodeId> visit_content(NodeId id, std::size_t content) {
    try {
      if (!tree_.is_external_tileset(id, content)) {
        const std::string uri = tree_.content_uri(id, content);
        const std::string ending = transport::uri_extension(uri);
        ++out_.contents[ending.empty() ? "unknown" : ending];
        if (content_uris_.insert(uri).second) contents_in_order_.push_back(uri);
        return std::nullopt;
      }
      ++out_.contents["tileset"];
      return tree_.external_root(id, content);
    } catch (const InputError& error) {
      out_.failures.push_back(tree_.name(id) + ": " + error.what());
      return std::nullopt;
    }
  }

  void describe_files() {
    tile_contents::AttributionCollector attribution;
    for (const auto& [uri, tileset] : tree_.files_read()) {
      attribution.add(tileset->copyright);
      base::add_distinct(tileset->extensions_used, out_.extensions_used);
      base::add_distinct(tileset->extensions_required, out_.extensions_required);
      base::add_distinct(unsupported_extensions(*tileset), out_.extensions_unsupported);
    }
    base::add_distinct(source_.warnings(), out_.warnings);
    base::add_distinct(tree_.warnings(), out_.warnings);
    out_.external_tilesets = static_cast<std::int64_t>(tree_.files_read().size()) - 1;
    for (const std::string& uri : sample_of_contents()) add_copyrights(uri, attribution);
    out_.attribution = source_.attribution();
    base::add_distinct(attribution.sorted_holders(), out_.attribution);
  }

  /// Contents to read for attribution: up to 64 local files, or 5 from a server; none if the provider itself states
  /// whom to credit.
  std::vector<std::string> sample_of_contents() {
    constexpr std::size_t kOfFiles = 64, kOfServer = 5;
    constexpr std::uintmax_t kLargest_bytes = 64 << 20;
    const bool is_here = source_.knows_sizes();
    if (!is_here && !source_.attribution().empty()) return {};
    const std::size_t all = contents_in_order_.size(), wanted = std::min(all, is_here ? kOfFiles : kOfServer);
    std::vector<std::string> sample;
    for (std::size_t i = 0; i < wanted; ++i) {
      const std::string& uri = contents_in_order_[i * all / wanted];
      if (!is_here || transport::is_data_uri(uri) || source_.size(uri).value_or(kLargest_bytes + 1) <= kLargest_bytes)
        sample.push_back(uri);
    }
    return sample;
  }

  void add_copyrights(const std::string& uri, tile_contents::AttributionCollector& attribution) {
    try {
      for (const std::string& copyright : tile_contents::find_copyrights(transport::read_uri(source_, uri)))
        attribution.add(copyright);
      ++out_.contents_read;
    } catch (const InputError&) {  // reported to the caller that loads the tile
    }
  }

  void describe_contents() {
    out_.content_files = static_cast<std::int64_t>(content_uris_.size());
    out_.content_sizes_known = source_.knows_sizes();
    if (!out_.content_sizes_known) return;
    for (const std::string& uri : content_uris_) {
      if (transport::is_data_uri(uri)) continue;
      const std::optional<std::uintmax_t> bytes = source_.size(uri);
      out_.content_bytes += static_cast<std::int64_t>(bytes.value_or(0));
      if (!bytes) ++out_.content_files_missing;
    }
  }

  transport::TileSource& source_;
  const Progress& progress_;
  TilesetTree tree_;
  TilesetSummary out_;
  std::set<std::string> content_uris_;
  std::vector<std::string> contents_in_order_;
};

}  // namespace

TilesetSummary inspect_tileset(transport::TileSource& source, const Progress& progress) {
  return TilesetInspector(source, progress).run();
}

TilesetSummary inspect_tileset(const std::string& source, const transport::SourceOptions& options,
                               const Progress& progress) {
  const std::unique_ptr<transport::TileSource> files = transport::open_source(source, options);
  return inspect_tileset(*files, progress);
}

}  // namespace tileflight::tiles
