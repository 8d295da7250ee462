#pragma once

#include <filesystem>
#include <vector>

#include "tileflight/base/progress.h"
#include "tileflight/imaging/textured_mesh.h"

namespace tileflight::ground_truth {

/// Writes all triangles as binary glTF 2.0. glTF is y-up: a root node maps the local frame (x east, y north, z up) to
/// (x, z, -y). Each mesh is a child node whose translation, in double, is the centre of its bounds (or that
/// of `centers`, one a mesh), and whose positions are floats relative to it, which keeps sub-millimetre precision
/// anywhere. Textures are embedded as JPEG, unlit
/// (KHR_materials_unlit), and omitted if `textures` is false. Throws InputError if the file would exceed GLB's limit of
/// 4 GiB.
void write_mesh_glb(const std::filesystem::path& file, const std::vector<imaging::TexturedMesh>& meshes, bool textures,
                    const Progress& progress = {}, const std::vector<geometry::Vec3>& centers = {});

/// Reads all triangles of a GLB file into the z-up frame, with node transforms applied in double. Throws InputError.
geometry::TriangleMesh read_mesh_glb(const std::filesystem::path& file);

}  // namespace tileflight::ground_truth
