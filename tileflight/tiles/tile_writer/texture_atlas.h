#pragma once

#include <vector>

#include "tileflight/core/imaging/textured_mesh.h"

namespace tileflight::tile_writer {

/// Merges the meshes into one with one texture: their images reduced by a factor of `2^halvings`, side by side with
/// repeated edges. Texture coordinates must lie in 0..1. Meshes without texture take their base colour. Empty if no
/// mesh has triangles.
imaging::TexturedMesh merge_into_atlas(const std::vector<const imaging::TexturedMesh*>& meshes, int halvings);

}  // namespace tileflight::tile_writer
