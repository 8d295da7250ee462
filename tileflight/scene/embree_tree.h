#pragma once

#include <embree3/rtcore.h>

#include <memory>
#include <type_traits>
#include <vector>

#include "tileflight/imaging/textured_mesh.h"

namespace tileflight::scene {

struct ReleaseDevice {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};
struct ReleaseScene {
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};
using DeviceHandle = std::unique_ptr<std::remove_pointer_t<RTCDevice>, ReleaseDevice>;
using SceneHandle = std::unique_ptr<std::remove_pointer_t<RTCScene>, ReleaseScene>;

/// Embree's objects for a list of meshes: geometry i is mesh i; positions are floats relative to the anchor.
struct EmbreeTree {
  DeviceHandle device;
  SceneHandle scene;
};

/// Builds the tree. Embree shares the meshes' triangle arrays, so `meshes` must outlive it and must not move. Throws
/// std::runtime_error if Embree fails (out of memory).
EmbreeTree build_embree_tree(const std::vector<imaging::TexturedMesh>& meshes, const geometry::Vec3& anchor);

}  // namespace tileflight::scene
