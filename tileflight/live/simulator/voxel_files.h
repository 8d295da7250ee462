#pragma once

#include <filesystem>

#include "tileflight/core/geometry/mesh.h"
#include "tileflight/core/geometry/voxel_grid.h"
#include "tileflight/live/simulator/airsim_types.h"

namespace tileflight::simulator {

/// A checked box of cells requested by a client. Local frame (east, north, up).
struct VoxelGridSpec {
  geometry::Vec3 center_local = geometry::Vec3::Zero();
  geometry::Vec3 size_m = geometry::Vec3::Ones();  ///< east, north, up
  double voxel_size_m = 1.0;
  std::array<std::int64_t, 3> cells{1, 1, 1};  ///< east, north, up: size over edge length, rounded
  geometry::Box3 box;                          ///< bounds of all cells

  std::int64_t count() const { return cells[0] * cells[1] * cells[2]; }
};

/// A grid in AirSim's layout: the centre is the centre of cell n/2 (integer division) along each axis. Throws
/// InputError: not finite, no cell, sides over 100 km, more than `max_cells`.
VoxelGridSpec make_airsim_grid(const geometry::Vec3& center_local, const geometry::Vec3& size_m, double edge_m,
                               std::int64_t max_cells);
/// A grid whose centre is the centre of the box.
VoxelGridSpec make_centered_grid(const geometry::Vec3& center_local, const geometry::Vec3& size_m, double edge_m,
                                 std::int64_t max_cells);

/// Cells touched by a triangle. Throws InputError if the grid would need too much memory.
geometry::VoxelGrid voxelize_grid(const geometry::TriangleMesh& mesh, const VoxelGridSpec& grid);

/// Writes a binvox file in AirSim's layout: `dim` is the number of cells to the north, up and east; data with north
/// fastest, then up, east slowest; `translate` is minus half the extents north, east, up; `scale` is the northern
/// extent in metres, or with `inverted_scale` its reciprocal, as AirSim writes it. Returns false if the file cannot be
/// written.
bool write_airsim_binvox(const std::filesystem::path& file, const geometry::VoxelGrid& grid, const VoxelGridSpec& spec,
                         bool inverted_scale);

/// Converts to an array ordered north, east, down.
VoxelGridData to_voxel_grid_data(const geometry::VoxelGrid& grid, const VoxelGridSpec& spec,
                                 const geometry::SE3& T_local_ned);

}  // namespace tileflight::simulator
