#pragma once

#include <string>
#include <vector>

#include "tileflight/core/imaging/textured_mesh.h"

namespace tileflight::imaging {

/// Options for writing a binary glTF.
struct GlbOptions {
  int jpeg_quality = 85;
  std::string copyright;  ///< glTF asset.copyright: the attribution shown by viewers
  /// Compresses geometry by EXT_meshopt_compression, without loss. Vertices and triangles are put in an order that
  /// suits it, and a triangle may start at another of its corners.
  bool meshopt = false;
};

/// Returns textured meshes as a binary glTF 2.0, one primitive each, unlit (KHR_materials_unlit), with JPEG textures.
/// Input positions are z up, metres; they are written y up (as 3D Tiles requires) in floats relative to a node at
/// integer metres near their centre, so that coordinates of hundreds of metres keep micrometre precision. Texture
/// coordinates are 16-bit normalised and must lie in 0..1; vertex colours are 8-bit RGBA. Meshes without triangles are
/// left out.
std::string write_glb(const std::vector<TexturedMesh>& meshes, const GlbOptions& options);

}  // namespace tileflight::imaging
