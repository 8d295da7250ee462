#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "tileflight/tiles/region.h"
#include "tileflight/tiles/tileset_tree.h"

namespace tileflight::tiles {

/// What is wanted of a tree, whatever the reason (a region here; a flight's lenses or one camera's view later). Both
/// are pure functions of a volume in the tileset's frame, so a cut depends on nothing but the tree and what is wanted.
struct Wanted {
  std::function<bool(const BoundingVolume&)> meets;  ///< whether anything inside the volume is wanted
  /// Whether a tile of this geometric error (metres, as the file says) will do there.
  std::function<bool(const BoundingVolume&, double geometric_error_m)> fine_enough;
  /// Whether a viewer is inside a tile's viewerRequestVolume; empty: there is no viewer, and the volume is not heeded.
  std::function<bool(const BoundingVolume&)> holds_viewer = {};
};

/// Everything that meets the region, at a geometric error of at most `error_m` where the tree has that.
Wanted wanted_region(const Region& region, const geometry::SE3& T_local_tileset, double error_m);

/// What either wants, as fine as whoever wants it there wants it. There is no viewer any more.
Wanted wanted_union(Wanted a, Wanted b);

/// A content of the cut.
struct CutContent {
  NodeId node = 0;
  std::size_t content = 0;  ///< index into the tile's contents
  std::string uri;          ///< resolved
  std::string name;         ///< for messages: the tile and its URI
  std::string identity;     ///< file, tile path and URI, from the root on: what the cut's hash is made of
  double geometric_error_m = 0.0;
};

struct TileCut {
  std::vector<CutContent> contents;    ///< depth first, children in the file's order, ADD parents before their children
  std::vector<std::string> failures;   ///< parts of the tree that could not be followed, one line each
  double geometric_error_max_m = 0.0;  ///< of the tiles where refinement stopped
  std::string hash;                    ///< SHA-256 over the identities in order, lower-case hexadecimal
};

/// The cut of the tree that gives what is wanted (3D Tiles 1.1, section "Refinement"), reading external tilesets on the
/// way but no contents:
/// - A tile whose volume does not meet what is wanted is left out with all below it (children lie inside their parent's
/// volume).
/// - A tile is refined when it is not fine enough and has children. REPLACE: the children stand for it. Those that are
///   not met are left out; where none is met, there is nothing to take, since the children together hold everything
///   that the tile shows. ADD: its own content and the children.
/// - Refinement stops at the first tile on the way down that is fine enough: a child that claims a larger error than
/// its
///   parent (broken, but found) is not reached through a parent that will do. Errors like 2^53 - 1 need no special
///   treatment.
/// - A leaf is taken whatever its error is.
/// - A tile without content shows nothing, so it is passed through even if it is fine enough.
/// - An external tileset is its tile's content: where that tile's content would be taken, the external root is visited
///   by these same rules with its own volume, error and transform.
/// - A content whose own bounding volume does not meet what is wanted is left out.
/// - A tile of an implicit tree that waits for its subtree file stands for that subtree's root.
/// - A tile with a `viewerRequestVolume` that does not hold the viewer is left out with all below it, where there is a
///   viewer.
TileCut select_cut(TilesetTree& tree, const Wanted& wanted);

}  // namespace tileflight::tiles
