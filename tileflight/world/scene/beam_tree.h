#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <type_traits>
#include <vector>

#include "tileflight/core/imaging/textured_mesh.h"
#include "tileflight/world/scene/embree.h"
#include "tileflight/world/scene/embree_tree.h"
#include "tileflight/world/scene/packets.h"

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
  /// A BeamNode; a BeamLeaf if the lowest bit is set; the number of a part, times four, if the second is.
  using Child = std::uintptr_t;

  float low[3][8], high[3][8];  ///< [axis][child], metres relative to the anchor; low > high for missing children
  Child child[8];
};

struct ReleaseBvh {
  void operator()(RTCBVH bvh) const { rtcReleaseBVH(bvh); }
};
using BvhHandle = std::unique_ptr<std::remove_pointer_t<RTCBVH>, ReleaseBvh>;

/// Builds the nodes over the boxes, up to eight children a node, in the memory of `arguments.bvh`; the caller sets what
/// concerns leaves. 0 if memory is insufficient.
BeamNode::Child build_beam_nodes(RTCBuildArguments arguments, std::span<RTCBuildPrimitive> boxes);

class PartMotion;  // part_motion.h

/// A tree within a larger one (part_queries.h): its meshes are numbered from `first_mesh` on.
struct BeamBranch {
  BeamNode::Child root = 0;
  std::uint32_t first_mesh = 0;
  const PartMotion* motion = nullptr;  ///< of a placed part; null: the tree's coordinates are those of the larger one
  float reach_m = 0.0F;                ///< of a placed part: largest absolute coordinate of a corner, in its own frame
};

/// Casts a beam through the tree below `root`, whose parts are `branches`. `reach_m`: largest absolute coordinate of a
/// corner. Results are those of BeamTree::intersect(), except that normals of hits on placed parts are in the part's
/// frame.
bool intersect_beam(BeamNode::Child root, std::span<const BeamBranch> branches, float reach_m,
                    std::span<RayPacket8> beam);

/// Largest number of beams that intersect_moving_beams() casts at once.
inline constexpr std::size_t kMostMovingBeams = 4;

/// Casts beams whose rays each have their own origin and time, all near each other, with one traversal
/// (moving_beam.cpp). Each of `beams` has one to eight packets. Otherwise it works as intersect_beam().
bool intersect_moving_beams(BeamNode::Child root, std::span<const BeamBranch> branches, float reach_m,
                            std::span<const std::span<RayPacket8>> beams);

/// A bounding volume hierarchy over the triangles of a list of meshes, for beams: up to 64 rays with a common origin
/// and similar directions, such as a block of a camera's pixels. The tree is traversed once per beam with its enclosing
/// pyramid, and each candidate triangle is tested against eight rays at a time by its three edge functions (Davidovic
/// et al. 2012, "3D Rasterization: A Bridge between Rasterization and Ray Casting"). Embree's builder (surface area
/// heuristic) chooses the splits.
class BeamTree {
 public:
  /// Throws std::runtime_error if memory is insufficient. Keeps no reference to `meshes`, which have a triangle.
  BeamTree(const std::vector<imaging::TexturedMesh>& meshes, const geometry::Vec3& anchor, DeviceHandle device);

  /// Answers Scene::intersect() for beams, which have one time. Returns false, without changing `beam`, if the rays
  /// diverge too much (some 60 degrees from their mean): then cast them one by one.
  bool intersect(std::span<RayPacket8> beam) const;
  /// Answers Scene::intersect_moving(), with the same exception.
  bool intersect_moving(std::span<const std::span<RayPacket8>> beams) const;

  BeamNode::Child root() const { return root_; }
  float reach_m() const { return reach_m_; }

 private:
  DeviceHandle device_;
  BvhHandle memory_;  ///< holds nodes and leaves
  BeamNode::Child root_ = 0;
  float reach_m_ = 0.0F;  ///< largest absolute coordinate of a corner
};

}  // namespace tileflight::scene
