#pragma once

#include <tbb/task_arena.h>

#include <memory>
#include <mutex>
#include <optional>
#include <type_traits>
#include <vector>

#include "tileflight/core/imaging/textured_mesh.h"
#include "tileflight/world/scene/embree.h"

namespace tileflight::scene {

/// An object built on first use.
template <class Tree>
class LazyTree {
 public:
  template <class Build>
  const Tree& get(const Build& build) {
    std::call_once(once_, [&] { build_apart(build); });
    return *tree_;
  }

 private:
  /// Builds in an arena of its own, for two reasons. While this thread waits for parts of the tree, it must not pick up
  /// a task that needs the tree. And Embree's scene keeps a task group, whose context would be bound to that of the
  /// algorithm in which the tree happens to be built, and would refer to it after its end.
  template <class Build>
  void build_apart(const Build& build) {
    tbb::task_arena arena(tbb::this_task_arena::max_concurrency());
    arena.execute([&] { tree_.emplace(build()); });
  }

  std::once_flag once_;
  std::optional<Tree> tree_;
};

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
