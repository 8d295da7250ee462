#include "tileflight/live/simulator/resident_scene.h"

#include <algorithm>
#include <iterator>
#include <set>

#include "tileflight/live/simulator/object_names.h"
#include "tileflight/world/place/place_reader.h"

namespace tileflight::simulator {
namespace {

using imaging::TexturedMesh;

ResidentPart::FeatureBounds feature_bounds(const TexturedMesh& mesh) {
  ResidentPart::FeatureBounds bounds;
  std::uint32_t last = imaging::kNoFeature;
  geometry::Box3* box = nullptr;
  for (const geometry::Triangle& triangle : mesh.mesh.triangles) {
    const std::uint32_t feature = mesh.feature_ids.empty() ? imaging::kNoFeature : mesh.feature_ids[triangle[0]];
    if (box == nullptr || feature != last) box = &bounds[feature];
    last = feature;
    for (const std::uint32_t corner : triangle) box->extend(mesh.mesh.vertices[corner]);
  }
  return bounds;
}

using Parts = std::vector<std::shared_ptr<const ResidentPart>>;

Parts parts_of(const std::vector<ResidentTile>& tiles) {
  Parts parts;
  for (const ResidentTile& tile : tiles) {
    if (tile.part) parts.push_back(tile.part);
  }
  return parts;
}

bool has_meshes(const Parts& parts) {
  return std::ranges::any_of(parts, [](const auto& part) { return !part->scene()->meshes().empty(); });
}

/// The parts, or a placeholder that no ray hits if there is nothing to see.
Parts or_placeholder(const Parts& parts, const scene::SceneFrame& frame) {
  if (has_meshes(parts)) return parts;
  return {std::make_shared<const ResidentPart>(place::with_placeholder({}), frame)};
}

scene::Scene scene_of(const Parts& parts) {
  std::vector<std::shared_ptr<const scene::ScenePart>> all;
  for (const auto& part : parts) all.push_back(part->scene());
  return scene::Scene(std::move(all));
}

std::shared_ptr<const render::Appearance> appearance_of(const Parts& parts) {
  std::vector<std::shared_ptr<const render::PartAppearance>> all;
  for (const auto& part : parts) all.push_back(part->appearance());
  return std::make_shared<const render::Appearance>(std::move(all));
}

/// Bounds of each object.
std::vector<geometry::Box3> compute_object_bounds(const Parts& parts, const render::SceneObjects& objects) {
  std::vector<geometry::Box3> bounds(objects.all().size());
  std::uint32_t mesh = 0;
  for (const auto& part : parts) {
    for (const ResidentPart::FeatureBounds& of_mesh : part->bounds()) {
      for (const auto& [feature, box] : of_mesh) bounds[objects.index_of_feature(mesh, feature)].extend(box);
      ++mesh;
    }
  }
  return bounds;
}

}  // namespace

ResidentPart::ResidentPart(std::vector<TexturedMesh> meshes, const scene::SceneFrame& frame)
    : scene_(std::make_shared<const scene::ScenePart>(std::move(meshes), frame)),
      appearance_(std::make_shared<const render::PartAppearance>(scene_)) {
  scene_->build_beam_tree();
  appearance_->build_pyramids();
  for (const TexturedMesh& mesh : scene_->meshes()) bounds_.push_back(feature_bounds(mesh));
  bytes_ = resident_bytes(scene_->meshes());
}

ResidentScene::ResidentScene(std::vector<ResidentTile> tiles, const scene::SceneFrame& frame, LoadedRegion loaded)
    : ResidentScene(std::move(tiles), Parts{}, frame, std::move(loaded)) {}

ResidentScene::ResidentScene(std::vector<ResidentTile> tiles, std::shared_ptr<const ResidentPart> whole,
                             LoadedRegion loaded)
    : ResidentScene(std::move(tiles), Parts{whole}, whole->scene()->frame(), std::move(loaded)) {}

ResidentScene::ResidentScene(std::vector<ResidentTile> tiles, const Parts& whole, const scene::SceneFrame& frame,
                             LoadedRegion loaded)
    : tiles_(std::move(tiles)),
      scene_([&] {
        const Parts parts = whole.empty() ? parts_of(tiles_) : whole;
        has_surface_ = has_meshes(parts);
        return scene_of(parts_ = or_placeholder(parts, frame));
      }()),
      appearance_(appearance_of(parts_)),
      loaded_(std::move(loaded)) {
  auto labels = std::make_shared<Labels>(Labels{render::SceneObjects(scene_), {}, {}});
  object_bounds_ = compute_object_bounds(parts_, labels->objects);
  first_placed_object_ = static_cast<std::uint32_t>(object_bounds_.size());
  scene_.build_beam_tree();
  for (std::size_t tile = 0; tile < tiles_.size(); ++tile)
    tile_of_mesh_.insert(tile_of_mesh_.end(), tiles_[tile].mesh_count, static_cast<std::uint32_t>(tile));
  if (tiles_.empty()) tiles_.push_back({});
  tile_of_mesh_.resize(scene_.meshes().size(), 0);
  std::set<std::string> distinct;
  for (const render::SceneObject& object : labels->objects.all()) {
    labels->names.push_back(simulator::client_name(object));
    distinct.insert(labels->names.back());
  }
  if (has_surface_) labels->distinct.assign(distinct.begin(), distinct.end());
  labels_ = std::move(labels);
  loaded_.triangles = has_surface_ ? scene_.triangle_count() : 0;
}

std::shared_ptr<const ResidentScene::Labels> ResidentScene::labels_with(const Labels& place,
                                                                        const scene::Scene& scene) {
  auto labels = std::make_shared<Labels>(Labels{render::SceneObjects(place.objects, scene), place.names, {}});
  std::set<std::string> distinct(place.distinct.begin(), place.distinct.end());
  for (const scene::PlacedPart& placed : scene.placed()) {
    labels->names.push_back(placed.name);
    distinct.insert(placed.name);
  }
  labels->distinct.assign(distinct.begin(), distinct.end());
  return labels;
}

ResidentScene::ResidentScene(const ResidentScene& place, const std::vector<PlacedObject>& objects,
                             const ResidentScene* same)
    : tiles_(place.tiles_),
      tile_of_mesh_(place.tile_of_mesh_),
      has_surface_(place.has_surface_ || !objects.empty()),
      parts_(place.parts_),
      scene_([&] {
        std::vector<scene::PlacedPart> placed;
        for (const PlacedObject& object : objects) placed.push_back({object.name, object.part->scene(), {object.pose}});
        return scene::Scene(place.scene().parts(), std::move(placed));
      }()),
      first_placed_object_(static_cast<std::uint32_t>(place.object_names().size())),
      object_bounds_(place.object_bounds_),
      loaded_(place.loaded_) {
  scene_.build_beam_tree();
  tiles_.push_back({});  // of the objects
  tile_of_mesh_.resize(scene_.meshes().size(), static_cast<std::uint32_t>(tiles_.size() - 1));
  for (std::size_t i = 0; i < objects.size(); ++i) object_bounds_.push_back(scene_.placed_bounds(i));
  appearance_ = same != nullptr ? same->appearance_ : appearance_of([&] {
    Parts all = parts_;
    for (const PlacedObject& object : objects) all.push_back(object.part);
    return all;
  }());
  labels_ = same != nullptr ? same->labels_ : labels_with(*place.labels_, scene_);
}

std::optional<std::vector<TexturedMesh>> ResidentScene::copy_meshes(const TileKey& key) const {
  std::size_t first = 0;
  for (const ResidentTile& tile : tiles_) {
    if (tile.key == key) {
      const auto begin = std::next(scene_.meshes().begin(), static_cast<std::ptrdiff_t>(first));
      return std::vector<TexturedMesh>(begin, std::next(begin, static_cast<std::ptrdiff_t>(tile.mesh_count)));
    }
    first += tile.mesh_count;
  }
  return std::nullopt;
}

std::uintmax_t resident_bytes(const std::vector<TexturedMesh>& meshes) {
  constexpr std::uintmax_t kBeamTreeBytes = 100;  // per triangle
  constexpr std::uintmax_t kRayTreeBytes = 20;    // likewise; 110 where rays go
  constexpr std::uintmax_t kShadeBytes = 64;      // likewise, in render::PartAppearance
  std::set<const imaging::RgbImage*> textures;
  std::uintmax_t bytes = 0;
  for (const TexturedMesh& mesh : meshes) {
    bytes += imaging::vertex_bytes(mesh);
    bytes += mesh.mesh.triangles.size() * (sizeof(geometry::Triangle) + kBeamTreeBytes + kRayTreeBytes + kShadeBytes);
    for (const auto& image : {mesh.texture, mesh.opacity}) {
      if (image && textures.insert(image.get()).second)
        bytes += image->pixels.size() * sizeof(imaging::Rgb8) * 7 / 3;  // including its mipmaps
    }
  }
  return bytes;
}

}  // namespace tileflight::simulator
