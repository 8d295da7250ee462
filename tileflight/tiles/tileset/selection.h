#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "tileflight/tiles/tileset/region.h"
#include "tileflight/tiles/tileset/tileset_tree.h"

namespace tileflight::tileset {

/// Criterion for selecting tiles (a region, a flight's lenses or a single camera's view). Both functions depend only on
/// a volume in the tileset's frame, so a cut depends only on the tree and the criterion.
struct RefinementCriterion {
  std::function<bool(const BoundingVolume&)> intersects;  ///< returns whether anything inside the volume is requested
  /// Returns whether a tile of this geometric error (metres, as in the file) is fine enough there.
  std::function<bool(const BoundingVolume&, double geometric_error_m)> is_fine_enough;
  /// Returns whether a viewer is inside a tile's viewerRequestVolume; empty: no viewer, and the volume is ignored.
  std::function<bool(const BoundingVolume&)> contains_viewer = {};
};

/// Requests everything that intersects the region, at a geometric error of at most `error_m` where the tree provides
/// it.
RefinementCriterion region_criterion(const Region& region, const geometry::SE3& T_local_tileset, double error_m);

/// Returns the union of two criteria, at the finer resolution of those that request a volume. The viewers are dropped.
RefinementCriterion union_criterion(RefinementCriterion a, RefinementCriterion b);

/// A content selected by a cut.
struct CutContent {
  NodeId node = 0;
  std::size_t content = 0;  ///< index into the tile's contents
  std::string uri;          ///< resolved
  std::string identity;     ///< file, tile path and URI, from the root on: input of the cut's hash
  double geometric_error_m = 0.0;
};

/// A selection of contents that shows a place at one resolution.
struct TileCut {
  std::vector<CutContent> contents;    ///< depth first, children in file order, ADD parents before their children
  std::vector<std::string> failures;   ///< parts of the tree that could not be followed, one line each
  double geometric_error_max_m = 0.0;  ///< largest error of the tiles where refinement stopped
  std::string hash;                    ///< SHA-256 over the identities in order, lower-case hexadecimal
};

/// Selects the cut of the tree for a criterion (3D Tiles 1.1, section "Refinement"). Reads external tilesets on the
/// way, but no contents:
/// - A tile whose volume does not intersect the request is skipped with its descendants (children lie inside their
///   parent's volume).
/// - A tile is refined if it is not fine enough and has children. REPLACE: the children replace it. Those that do not
///   intersect are skipped; if none intersects, nothing is selected, since the children together contain everything
///   that the tile shows. ADD: its own content and the children.
/// - Refinement stops at the first tile on the way down that is fine enough: a child with a larger error than its
///   parent (invalid, but found in practice) is not reached through a parent that is fine enough. Errors like 2^53 - 1
///   need no special treatment.
/// - A leaf is selected whatever its error.
/// - A tile without content shows nothing, so it is refined even if it is fine enough.
/// - An external tileset is its tile's content: where that content would be selected, the external root is visited by
///   the same rules with its own volume, error and transform.
/// - A content whose own bounding volume does not intersect the request is skipped.
/// - A tile of an implicit tree whose subtree file is not yet read represents that subtree's root.
/// - If there is a viewer, a tile whose `viewerRequestVolume` does not contain it is skipped with its descendants.
/// - A tile of a subtree whose metadata are broken is a failure, skipped with its descendants.
/// Throws TreeTooLarge if what is asked for exceeds the tree's limits.
TileCut select_cut(TilesetTree& tree, const RefinementCriterion& wanted);

}  // namespace tileflight::tileset
