#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "tileflight/core/geometry/mesh.h"
#include "tileflight/core/geometry/point_cloud.h"

namespace tileflight::geometry {

/// A cell by its indices along east, north, up from the grid's minimum corner.
struct Cell {
  std::int32_t x = 0, y = 0, z = 0;
  friend auto operator<=>(const Cell&, const Cell&) = default;
};

/// A sparse regular grid of cubic cells: memory is proportional to the number of occupied cells.
/// Cell (x, y, z) covers origin + edge * [x, x+1) x [y, y+1) x [z, z+1).
struct VoxelGrid {
  Vec3 origin = Vec3::Zero();          ///< minimum corner, metres, local frame
  double edge_m = 1.0;                 ///< edge of a cell
  std::array<std::int32_t, 3> dims{};  ///< cells along east, north, up
  std::vector<Cell> occupied;          ///< sorted (x, then y, then z), no duplicates

  Vec3 center(const Cell& c) const { return origin + edge_m * (Vec3(c.x, c.y, c.z) + Vec3::Constant(0.5)); }
};

/// Returns the cell centres by the paper's equation (1), ((i+0.5)/d, (j+0.5)/d, (k+0.5)/d), then scaled by d * edge and
/// shifted by the origin; in the order of `occupied`.
PointCloud cell_centers(const VoxelGrid& grid);

/// Returns one cell's centre, bit-identical to that of cell_centers().
Vec3 center_by_equation(const VoxelGrid& grid, const Cell& cell);

/// Writes and reads binvox version 1 (P. Min): the numbers after `dim` follow the order of the data: first axis (east)
/// slowest, then up, then north fastest; `translate` is the minimum corner, `scale` the longest side in metres. The
/// specification requires equal sides, and readers disagree on unequal ones: a grid whose longest side has at most 1024
/// cells is padded with empty cells to a cube, so `dims` may grow in a round trip. Larger grids are written unpadded.
/// Reading takes any sides, accepts zero-length runs (AirSim writes them), checks run totals against the header and
/// throws InputError (file, byte, cause).
void write_binvox(const std::filesystem::path& file, const VoxelGrid& grid);
VoxelGrid read_binvox(const std::filesystem::path& file);

/// Reads only origin, edge and dims of a binvox file, not its cells. Fast for any size.
VoxelGrid read_binvox_header(const std::filesystem::path& file);

}  // namespace tileflight::geometry
