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

  std::vector<std::string> list_scene_objects(const std::string& name_regex);
  std::vector<MeshPositionVertexBuffersResponse> get_mesh_position_vertex_buffers();
  Pose get_object_pose(const std::string& name);
  /// Of objects that clients spawned; false for others. Objects are moved at once, with and without `teleport`.
  bool set_object_pose(const std::string& name, const Pose& pose, bool teleport);
  Vector3r get_object_scale(const std::string& name);
  bool set_object_scale(const std::string& name, const Vector3r& scale);
  std::string spawn_object(const std::string& name, const std::string& asset, const Pose& pose, const Vector3r& scale,
                           bool physics, bool is_blueprint);
  bool destroy_object(const std::string& name);
  std::vector<std::string> list_assets() const;
  std::vector<std::array<std::string, 2>> list_scene_objects_tags(const std::string& name_regex);  ///< without tags

 private:
  World& world_;
};

}  // namespace tileflight::simulator
