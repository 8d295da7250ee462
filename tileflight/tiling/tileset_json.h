#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tileflight/geometry/mesh.h"

namespace tileflight::tiling {

/// A tile of an explicit tree as tileset.json has it.
struct TileEntry {
  std::string uri;         ///< of the content; empty: the tile has none
  geometry::Box3 content;  ///< exact bounds of the content
  double geometric_error_m = 0.0;
  std::vector<TileEntry> children;
  geometry::Box3 bounds = {};  ///< of content and children; see set_bounds
};

/// Bounds from the leaves up, so that each contains its content and its children.
void set_bounds(TileEntry& tile);

/// The text of a tileset.json (3D Tiles 1.1, REPLACE) whose boxes are a millimetre wider than the bounds, for the
/// floats in the contents. `T_ecef_local`: frame of the tiles; without: not georeferenced.
std::string tileset_json(const TileEntry& root, const std::optional<geometry::SE3>& T_ecef_local);

}  // namespace tileflight::tiling
