#pragma once

#include <filesystem>

#include "tileflight/tiles/mesh_files/mesh_source.h"
#include "tileflight/tiles/mesh_files/mesh_spill.h"

namespace tileflight::mesh_files {

/// Reads the surfaces of an OBJ with its material libraries and textures, in the file's units and axes. A texture
/// replaces Kd, as exporters intend. Throws InputError, also for a missing library or texture.
MeshSource read_obj_meshes(const std::filesystem::path& file, bool textures);

/// Reads an OBJ like read_obj_meshes(), but writes surfaces and textures into `spill`, for a mesh that does not fit
/// into memory. Throws InputError.
void spill_obj_meshes(const std::filesystem::path& file, bool textures, MeshSpill& spill);

/// Returns the image files that an OBJ refers to and that exist, without reading its surface.
std::vector<std::filesystem::path> obj_image_files(const std::filesystem::path& file);

}  // namespace tileflight::mesh_files
