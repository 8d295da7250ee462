// voxelize_mesh MESH.glb EDGE OUT.binvox: the cells of a regular grid that a mesh touches.
#include <cstdlib>
#include <iostream>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/mesh.h"
#include "tileflight/core/geometry/voxel_grid.h"
#include "tileflight/world/ground_truth/mesh_glb.h"
#include "tileflight/world/ground_truth/voxelize.h"

int main(int argc, char** argv) {
  if (argc != 4) {
    std::cerr << "usage: voxelize_mesh MESH.glb EDGE_METRES OUT.binvox\n";
    return 1;
  }
  try {
    const tileflight::geometry::TriangleMesh mesh = tileflight::ground_truth::read_mesh_glb(argv[1]);
    const auto grid = tileflight::ground_truth::voxelize(mesh, bounds(mesh), std::atof(argv[2]));
    tileflight::geometry::write_binvox(argv[3], grid);
    std::cout << grid.occupied.size() << " cells of " << grid.dims[0] << " x " << grid.dims[1] << " x " << grid.dims[2]
              << " are occupied\n";
  } catch (const tileflight::InputError& error) {
    std::cerr << error.what() << '\n';
    return 1;
  }
}
