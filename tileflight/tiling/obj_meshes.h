#pragma once

#include <filesystem>

#include "tileflight/tiling/mesh_source.h"

namespace tileflight::tiling {

/// Reads the surfaces of an OBJ with its material libraries and textures, in the file's units and axes. A texture
/// replaces Kd, as exporters intend. Throws InputError, also for a missing library or texture.
MeshSource read_obj_meshes(const std::filesystem::path& file, bool textures);

}  // namespace tileflight::tiling
