#pragma once

#include <filesystem>

#include "tileflight/tiling/mesh_source.h"

namespace tileflight::tiling {

/// The surfaces of an OBJ with its material libraries and their pictures, in the file's own units and axes. A texture
/// hides Kd, as exporters mean it. Throws InputError; a library or picture that is missing is one.
MeshSource read_obj_meshes(const std::filesystem::path& file, bool textures);

}  // namespace tileflight::tiling
