#pragma once

#include <filesystem>

#include "tileflight/tiling/mesh_source.h"

namespace tileflight::tiling {

/// The surface of a PLY (ascii, binary of either byte order) in the file's own units and axes: faces of any number of
/// corners; colours of vertices; texture coordinates of vertices (s t, u v, texture_u texture_v) or of faces'
/// corners (texcoord, as MeshLab writes them, with texnumber) over the pictures that "comment TextureFile" names.
/// Throws InputError; points without faces are one.
MeshSource read_ply_meshes(const std::filesystem::path& file, bool textures);

}  // namespace tileflight::tiling
