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

/// Up to eight triangles, stored for SIMD tests; places from `count` on repeat the last one.
struct alignas(64) BeamLeaf {
  float corner[3][3][8];  ///< [corner][axis][place], metres relative to the anchor
  std::uint32_t mesh[8];
  std::uint32_t triangle[8];  ///< index into the mesh's triangles
  std::uint32_t count;
};

/// Up to eight children and their boxes, stored for SIMD tests.
struct alignas(64) BeamNode {
  /// A BeamNode, or a BeamLeaf if the lowest bit is set.
  using Child = std::uintptr_t;

  float low[3][8], high[3][8];  ///< [axis][child], metres relative to the anchor; low > high for missing children
  Child child[8];
};

struct ReleaseBvh {
  void operator()(RTCBVH bvh) const { rtcReleaseBVH(bvh); }
};

/// A bounding volume hierarchy over the triangles of a list of meshes, for beams: up to 64 rays with a common origin
/// and similar directions, such as a block of a camera's pixels. The tree is traversed once per beam with its enclosing
/// pyramid, and each candidate triangle is tested against eight rays at a time by its three edge functions (Davidovic
/// et al. 2012, "3D Rasterization: A Bridge between Rasterization and Ray Casting"). Embree's builder (surface area
/// heuristic) chooses the splits.
class BeamTree {
 public:
  /// Throws std::runtime_error if memory is insufficient. Keeps no reference to `meshes`.
  BeamTree(const std::vector<imaging::TexturedMesh>& meshes, const geometry::Vec3& anchor);

  /// Scene::intersect for beams. Returns false, without changing `beam`, if the rays diverge too much (some 60 degrees
  /// from their mean): then cast them one by one.
  bool intersect(std::span<RayPacket8> beam) const;

 private:
  DeviceHandle device_;
  std::unique_ptr<std::remove_pointer_t<RTCBVH>, ReleaseBvh> memory_;  ///< holds nodes and leaves
  BeamNode::Child root_ = 0;
  float reach_m_ = 0.0F;  ///< largest absolute coordinate of a corner
};

}  // namespace tileflight::scene
