#include "tileflight/tiles/tileset/selection.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <set>
#include <utility>

#include "tileflight/core/base/hash.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/fetch/uri.h"
#include "tileflight/tiles/fetch/url_secrets.h"

namespace tileflight::tileset {
namespace {

/// One traversal of the tree. Recursion is bounded by the limits on levels and on nested external tilesets.
class CutSelector {
 public:
  CutSelector(TilesetTree& tree, const RefinementCriterion& wanted) : tree_(tree), criterion_(wanted) {
    const std::string root = fetch::remove_secrets(tree.files_read().front().first);
    root_folder_ = root.substr(0, root.rfind('/') + 1);  // npos + 1 is 0: no folder
  }

  TileCut run() {
    if (tree_.is_high_latency()) read_ahead();
    visit(tree_.root());
    base::Sha256 identities;
    for (const CutContent& content : cut_.contents) identities.add(content.identity + "\n");
    cut_.hash = identities.hex();
    return std::move(cut_);
  }

 private:
  /// Reads nested files level by level, all files of a level at once, so that the final traversal does not wait.
  void read_ahead() {
    std::set<std::pair<NodeId, std::optional<std::size_t>>> tried;
    while (true) {
      std::vector<TilesetTree::NestedFile> level;
      unread_ = &level;
      visit(tree_.root());
      unread_ = nullptr;
      cut_ = {};
      std::erase_if(level, [&](const auto& branch) { return !tried.emplace(branch.node, branch.content).second; });
      if (level.empty()) return;
      tree_.read_nested_files(level);
    }
  }

  /// While reading ahead: records an unread file instead of entering it.
  bool defer_unread(const TilesetTree::NestedFile& branch) {
    if (unread_ == nullptr || tree_.is_read(branch)) return false;
    unread_->push_back(branch);
    return true;
  }

  void visit(NodeId id) {
    const std::shared_ptr<const Tile> tile = read_tile(id);
    if (tile == nullptr) return;
    const BoundingVolume volume = tree_.volume(id);
    if (!criterion_.intersects(volume)) return;
    if (!tile->unsupported.empty()) {
      cut_.failures.push_back(tree_.name(id) + ": " + tile->unsupported + " is not supported");
      return;
    }
    if (hidden_from_viewer(id)) return;
    if (tile->implicit_subtree) return visit_subtree(id);
    const bool has_content = !tile->contents.empty();
    const bool fine_enough = criterion_.is_fine_enough(volume, tree_.geometric_error_m(id));
    const bool refined = !tile->children.empty() && (!fine_enough || !has_content);
    if (has_content && (!refined || tree_.node(id).refine == Refine::kAdd)) add_contents(id, !refined);
    if (!refined) return;
    for (const NodeId child : tree_.children(id)) visit(child);
  }

  /// Null, and a failure, if the tile's metadata are broken.
  std::shared_ptr<const Tile> read_tile(NodeId id) {
    try {
      return tree_.tile(id);
    } catch (const InputError& error) {
      fail(id, error);
      return nullptr;
    }
  }

  void fail(NodeId id, const InputError& error) {
    if (dynamic_cast<const TreeTooLarge*>(&error) != nullptr) throw;
    cut_.failures.push_back(tree_.name(id) + ": " + error.what());
  }

  bool hidden_from_viewer(NodeId id) const {
    if (!criterion_.contains_viewer) return false;
    const std::optional<BoundingVolume> volume = tree_.viewer_request_volume(id);
    return volume && !criterion_.contains_viewer(*volume);
  }

  void visit_subtree(NodeId id) {
    if (defer_unread({id, std::nullopt})) return;
    try {
      visit(tree_.implicit_root(id));
    } catch (const InputError& error) {
      fail(id, error);
    }
  }

  void add_contents(NodeId id, bool finest_here) {
    const std::size_t contents = tree_.tile(id)->contents.size();
    for (std::size_t content = 0; content < contents; ++content) {
      const std::optional<BoundingVolume> volume = tree_.content_volume(id, content);
      if (volume && !criterion_.intersects(*volume)) continue;
      try {
        if (tree_.is_external_tileset(id, content)) {
          if (defer_unread({id, content})) continue;
          visit(enter_external(id, content));
        } else {
          add_to_cut(id, content, finest_here);
        }
      } catch (const InputError& error) {
        fail(id, error);
      }
    }
  }

  NodeId enter_external(NodeId id, std::size_t content) {
    const NodeId root = tree_.external_root(id, content);
    require_supported_extensions(tree_.tileset(root), fetch::uri_for_message(tree_.content_uri(id, content)));
    return root;
  }

  void add_to_cut(NodeId id, std::size_t content, bool finest_here) {
    CutContent taken;
    taken.node = id;
    taken.content = content;
    taken.uri = tree_.content_uri(id, content);
    taken.geometric_error_m = tree_.geometric_error_m(id);
    taken.identity = relative_to_root(tree_.name(id)) + " " + relative_to_root(fetch::remove_secrets(taken.uri));
    if (finest_here) cut_.geometric_error_max_m = std::max(cut_.geometric_error_max_m, taken.geometric_error_m);
    cut_.contents.push_back(std::move(taken));
  }

  /// URIs relative to the root, so that identities do not depend on whether the tileset is in a folder, archive or
  /// server.
  std::string relative_to_root(const std::string& uri) const {
    return uri.starts_with(root_folder_) ? uri.substr(root_folder_.size()) : uri;
  }

  TilesetTree& tree_;
  const RefinementCriterion& criterion_;
  std::vector<TilesetTree::NestedFile>* unread_ = nullptr;  ///< set while reading ahead
  std::string root_folder_;                                 ///< URI of the root tileset without its last segment
  TileCut cut_;
};

}  // namespace

RefinementCriterion region_criterion(const Region& region, const geometry::SE3& T_local_tileset, double error_m) {
  return {.intersects = [region, T_local_tileset](
                            const BoundingVolume& volume) { return intersects(volume, T_local_tileset, region); },
          .is_fine_enough = [error_m](const BoundingVolume&,
                                      double geometric_error_m) { return geometric_error_m <= error_m; }};
}

RefinementCriterion union_criterion(RefinementCriterion a, RefinementCriterion b) {
  const auto fine = [](const RefinementCriterion& wanted, const BoundingVolume& volume, double geometric_error_m) {
    return !wanted.intersects(volume) || wanted.is_fine_enough(volume, geometric_error_m);
  };
  const auto both =
      std::make_shared<const std::pair<RefinementCriterion, RefinementCriterion>>(std::move(a), std::move(b));
  return {
      .intersects = [both](const BoundingVolume& v) { return both->first.intersects(v) || both->second.intersects(v); },
      .is_fine_enough =
          [both, fine](const BoundingVolume& v, double geometric_error_m) {
            return fine(both->first, v, geometric_error_m) && fine(both->second, v, geometric_error_m);
          }};
}

TileCut select_cut(TilesetTree& tree, const RefinementCriterion& wanted) { return CutSelector(tree, wanted).run(); }

}  // namespace tileflight::tileset
