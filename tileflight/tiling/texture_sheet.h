#pragma once

#include <vector>

#include "tileflight/imaging/textured_mesh.h"

namespace tileflight::tiling {

/// The meshes as one with one texture: their images `2^halvings` times smaller, side by side with repeated edges.
/// Texture coordinates must lie in 0..1. Meshes without texture take their base colour. Empty if no mesh has triangles.
imaging::TexturedMesh on_one_sheet(const std::vector<const imaging::TexturedMesh*>& meshes, int halvings);

}  // namespace tileflight::tiling
