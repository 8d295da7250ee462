#pragma once

#include <filesystem>
#include <vector>

#include "tileflight/geometry/progress.h"
#include "tileflight/imaging/textured_mesh.h"

namespace tileflight::ground_truth {

/// Binary glTF 2.0 of all triangles. glTF is y-up: a root node turns the local frame (x east, y north, z up) to (x, z,
/// -y). Under it each mesh is a node whose translation is the middle of its bounds, in double, and its positions are
/// floats relative to it, so that they keep better than a millimetre anywhere. Textures are embedded as JPEG, unlit
/// (KHR_materials_unlit); leave them out with `textures` false. Throws InputError when the file would exceed the 4 GiB
/// that GLB can say.
void write_mesh_glb(const std::filesystem::path& file, const std::vector<imaging::TexturedMesh>& meshes, bool textures,
                    const Progress& progress = {});

/// All triangles of a GLB file in the z-up frame, node transforms applied in double. Throws InputError.
geometry::TriangleMesh read_mesh_glb(const std::filesystem::path& file);

}  // namespace tileflight::ground_truth
