#pragma once

#include <embree3/rtcore.h>

#include <memory>
#include <type_traits>
#include <vector>

#include "tileflight/core/imaging/textured_mesh.h"

namespace tileflight::scene {

struct ReleaseScene {
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};
using DeviceHandle = std::shared_ptr<std::remove_pointer_t<RTCDevice>>;
using SceneHandle = std::unique_ptr<std::remove_pointer_t<RTCScene>, ReleaseScene>;

/// Embree's state, which several trees may share. Throws std::runtime_error.
DeviceHandle new_device();

/// Embree's objects for a list of meshes: geometry i is mesh i; positions are floats relative to the anchor.
struct EmbreeTree {
  DeviceHandle device;
  SceneHandle scene;
};

/// Builds the tree. Embree shares the meshes' triangle arrays, so `meshes` must outlive it and must not move. Throws
/// std::runtime_error if Embree fails (out of memory).
EmbreeTree build_embree_tree(const std::vector<imaging::TexturedMesh>& meshes, const geometry::Vec3& anchor,
                             DeviceHandle device);

}  // namespace tileflight::scene
