#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/geometry/mesh.h"

namespace tileflight::tile_writer {

/// A tile of an explicit tree in tileset.json.
struct TileEntry {
  std::string uri;         ///< of the content; empty: none
  geometry::Box3 content;  ///< exact bounds of the content
  double geometric_error_m = 0.0;
  std::vector<TileEntry> children;
  geometry::Box3 bounds = {};  ///< of content and children; see compute_bounds
};

/// A box of 3D Tiles 1.1, section 6.6.1: centre and three half axes, a millimetre larger than the bounds.
std::array<double, 12> box_numbers(const geometry::Box3& bounds);

/// Computes bounds from the leaves up, so that each contains its content and its children.
void compute_bounds(TileEntry& tile);

/// The text of a tileset.json (3D Tiles 1.1, REPLACE). Boxes are a millimetre larger than the bounds, to allow for
/// rounding of floats in the contents. `T_ecef_local`: frame of the tiles; nullopt: not georeferenced.
std::string tileset_json(const TileEntry& root, const std::optional<geometry::SE3>& T_ecef_local);

}  // namespace tileflight::tile_writer
