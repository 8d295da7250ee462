#pragma once

#include <embree3/rtcore.h>

#include <cstdint>
#include <memory>
#include <span>
#include <type_traits>
#include <vector>

#include "tileflight/imaging/textured_mesh.h"
#include "tileflight/scene/embree_tree.h"
#include "tileflight/scene/packets.h"

namespace tileflight::scene {

/// Up to eight triangles abreast; places from `count` on hold the last one again.
struct alignas(64) BeamLeaf {
  float corner[3][3][8];  ///< [corner][axis][place], metres relative to the anchor
  std::uint32_t mesh[8];
  std::uint32_t triangle[8];  ///< index into the mesh's triangles
  std::uint32_t count;
};

/// Up to eight children and their boxes abreast.
struct alignas(64) BeamNode {
  /// A BeamNode, or a BeamLeaf where the lowest bit is set.
  using Child = std::uintptr_t;

  float low[3][8], high[3][8];  ///< [axis][child], metres relative to the anchor; inside out where there is no child
  Child child[8];
};

struct ReleaseBvh {
  void operator()(RTCBVH bvh) const { rtcReleaseBVH(bvh); }
};

/// A tree of boxes over the triangles of a list of meshes, for beams: up to 64 rays that start in one point and stay
/// close together, as a block of a camera's pixels does. The tree is walked once for all of them with the pyramid that
/// holds them, and each triangle that is met is tested against eight rays at a time by its three edge functions
/// (Davidovic et al. 2012, "3D Rasterization: A Bridge between Rasterization and Ray Casting"). Embree's builder
/// (surface area heuristic) makes the splits.
class BeamTree {
 public:
  /// Throws std::runtime_error when there is no memory for it. Nothing of `meshes` is kept.
  BeamTree(const std::vector<imaging::TexturedMesh>& meshes, const geometry::Vec3& anchor);

  /// Scene::intersect for beams, but returns false, without having done anything, where the rays spread too far (some
  /// 60 degrees from their mean): cast them one by one.
  bool intersect(std::span<RayPacket8> beam) const;

 private:
  DeviceHandle device_;
  std::unique_ptr<std::remove_pointer_t<RTCBVH>, ReleaseBvh> memory_;  ///< of nodes and leaves
  BeamNode::Child root_ = 0;
  float reach_m_ = 0.0F;  ///< largest coordinate of a corner
};

}  // namespace tileflight::scene
