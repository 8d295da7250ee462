#include "tileflight/tiles/selection.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <set>
#include <utility>

#include "tileflight/geometry/files.h"
#include "tileflight/geometry/input_error.h"
#include "tileflight/tiles/uri.h"
#include "tileflight/tiles/url_secrets.h"

namespace tileflight::tiles {
namespace {

/// One walk down the tree. Recursion is bounded by the limits on levels and on the external chain.
class CutWalk {
 public:
  CutWalk(TilesetTree& tree, const Wanted& wanted) : tree_(tree), wanted_(wanted) {
    const std::string root = without_secrets(tree.files_read().front().first);
    root_folder_ = root.substr(0, root.rfind('/') + 1);  // npos + 1 is 0: none
  }

  TileCut run() {
    if (tree_.reading_waits()) read_ahead();
    visit(tree_.root());
    std::string identities;
    for (const CutContent& content : cut_.contents) identities += content.identity + "\n";
    cut_.hash = geometry::sha256_hex(identities);
    return std::move(cut_);
  }

 private:
  /// Files that the tree goes on in are read level by level, all of a level at once; the walk proper then waits for
  /// none.
  void read_ahead() {
    std::set<std::pair<NodeId, std::optional<std::size_t>>> tried;
    while (true) {
      std::vector<TilesetTree::Branch> level;
      unread_ = &level;
      visit(tree_.root());
      unread_ = nullptr;
      cut_ = {};
      std::erase_if(level, [&](const auto& branch) { return !tried.emplace(branch.node, branch.content).second; });
      if (level.empty()) return;
      tree_.read_branches(level);
    }
  }

  /// While reading ahead: notes a file that is not read yet instead of going there.
  bool is_put_off(const TilesetTree::Branch& branch) {
    if (unread_ == nullptr || tree_.is_read(branch)) return false;
    unread_->push_back(branch);
    return true;
  }

  void visit(NodeId id) {
    const BoundingVolume volume = tree_.volume(id);
    if (!wanted_.meets(volume)) return;
    if (const std::string& lacking = tree_.tile(id).unsupported; !lacking.empty()) {
      cut_.failures.push_back(tree_.name(id) + ": " + lacking + " is not supported");
      return;
    }
    if (hidden_from_viewer(id)) return;
    if (tree_.tile(id).implicit) return visit_subtree(id);
    const bool has_content = !tree_.tile(id).contents.empty();
    const bool has_children = !tree_.tile(id).children.empty();
    const bool fine_enough = wanted_.fine_enough(volume, tree_.geometric_error_m(id));
    const bool refined = has_children && (!fine_enough || !has_content);
    if (has_content && (!refined || tree_.node(id).refine == Refine::kAdd)) take_contents(id, !refined);
    if (!refined) return;
    for (const NodeId child : tree_.children(id)) visit(child);
  }

  bool hidden_from_viewer(NodeId id) const {
    if (!wanted_.holds_viewer) return false;
    const std::optional<BoundingVolume> volume = tree_.viewer_request_volume(id);
    return volume && !wanted_.holds_viewer(*volume);
  }

  void visit_subtree(NodeId id) {
    if (is_put_off({id, std::nullopt})) return;
    try {
      visit(tree_.implicit_root(id));
    } catch (const InputError& error) {
      cut_.failures.push_back(tree_.name(id) + ": " + error.what());
    }
  }

  void take_contents(NodeId id, bool finest_here) {
    for (std::size_t content = 0; content < tree_.tile(id).contents.size(); ++content) {
      const std::optional<BoundingVolume> volume = tree_.content_volume(id, content);
      if (volume && !wanted_.meets(*volume)) continue;
      try {
        if (tree_.is_external_tileset(id, content)) {
          if (is_put_off({id, content})) continue;
          visit(enter_external(id, content));
        } else {
          take(id, content, finest_here);
        }
      } catch (const InputError& error) {
        cut_.failures.push_back(tree_.name(id) + ": " + error.what());
      }
    }
  }

  NodeId enter_external(NodeId id, std::size_t content) {
    const NodeId root = tree_.external_root(id, content);
    require_supported_extensions(tree_.tileset(root), uri_for_message(tree_.content_uri(id, content)));
    return root;
  }

  void take(NodeId id, std::size_t content, bool finest_here) {
    CutContent taken;
    taken.node = id;
    taken.content = content;
    taken.uri = tree_.content_uri(id, content);
    taken.geometric_error_m = tree_.geometric_error_m(id);
    taken.name = tree_.name(id) + ": " + uri_for_message(taken.uri);
    taken.identity = from_root(tree_.name(id)) + " " + from_root(without_secrets(taken.uri));
    if (finest_here) cut_.geometric_error_max_m = std::max(cut_.geometric_error_max_m, taken.geometric_error_m);
    cut_.contents.push_back(std::move(taken));
  }

  /// The same place gives the same identities, whether it is read from a folder, an archive or a server.
  std::string from_root(const std::string& uri) const {
    return uri.starts_with(root_folder_) ? uri.substr(root_folder_.size()) : uri;
  }

  TilesetTree& tree_;
  const Wanted& wanted_;
  std::vector<TilesetTree::Branch>* unread_ = nullptr;  ///< set while reading ahead
  std::string root_folder_;                             ///< URI of the root tileset without its last segment
  TileCut cut_;
};

}  // namespace

Wanted wanted_region(const Region& region, const geometry::SE3& T_local_tileset, double error_m) {
  return {.meets = [region, T_local_tileset](
                       const BoundingVolume& volume) { return tiles::meets(volume, T_local_tileset, region); },
          .fine_enough = [error_m](const BoundingVolume&,
                                   double geometric_error_m) { return geometric_error_m <= error_m; }};
}

Wanted wanted_union(Wanted a, Wanted b) {
  const auto fine = [](const Wanted& wanted, const BoundingVolume& volume, double geometric_error_m) {
    return !wanted.meets(volume) || wanted.fine_enough(volume, geometric_error_m);
  };
  const auto both = std::make_shared<const std::pair<Wanted, Wanted>>(std::move(a), std::move(b));
  return {.meets = [both](const BoundingVolume& v) { return both->first.meets(v) || both->second.meets(v); },
          .fine_enough =
              [both, fine](const BoundingVolume& v, double geometric_error_m) {
                return fine(both->first, v, geometric_error_m) && fine(both->second, v, geometric_error_m);
              }};
}

TileCut select_cut(TilesetTree& tree, const Wanted& wanted) { return CutWalk(tree, wanted).run(); }

}  // namespace tileflight::tiles
