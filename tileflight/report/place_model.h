#pragma once

#include <cstddef>
#include <filesystem>

#include "tileflight/imaging/textured_mesh.h"

namespace tileflight::report {

struct PlaceModelOptions {
  std::size_t triangles = 60000;  ///< at most about as many
  int sheet_px = 2048;            ///< longest side of the texture
};

/// A place at a level of detail that a page can hold: one mesh under one texture.
struct PlaceModel {
  imaging::TexturedMesh mesh;  ///< local frame, z up; texture coordinates in 0..1
  std::size_t source_triangles = 0;
};

/// Reads a run's truth/mesh.glb, simplifies it and paints the result from the source's textures and colours
/// (tiling/coarser_surface.h, tiling/painted_surface.h). The same file gives the same model for any number of threads.
/// Throws InputError.
PlaceModel read_place_model(const std::filesystem::path& mesh_glb, const PlaceModelOptions& options = {});

}  // namespace tileflight::report
