#pragma once

#include <filesystem>

#include "tileflight/tiles/mesh_files/mesh_source.h"
#include "tileflight/tiles/mesh_files/mesh_spill.h"

namespace tileflight::mesh_files {

/// Reads the surfaces of an OBJ with its material libraries and textures, in the file's units and axes. A texture
/// replaces Kd, as exporters intend. Throws InputError, also for a missing library or texture.
MeshSource read_obj_meshes(const std::filesystem::path& file, bool textures);

/// The same for a mesh that does not fit into memory: surfaces and textures go into `spill`. Throws as
/// read_obj_meshes().
void spill_obj_meshes(const std::filesystem::path& file, bool textures, MeshSpill& spill);

/// The image files that an OBJ refers to as far as they exist, without reading its surface.
std::vector<std::filesystem::path> obj_image_files(const std::filesystem::path& file);

}  // namespace tileflight::mesh_files
