#include "tileflight/evaluation/scoring/textured_place.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "tileflight/tiles/mesh_files/mesh_source.h"

namespace tileflight::scoring {

TexturedPlace read_textured_place(const std::vector<std::filesystem::path>& mesh_files, bool with_textures) {
  std::vector<imaging::TexturedMesh> meshes;
  const mesh_files::MeshSourceOptions options{.textures = with_textures, .defer_textures = true};
  for (const std::filesystem::path& file : mesh_files) {
    auto part = mesh_files::read_mesh_source(file, options).meshes;
    std::move(part.begin(), part.end(), std::back_inserter(meshes));
  }
  TexturedPlace place;
  place.textured = std::ranges::any_of(meshes, [](const auto& mesh) { return mesh.texture || !mesh.colors.empty(); });
  place.scene = std::make_unique<scene::Scene>(std::move(meshes));
  place.scene->build_ray_tree();
  return place;
}

}  // namespace tileflight::scoring
