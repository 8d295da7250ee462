#include "tileflight/live/simulator/world_objects.h"

#include <algorithm>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/live/simulator/frames.h"
#include "tileflight/tiles/mesh_files/mesh_source.h"
#include "tileflight/world/scene/models.h"

namespace tileflight::simulator {
namespace {

using geometry::SE3;
using geometry::Vec3;

constexpr std::size_t kMaxObjectName = 100;
constexpr double kMaxScale = 1e4, kMinScale = 1e-4;

/// Assets that are built in: the names of AirSim's shapes, which its scripts use, and ours.
const std::map<std::string, scene::Model>& built_in_assets() {
  using scene::Model;
  static const std::map<std::string, Model> kAssets{{"1M_Cube", Model::kBox},       {"1M_Cube_Chamfer", Model::kBox},
                                                    {"Cube", Model::kBox},          {"Sphere", Model::kSphere},
                                                    {"Cylinder", Model::kCylinder}, {"Cone", Model::kCone},
                                                    {"Car", Model::kCar},           {"Van", Model::kVan},
                                                    {"Person", Model::kPerson}};
  return kAssets;
}

void check_name(const std::string& name, const char* what) {
  const auto is_control = [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7F; };
  if (name.empty() || name.size() > kMaxObjectName || std::ranges::any_of(name, is_control))
    throw InputError(what, "a name needs 1 to 100 characters, none of them a control character");
}

void check_scale(const Vec3& scale, const char* what) {
  if (!scale.allFinite() || scale.minCoeff() < kMinScale || scale.maxCoeff() > kMaxScale)
    throw InputError(what, "scales must be from 0.0001 to 10000 (mirrored objects are not shown)");
}

/// Turned so that a model's front, which is glTF's +Z (-y after z points up), is x.
std::vector<imaging::TexturedMesh> read_asset(const std::filesystem::path& file) {
  const std::string ending = base::to_lower(file.extension().string());
  std::vector<imaging::TexturedMesh> meshes = mesh_files::read_mesh_source(file, {}).meshes;
  if (ending != ".glb" && ending != ".gltf") return meshes;
  for (imaging::TexturedMesh& mesh : meshes) {
    for (Vec3& vertex : mesh.mesh.vertices) vertex = Vec3(-vertex.y(), vertex.x(), vertex.z());
  }
  return meshes;
}

bool contains_ignoring_case(const std::string& text, const std::string& part) {
  return base::to_lower(text).find(base::to_lower(part)) != std::string::npos;
}

/// The number at a name's end; 0: none, or one that is too large to count on.
int number_at_end(const std::string& name) {
  const std::string digits = name.substr(name.find_last_not_of("0123456789") + 1);
  return digits.empty() || digits.size() > 8 ? 0 : std::stoi(digits);
}

/// AirSim's rule: where other names contain this one, it gets a number above all of theirs.
std::string unused_name(const std::string& name, const std::vector<std::string>& known) {
  int greatest = -1;
  for (const std::string& other : known) {
    if (contains_ignoring_case(other, name)) greatest = std::max(greatest, number_at_end(other));
  }
  return greatest < 0 ? name : name + std::to_string(greatest + 1);
}

}  // namespace

Eigen::Affine3d local_pose(const WorldObject& object, const SE3& T_local_ned) {
  return scene::placed_at(T_local_ned * object.T_ned_object * T_flu_frd(), object.scale);
}

WorldObjects::WorldObjects(const AssetFiles& files) : frame_(Vec3::Zero()) {
  for (const auto& [name, model] : built_in_assets()) parts_[name] = nullptr;
  for (const auto& [name, file] : files) {
    check_name(name, "asset");
    parts_[name] = std::make_shared<const ResidentPart>(read_asset(file), frame_);
  }
}

std::vector<std::string> WorldObjects::assets() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::string> names;
  for (const auto& [name, part] : parts_) names.push_back(name);
  return names;
}

ObjectList WorldObjects::now() const {
  const std::lock_guard lock(mutex_);
  return objects_;
}

std::optional<WorldObject> WorldObjects::find(const std::string& name) const {
  const ObjectList all = now();
  const auto at = std::ranges::find(*all, name, &WorldObject::name);
  return at == all->end() ? std::nullopt : std::optional(*at);
}

std::string WorldObjects::spawn(const std::string& name, const std::string& asset, const SE3& T_ned_object,
                                const Vec3& scale, const std::vector<std::string>& of_tiles) {
  check_name(name, "simSpawnObject");
  check_scale(scale, "simSpawnObject");
  const std::lock_guard lock(mutex_);
  const auto at = parts_.find(asset);
  if (at == parts_.end()) {
    throw InputError("simSpawnObject", "There were no objects with name " + asset.substr(0, kMaxObjectName) +
                                           " found in the Registry; simListAssets lists them");
  }
  if (objects_->size() >= kMaxObjects)
    throw InputError("simSpawnObject", "there are " + std::to_string(kMaxObjects) + " objects already");
  if (!at->second) {
    at->second = std::make_shared<const ResidentPart>(
        std::vector<imaging::TexturedMesh>{scene::make_model(built_in_assets().at(asset))}, frame_);
  }
  std::vector<std::string> known = of_tiles;
  for (const WorldObject& object : *objects_) known.push_back(object.name);
  auto next = std::make_shared<std::vector<WorldObject>>(*objects_);
  next->push_back({unused_name(name, known), asset, at->second, T_ned_object, scale});
  objects_ = next;
  return next->back().name;
}

template <class Change>
bool WorldObjects::change(const std::string& name, const Change& change) {
  const std::lock_guard lock(mutex_);
  auto next = std::make_shared<std::vector<WorldObject>>(*objects_);
  const auto at = std::ranges::find(*next, name, &WorldObject::name);
  if (at == next->end()) return false;
  change(*next, at);
  objects_ = next;
  return true;
}

bool WorldObjects::destroy(const std::string& name) {
  return change(name, [](auto& all, auto at) { all.erase(at); });
}

bool WorldObjects::move(const std::string& name, const SE3& T_ned_object) {
  return change(name, [&](auto&, auto at) { at->T_ned_object = T_ned_object; });
}

bool WorldObjects::rescale(const std::string& name, const Vec3& scale) {
  check_scale(scale, "simSetObjectScale");
  return change(name, [&](auto&, auto at) { at->scale = scale; });
}

std::shared_ptr<const ResidentScene> WorldObjects::populate(const std::shared_ptr<const ResidentScene>& place,
                                                            const ObjectList& objects, const SE3& T_local_ned) {
  if (objects->empty()) return place;
  Populated before;
  {
    const std::lock_guard lock(mutex_);
    if (latest_.place == place && latest_.objects == objects) return latest_.result;
    before = latest_;
  }
  std::vector<PlacedObject> placed;
  for (const WorldObject& object : *objects)
    placed.push_back({object.name, object.part, local_pose(object, T_local_ned)});
  // Where objects have only moved, names and appearances stay.
  const bool has_same =
      before.place == place && std::ranges::equal(*before.objects, *objects, [](const auto& a, const auto& b) {
        return a.name == b.name && a.part == b.part;
      });
  auto result = std::make_shared<const ResidentScene>(*place, placed, has_same ? before.result.get() : nullptr);
  const std::lock_guard lock(mutex_);
  latest_ = {place, result, objects};
  return result;
}

}  // namespace tileflight::simulator
