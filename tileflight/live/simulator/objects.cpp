#include "tileflight/live/simulator/objects.h"

#include <algorithm>
#include <limits>

#include "tileflight/core/base/input_error.h"
#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/object_names.h"
#include "tileflight/live/simulator/world.h"

namespace tileflight::simulator {
namespace {

using geometry::Box3;
using geometry::SE3;
using geometry::Vec3;

constexpr std::size_t kMaxMeshVertices = 20'000'000;
constexpr float kCentimetres = 100.0F;
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

/// Centre of the bounds of the objects with this name, local frame.
std::optional<Vec3> find_object_center(const ResidentScene& place, const std::string& name) {
  if (!place.has_surface() || !std::ranges::binary_search(place.distinct_names(), name)) return std::nullopt;
  Box3 box;
  for (std::size_t i = 0; i < place.object_names().size(); ++i) {
    if (place.object_names()[i] == name) box.extend(place.object_bounds()[i]);
  }
  return box.center();
}

/// A mesh in Unreal's convention: centimetres, x north, y east, z up (left-handed), so the triangles' orientation is
/// reversed.
MeshPositionVertexBuffersResponse make_vertex_buffers(const imaging::TexturedMesh& mesh, const SE3& T_ned_local) {
  MeshPositionVertexBuffersResponse buffers;
  buffers.name = tile_name(mesh.name);
  for (const Vec3& vertex : mesh.mesh.vertices) {
    const Vector3r ned = to_airsim(T_ned_local * vertex);
    buffers.vertices.insert(buffers.vertices.end(),
                            {kCentimetres * ned.x_val, kCentimetres * ned.y_val, -kCentimetres * ned.z_val});
  }
  for (const geometry::Triangle& t : mesh.mesh.triangles)
    buffers.indices.insert(buffers.indices.end(), t.begin(), t.end());
  return buffers;
}

}  // namespace

std::vector<std::string> Objects::list_scene_objects(const std::string& name_regex) {
  const NamePattern pattern(name_regex, NamePattern::Case::kHeeded);
  std::vector<std::string> names = world_.place_now()->distinct_names();
  std::erase_if(names, [&](const std::string& name) { return !pattern.matches(name); });
  return names;
}

std::vector<MeshPositionVertexBuffersResponse> Objects::get_mesh_position_vertex_buffers() {
  const auto place = world_.working_set.current();  // of the tiles
  std::size_t vertices = 0;
  for (const imaging::TexturedMesh& mesh : place->scene().meshes()) vertices += mesh.mesh.vertices.size();
  if (vertices > kMaxMeshVertices)
    throw InputError("simGetMeshPositionVertexBuffers",
                     "more than 20 million vertices; use tfGroundTruth for a region");
  std::vector<MeshPositionVertexBuffersResponse> all;
  if (!place->has_surface()) return all;
  for (const imaging::TexturedMesh& mesh : place->scene().meshes())
    all.push_back(make_vertex_buffers(mesh, world_.T_local_ned.inverse()));
  return all;
}

Pose Objects::get_object_pose(const std::string& name) {
  {
    const std::lock_guard lock(world_.state_mutex);
    for (const auto& one : world_.vehicles) {
      if (one->vehicle->name() == name) return to_airsim(one->vehicle->state().T_ned_body);
    }
  }
  if (const auto object = world_.world_objects.find(name)) return to_airsim(object->T_ned_object);
  const auto middle = find_object_center(*world_.working_set.current(), name);
  if (!middle) return {{kNaN, kNaN, kNaN}, {kNaN, kNaN, kNaN, kNaN}};
  return to_airsim(SE3(Eigen::Quaterniond::Identity(), world_.T_local_ned.inverse() * *middle));
}

bool Objects::set_object_pose(const std::string& name, const Pose& pose, bool /*teleport*/) {
  const auto object = world_.world_objects.find(name);
  if (!object) return false;  // AirSim's answer for objects that cannot be moved
  const SE3 target = merge_pose(pose, object->T_ned_object, "simSetObjectPose");
  if (!world_.world_objects.move(name, target)) return false;
  world_.update_obstacles();
  return true;
}

Vector3r Objects::get_object_scale(const std::string& name) {
  if (const auto object = world_.world_objects.find(name)) return to_airsim(object->scale);
  return find_object_center(*world_.working_set.current(), name) ? Vector3r{1.0F, 1.0F, 1.0F}
                                                                 : Vector3r{kNaN, kNaN, kNaN};
}

bool Objects::set_object_scale(const std::string& name, const Vector3r& scale) {
  if (!world_.world_objects.rescale(name, to_vec3(scale))) return false;
  world_.update_obstacles();
  return true;
}

std::string Objects::spawn_object(const std::string& name, const std::string& asset, const Pose& pose,
                                  const Vector3r& scale, bool /*physics*/, bool /*is_blueprint*/) {
  const SE3 target = merge_pose(pose, SE3(), "simSpawnObject");
  const std::string spawned =
      world_.world_objects.spawn(name, asset, target, to_vec3(scale), world_.working_set.current()->distinct_names());
  world_.update_obstacles();
  return spawned;
}

bool Objects::destroy_object(const std::string& name) {
  if (!world_.world_objects.destroy(name)) return false;
  world_.update_obstacles();
  return true;
}

std::vector<std::string> Objects::list_assets() const { return world_.world_objects.assets(); }

std::vector<std::array<std::string, 2>> Objects::list_scene_objects_tags(const std::string& name_regex) {
  std::vector<std::array<std::string, 2>> tags;
  for (std::string& name : list_scene_objects(name_regex)) tags.push_back({std::move(name), std::string()});
  return tags;
}

}  // namespace tileflight::simulator
