#include "tileflight/tiles/selection.h"

#include <algorithm>

#include "tileflight/geometry/files.h"
#include "tileflight/geometry/input_error.h"
#include "tileflight/tiles/uri.h"

namespace tileflight::tiles {
namespace {

/// One walk down the tree. Recursion is bounded by the limits on levels and on the external chain.
class CutWalk {
 public:
  CutWalk(TilesetTree& tree, const Wanted& wanted) : tree_(tree), wanted_(wanted) {}

  TileCut run() {
    visit(tree_.root());
    std::string identities;
    for (const CutContent& content : cut_.contents) identities += content.identity + "\n";
    cut_.hash = geometry::sha256_hex(identities);
    return std::move(cut_);
  }

 private:
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
    taken.identity = tree_.name(id) + " " + taken.uri;
    if (finest_here) cut_.geometric_error_max_m = std::max(cut_.geometric_error_max_m, taken.geometric_error_m);
    cut_.contents.push_back(std::move(taken));
  }

  TilesetTree& tree_;
  const Wanted& wanted_;
  TileCut cut_;
};

}  // namespace

Wanted wanted_region(const Region& region, const geometry::SE3& T_local_tileset, double error_m) {
  return {.meets = [box = region.box(), T_local_tileset](
                       const BoundingVolume& volume) { return tiles::meets(volume, T_local_tileset, box); },
          .fine_enough = [error_m](const BoundingVolume&,
                                   double geometric_error_m) { return geometric_error_m <= error_m; }};
}

TileCut select_cut(TilesetTree& tree, const Wanted& wanted) { return CutWalk(tree, wanted).run(); }

}  // namespace tileflight::tiles
