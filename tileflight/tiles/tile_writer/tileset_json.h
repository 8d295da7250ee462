#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/core/geometry/mesh.h"

namespace tileflight::tile_writer {

/// A tree of cells with four children each, as an implicit quadtree (3D Tiles 1.1, "Implicit Tiling"). Cell i of a
/// level has the children 4 i to 4 i + 3, so its number is the Morton index of its coordinates.
struct ImplicitTree {
  std::vector<std::vector<geometry::Box3>> content;  ///< [level][cell]: exact bounds; empty: the tile has no content
  std::vector<double> geometric_error_m;             ///< one for each level
};

/// Returns (x, y) of the cell with this Morton index: x takes the even bits.
std::pair<std::uint32_t, std::uint32_t> implicit_coordinates(std::size_t cell);

/// Writes `folder`/subtrees/LEVEL-X-Y.subtree: availability of tiles and contents, and for each tile its bounding box
/// and geometric error as metadata, since cells divide the triangles evenly and not the ground. Returns the bytes
/// written.
std::int64_t write_subtrees(const std::filesystem::path& folder, const ImplicitTree& tree);

/// Returns the text of the tileset.json of an implicit tree, whose contents are tiles/LEVEL-X-Y.glb. `T_ecef_local`:
/// frame of the tiles; nullopt: not georeferenced.
std::string implicit_tileset_json(const ImplicitTree& tree, const std::optional<geometry::SE3>& T_ecef_local);

/// A tile of an explicit tree in tileset.json.
struct TileEntry {
  std::string uri;         ///< URI of the content; empty: there is none
  geometry::Box3 content;  ///< exact bounds of the content
  double geometric_error_m = 0.0;
  std::vector<TileEntry> children;
  geometry::Box3 bounds = {};  ///< bounds of content and children; see compute_bounds()
};

/// Returns a box of 3D Tiles 1.1, section 6.6.1: centre and three half axes. It is a millimetre larger than the bounds.
std::array<double, 12> box_numbers(const geometry::Box3& bounds);

/// Computes bounds from the leaves up, so that each contains its content and its children.
void compute_bounds(TileEntry& tile);

/// Returns the text of a tileset.json of an explicit tree (3D Tiles 1.1, REPLACE). Boxes are a millimetre larger than
/// the bounds, to allow for rounding of floats in the contents. `T_ecef_local`: frame of the tiles; nullopt: not
/// georeferenced.
std::string tileset_json(const TileEntry& root, const std::optional<geometry::SE3>& T_ecef_local);

}  // namespace tileflight::tile_writer
