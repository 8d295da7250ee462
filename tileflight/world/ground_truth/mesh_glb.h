#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/core/imaging/textured_mesh.h"

namespace tileflight::ground_truth {

/// Places of a cut mesh's triangles in the whole mesh, so that parts can be put together again in the order of the
/// whole.
struct MeshOrigin {
  std::uint32_t content = 0;             ///< number of the content that holds the whole mesh
  std::uint32_t first = 0;               ///< number of the whole mesh's first triangle in the content
  std::vector<std::uint32_t> triangles;  ///< number of each kept triangle in the whole mesh
};

/// Writes all triangles as binary glTF 2.0. glTF is y-up: a root node maps the local frame (x east, y north, z up) to
/// (x, z, -y). Each mesh is a child node whose translation, in double, is the centre of its bounds, or its entry of
/// `centers` if that is not empty. Positions are floats relative to it, which keeps sub-millimetre precision anywhere.
/// Textures are embedded as JPEG, unlit (KHR_materials_unlit), and omitted if `textures` is false. `origins`: one for
/// each mesh, stored with it; empty: none. Takes little memory beside the compressed textures. Throws InputError if the
/// file would exceed GLB's limit of 4 GiB.
void write_mesh_glb(const std::filesystem::path& file, const std::vector<imaging::TexturedMesh>& meshes, bool textures,
                    const Progress& progress = {}, const std::vector<geometry::Vec3>& centers = {},
                    const std::vector<MeshOrigin>& origins = {});

/// Triangles with their numbers in the order of the whole mesh that they are a part of.
struct NumberedMesh {
  geometry::TriangleMesh mesh;
  std::vector<std::uint64_t> numbers;  ///< from stored origins, or else the order in the file
};

/// Reads all triangles of a GLB file into the z-up frame, with node transforms applied in double. Throws InputError.
NumberedMesh read_numbered_mesh_glb(const std::filesystem::path& file);

/// Reads all triangles of a GLB file like read_numbered_mesh_glb(), without their numbers.
geometry::TriangleMesh read_mesh_glb(const std::filesystem::path& file);

/// Reads the bounds of the vertices from the head of a file that write_mesh_glb() wrote. They equal those of the mesh.
/// Throws InputError.
geometry::Box3 read_mesh_glb_bounds(const std::filesystem::path& file);

}  // namespace tileflight::ground_truth
