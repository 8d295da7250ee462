#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "tileflight/world/scene/scene.h"

namespace tileflight::scoring {

/// A ground truth's surface, ready for ray casting and for renderings.
struct TexturedPlace {
  std::unique_ptr<scene::Scene> scene;
  bool textured = false;  ///< a mesh has colours to compare images with
};

/// Reads the mesh files of a ground truth (AlignTarget::mesh_files). A texture is decoded when a ray of an image first
/// meets it; without `with_textures` none is read. Throws InputError.
TexturedPlace read_textured_place(const std::vector<std::filesystem::path>& mesh_files, bool with_textures);

}  // namespace tileflight::scoring
