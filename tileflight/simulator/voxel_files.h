#pragma once

#include <filesystem>

#include "tileflight/geometry/mesh.h"
#include "tileflight/geometry/voxel_grid.h"
#include "tileflight/simulator/own_types.h"

namespace tileflight::simulator {

/// A box of cells by what clients say, checked. Local frame (east, north, up).
struct WantedGrid {
  geometry::Vec3 center_local = geometry::Vec3::Zero();
  geometry::Vec3 size_m = geometry::Vec3::Ones();  ///< east, north, up
  double edge_m = 1.0;
  std::array<std::int64_t, 3> cells{1, 1, 1};  ///< east, north, up: size over edge, rounded
  geometry::Box3 box;                          ///< of the cells

  std::int64_t count() const { return cells[0] * cells[1] * cells[2]; }
};

/// AirSim's: the centre lies in the middle of cell n/2 (whole division) along each axis. Throws InputError: not finite,
/// no cell, sides over 100 km, more than `most_cells`.
WantedGrid airsim_grid(const geometry::Vec3& center_local, const geometry::Vec3& size_m, double edge_m,
                       std::int64_t most_cells);
/// The centre in the middle of the box.
WantedGrid centered_grid(const geometry::Vec3& center_local, const geometry::Vec3& size_m, double edge_m,
                         std::int64_t most_cells);

/// Which cells a triangle touches. Throws InputError where there would be more than memory should hold.
geometry::VoxelGrid occupied(const geometry::TriangleMesh& mesh, const WantedGrid& grid);

/// A binvox file as AirSim lays it out: after `dim` the cells to the north, up and east; the data with north fastest,
/// then up, east slowest; `translate` minus half the edges north, east, up; `scale` the northern edge in metres, or
/// with `inverted_scale` one over it as AirSim writes. False where the file cannot be written.
bool write_airsim_binvox(const std::filesystem::path& file, const geometry::VoxelGrid& grid, const WantedGrid& wanted,
                         bool inverted_scale);

/// As an array to the north, east, down.
VoxelGridData grid_data(const geometry::VoxelGrid& grid, const WantedGrid& wanted, const geometry::SE3& T_local_ned);

}  // namespace tileflight::simulator
