#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

#include "tileflight/imaging/textured_mesh.h"

namespace tileflight::report {

/// Size limits of a PlaceModel.
struct PlaceModelOptions {
  std::size_t max_triangles = 60000;  ///< approximate upper limit
  int texture_px = 2048;              ///< longest side of the texture
};

/// A simplified model of a place that is small enough for a page: one mesh with one texture.
struct PlaceModel {
  imaging::TexturedMesh mesh;  ///< local frame, z up; texture coordinates in 0..1
  std::size_t source_triangles = 0;
};

/// Reads the mesh.glb of a run's truth, or of some of its blocks, simplifies it and paints the result from the source's
/// textures and colours (simplification/surface_simplification.h, tiling/painted_surface.h). Deterministic for any
/// number of threads. Throws InputError.
PlaceModel read_place_model(const std::vector<std::filesystem::path>& mesh_glbs, const PlaceModelOptions& options = {});

}  // namespace tileflight::report
