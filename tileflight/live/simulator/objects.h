#pragma once

#include <array>
#include <string>
#include <vector>

#include "tileflight/live/simulator/airsim_types.h"

namespace tileflight::simulator {

struct World;

/// Objects of the scene: those of the tiles, which stay where they are, and those that clients spawn. Poses are global
/// NED. Tiles that are not in memory have no objects.
class Objects {
 public:
  explicit Objects(World& world) : world_(world) {}

  /// Returns the names that match a regular expression (NamePattern), sorted.
  std::vector<std::string> list_scene_objects(const std::string& name_regex);
  /// Returns the meshes of all tiles in memory. Throws InputError for more than 20 million vertices.
  std::vector<MeshPositionVertexBuffersResponse> get_mesh_position_vertex_buffers();
  /// Returns the pose of a vehicle or a spawned object, or the centre of a tile's object; NaN for an unknown name.
  Pose get_object_pose(const std::string& name);
  /// Moves a spawned object at once, with and without `teleport`. Returns false for other objects.
  bool set_object_pose(const std::string& name, const Pose& pose, bool teleport);
  /// Returns an object's scale; NaN for an unknown name.
  Vector3r get_object_scale(const std::string& name);
  /// Scales a spawned object. Returns false for other objects.
  bool set_object_scale(const std::string& name, const Vector3r& scale);
  /// Adds an object and returns its name, to which a number is added if it is taken. Throws InputError for an unknown
  /// asset, an unusable name or scale, or too many objects.
  std::string spawn_object(const std::string& name, const std::string& asset, const Pose& pose, const Vector3r& scale,
                           bool physics, bool is_blueprint);
  /// Removes a spawned object. Returns false for other objects.
  bool destroy_object(const std::string& name);
  /// Returns the names of what can be spawned, sorted.
  std::vector<std::string> list_assets() const;
  /// Returns the names as list_scene_objects(), each with an empty tag.
  std::vector<std::array<std::string, 2>> list_scene_objects_tags(const std::string& name_regex);

 private:
  World& world_;
};

}  // namespace tileflight::simulator
