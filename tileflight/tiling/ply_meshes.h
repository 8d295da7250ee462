#pragma once

#include <filesystem>

#include "tileflight/tiling/mesh_source.h"

namespace tileflight::tiling {

/// Reads the surface of a PLY (ascii, binary of either byte order) in the file's units and axes: faces of any number of
/// corners; vertex colours; texture coordinates of vertices (s t, u v, texture_u texture_v) or of face corners
/// (texcoord, as written by MeshLab, with texnumber), for the images named by "comment TextureFile". Throws InputError,
/// also for points without faces.
MeshSource read_ply_meshes(const std::filesystem::path& file, bool textures);

}  // namespace tileflight::tiling
