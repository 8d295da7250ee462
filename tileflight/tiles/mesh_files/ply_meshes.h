#pragma once

#include <filesystem>

#include "tileflight/tiles/mesh_files/mesh_source.h"
#include "tileflight/tiles/mesh_files/mesh_spill.h"

namespace tileflight::mesh_files {

/// Reads the surface of a PLY (ascii, binary of either byte order) in the file's units and axes: faces of any number of
/// corners; vertex colours; texture coordinates of vertices (s t, u v, texture_u texture_v) or of face corners
/// (texcoord, as written by MeshLab, with texnumber), for the images named by "comment TextureFile". Throws InputError,
/// also for points without faces.
MeshSource read_ply_meshes(const std::filesystem::path& file, bool textures);

/// Reads a PLY like read_ply_meshes(), but writes surfaces and textures into `spill`, for a mesh that does not fit into
/// memory. Throws InputError.
void spill_ply_meshes(const std::filesystem::path& file, bool textures, MeshSpill& spill);

/// Returns the image files that a PLY refers to and that exist.
std::vector<std::filesystem::path> ply_image_files(const std::filesystem::path& file);

}  // namespace tileflight::mesh_files
