#include "tileflight/simulator/resident_scene.h"

#include <algorithm>
#include <filesystem>
#include <set>
#include <utility>

#include "tileflight/place/require_surface.h"
#include "tileflight/tiles/cut_reader.h"

namespace tileflight::simulator {
namespace {

using imaging::TexturedMesh;

/// The name of an object for clients: the feature's own name, or its tile's file and its number in it.
std::string display_name(const render::SceneObject& object) {
  if (!object.name.empty()) return object.name;
  const std::string tile = object.tile.empty() ? "surface" : object.tile;
  return object.feature == imaging::kNoFeature ? tile : tile + "#" + std::to_string(object.feature);
}

std::vector<TexturedMesh> take_meshes(std::vector<ResidentTile>& tiles, std::vector<std::size_t>& first_mesh) {
  std::vector<TexturedMesh> all;
  for (ResidentTile& tile : tiles) {
    first_mesh.push_back(all.size());
    for (TexturedMesh& mesh : tile.meshes) all.push_back(std::move(mesh));
    tile.meshes.clear();
  }
  first_mesh.push_back(all.size());
  return all;
}

/// Bounds of each object.
std::vector<geometry::Box3> compute_object_bounds(const scene::Scene& scene, const render::SceneObjects& objects) {
  std::vector<geometry::Box3> bounds(objects.all().size());
  for (std::uint32_t m = 0; m < scene.meshes().size(); ++m) {
    const geometry::TriangleMesh& mesh = scene.meshes()[m].mesh;
    for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
      geometry::Box3& box = bounds[objects.index_of(m, t)];
      for (const std::uint32_t corner : mesh.triangles[t]) box.extend(mesh.vertices[corner]);
    }
  }
  return bounds;
}

}  // namespace

ResidentScene::ResidentScene(std::vector<ResidentTile> tiles, const geometry::Vec3& anchor, LoadedRegion loaded,
                             const ResidentScene* before)
    : tiles_(std::move(tiles)),
      scene_([&] {
        std::vector<TexturedMesh> meshes = take_meshes(tiles_, first_mesh_);
        has_surface_ = !meshes.empty();
        return scene::Scene(place::with_placeholder(std::move(meshes)), anchor);
      }()),
      appearance_(
          std::make_shared<const render::Appearance>(scene_, before != nullptr ? before->appearance_.get() : nullptr)),
      objects_(scene_),
      object_bounds_(compute_object_bounds(scene_, objects_)),
      loaded_(std::move(loaded)) {
  scene_.build_ray_tree();
  scene_.build_beam_tree();
  if (tiles_.empty()) tiles_.push_back({});
  tile_of_mesh_.resize(scene_.meshes().size(), 0);
  for (std::size_t tile = 0; tile + 1 < first_mesh_.size(); ++tile) {
    std::fill(tile_of_mesh_.begin() + static_cast<std::ptrdiff_t>(first_mesh_[tile]),
              tile_of_mesh_.begin() + static_cast<std::ptrdiff_t>(first_mesh_[tile + 1]),
              static_cast<std::uint32_t>(tile));
  }
  for (std::size_t tile = 0; tile < tiles_.size(); ++tile) tile_of_identity_.try_emplace(tiles_[tile].identity, tile);
  std::set<std::string> distinct;
  for (const render::SceneObject& object : objects_.all()) {
    object_names_.push_back(display_name(object));
    distinct.insert(object_names_.back());
  }
  if (has_surface_) distinct_names_.assign(distinct.begin(), distinct.end());
  loaded_.triangles = has_surface_ ? scene_.triangle_count() : 0;
}

const ResidentTile* ResidentScene::find(const std::string& identity) const {
  const auto at = tile_of_identity_.find(identity);
  return at == tile_of_identity_.end() ? nullptr : &tiles_[at->second];
}

std::vector<TexturedMesh> ResidentScene::copy_meshes(const ResidentTile& tile) const {
  const auto index = static_cast<std::size_t>(&tile - tiles_.data());
  const auto begin = scene_.meshes().begin();
  return {begin + static_cast<std::ptrdiff_t>(first_mesh_[index]),
          begin + static_cast<std::ptrdiff_t>(first_mesh_[index + 1])};
}

std::uintmax_t resident_bytes(const std::vector<TexturedMesh>& meshes) {
  constexpr std::uintmax_t kShadeBytes = 64;  // per triangle, in render::Appearance
  std::set<const imaging::RgbImage*> textures;
  std::uintmax_t bytes = 0;
  for (const TexturedMesh& mesh : meshes) {
    bytes += tiles::memory_bytes(mesh) + kShadeBytes * mesh.mesh.triangles.size();
    if (mesh.texture && textures.insert(mesh.texture.get()).second)
      bytes += mesh.texture->pixels.size() * sizeof(imaging::Rgb8) * 7 / 3;  // including its mipmaps
  }
  return bytes;
}

}  // namespace tileflight::simulator
