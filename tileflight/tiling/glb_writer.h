#pragma once

#include <string>
#include <vector>

#include "tileflight/imaging/textured_mesh.h"

namespace tileflight::tiling {

struct GlbOptions {
  int jpeg_quality = 85;
  std::string copyright;  ///< glTF asset.copyright: the attribution that viewers show
};

/// One binary glTF 2.0 of textured meshes, each a primitive, unlit (KHR_materials_unlit), textures as JPEG. Positions
/// are given z up, metres; they are written y up (as 3D Tiles wants of glTF) in floats relative to a node at whole
/// metres near their middle, so that coordinates of hundreds of metres keep their micrometres. Texture coordinates are
/// 16-bit normalised: they must lie in 0..1; vertex colours are 8-bit RGBA. Meshes without triangles are left out.
std::string write_glb(const std::vector<imaging::TexturedMesh>& meshes, const GlbOptions& options);

}  // namespace tileflight::tiling
