#pragma once

#include <cstdint>

#include "tileflight/core/imaging/textured_mesh.h"

namespace tileflight::render {

/// Memory of a mesh's arrays, without its texture.
std::uintmax_t decoded_bytes(const imaging::TexturedMesh& mesh);

/// Memory of a mesh in a scene that is rendered: its data, both of the scene's trees over it and its shading
/// (Appearance), without its texture.
std::uintmax_t rendered_bytes(const imaging::TexturedMesh& mesh);

/// Memory of a texture in a scene that is rendered: with its coarser levels and, for an atlas, a copy with its padding
/// overwritten.
std::uintmax_t rendered_bytes(const imaging::RgbImage& texture);

}  // namespace tileflight::render
