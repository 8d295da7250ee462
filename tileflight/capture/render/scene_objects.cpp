#include "tileflight/capture/render/scene_objects.h"

#include <algorithm>
#include <map>
#include <set>
#include <tuple>

namespace tileflight::render {
namespace {

using imaging::kNoFeature;
using imaging::TexturedMesh;

std::set<std::uint32_t> features_of(const TexturedMesh& mesh) {
  std::set<std::uint32_t> features;
  if (mesh.feature_ids.empty()) return {kNoFeature};
  for (const geometry::Triangle& t : mesh.mesh.triangles) features.insert(mesh.feature_ids[t[0]]);
  return features;
}

/// Empty for an unnamed feature, whose name would only be its number.
std::string name_of(const TexturedMesh& mesh, std::uint32_t feature) {
  if (!mesh.features || feature == kNoFeature) return {};
  const std::string name = mesh.features->name(feature);
  return name == std::to_string(feature) ? std::string() : name;
}

/// Number of meshes of a tile, and the first mesh that uses each feature table.
struct TileTables {
  std::uint32_t meshes = 0;
  std::map<const imaging::FeatureTable*, std::uint32_t> first_mesh;
};

}  // namespace

SceneObjects::SceneObjects(const scene::Scene& scene) {
  std::map<std::string, TileTables> tiles;
  std::map<std::tuple<std::string, std::uint32_t, std::uint32_t>, std::uint32_t> known;
  for (std::uint32_t m = 0; m < scene.first_placed_mesh(); ++m) {
    const TexturedMesh& mesh = scene.meshes()[m];
    TileTables& tile = tiles[mesh.name];
    const std::uint32_t table = tile.first_mesh.try_emplace(mesh.features.get(), tile.meshes).first->second;
    ++tile.meshes;
    MeshObjects& own = meshes_.emplace_back();
    own.mesh = &mesh;
    for (const std::uint32_t feature : features_of(mesh)) {
      SceneObject object{mesh.name, feature == kNoFeature ? 0 : table, feature, name_of(mesh, feature)};
      const auto [at, is_new] =
          known.try_emplace({object.tile, object.mesh, object.feature}, static_cast<std::uint32_t>(objects_.size()));
      if (is_new) objects_.push_back(std::move(object));
      if (feature == kNoFeature) own.tile_object = at->second;
      own.features.emplace_back(feature, at->second);
    }
  }
  add_placed(scene);
}

SceneObjects::SceneObjects(SceneObjects without_placed, const scene::Scene& scene)
    : objects_(std::move(without_placed.objects_)), meshes_(std::move(without_placed.meshes_)) {
  add_placed(scene);
}

void SceneObjects::add_placed(const scene::Scene& scene) {
  for (const scene::PlacedPart& placed : scene.placed()) {
    const auto object = static_cast<std::uint32_t>(objects_.size());
    objects_.push_back({.tile = placed.name, .feature = kNoFeature, .is_placed = true});
    for (const TexturedMesh& mesh : placed.part->meshes())
      meshes_.push_back({&mesh, object, {NumberedFeature{kNoFeature, object}}, true});
  }
}

std::uint32_t SceneObjects::index_of(std::uint32_t mesh, std::uint32_t triangle) const {
  const MeshObjects& own = meshes_[mesh];
  if (own.is_placed || own.mesh->feature_ids.empty()) return own.tile_object;
  return index_of_feature(mesh, own.mesh->feature_ids[own.mesh->mesh.triangles[triangle][0]]);
}

std::uint32_t SceneObjects::index_of_feature(std::uint32_t mesh, std::uint32_t feature) const {
  const std::vector<NumberedFeature>& features = meshes_[mesh].features;
  return std::lower_bound(features.begin(), features.end(), NumberedFeature{feature, 0})->second;
}

}  // namespace tileflight::render
