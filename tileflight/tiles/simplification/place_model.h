#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

#include "tileflight/core/imaging/textured_mesh.h"

namespace tileflight::simplification {

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

/// Simplifies the meshes (surface_simplification.h) and paints the result from their textures and colours
/// (painted_surface.h). The result does not depend on the number of threads. There must be a triangle.
PlaceModel make_place_model(const std::vector<imaging::TexturedMesh>& source, const PlaceModelOptions& options = {});

/// Reads the mesh.glb of a run's ground truth, or of some of its blocks, and makes a model of it. Throws InputError.
PlaceModel read_place_model(const std::vector<std::filesystem::path>& mesh_glbs, const PlaceModelOptions& options = {});

}  // namespace tileflight::simplification
