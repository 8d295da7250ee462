#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "tileflight/world/scene/beam_tree.h"
#include "tileflight/world/scene/embree_tree.h"
#include "tileflight/world/scene/packets.h"
#include "tileflight/world/scene/part_motion.h"

namespace tileflight::scene {

/// A bounding volume hierarchy over the boxes of a scene's parts. Its leaves are the parts' numbers.
class PartTree {
 public:
  /// Builds the tree. `boxes`: box of each part, relative to the anchor; low > high for a part without triangles, which
  /// is left out. At least one part has triangles. Throws std::runtime_error if memory is insufficient.
  PartTree(std::span<const Eigen::AlignedBox3f> boxes, DeviceHandle device);

  BeamNode::Child root() const { return root_; }

  /// Calls `visit(part)` for parts from near to far, as defined by the query:
  ///   query.distances(node, distance)   sets the distances of a node's eight boxes, infinity if one is missed
  ///   query.reach()                     the distance beyond which nothing is wanted, which visits may reduce
  /// Ends early when `visit` returns false.
  template <class Query, class Visit>
  void visit_parts(const Query& query, const Visit& visit) const;

 private:
  struct Entry {
    float distance;
    BeamNode::Child child;
  };

  template <class Query>
  static std::size_t push_children(const BeamNode& node, const Query& query, Entry* stack, std::size_t size);

  DeviceHandle device_;
  BvhHandle memory_;  ///< holds the nodes
  BeamNode::Child root_ = 0;
};

/// Pushes the children that are wanted, the nearest on top.
template <class Query>
std::size_t PartTree::push_children(const BeamNode& node, const Query& query, Entry* stack, std::size_t size) {
  float distances[8];
  query.distances(node, distances);
  const std::size_t bottom = size;
  for (int k = 0; k < 8; ++k) {
    if (node.child[k] == 0 || !(distances[k] <= query.reach())) continue;
    std::size_t at = size++;
    for (; at > bottom && stack[at - 1].distance < distances[k]; --at) stack[at] = stack[at - 1];
    stack[at] = {distances[k], node.child[k]};
  }
  return size;
}

template <class Query, class Visit>
void PartTree::visit_parts(const Query& query, const Visit& visit) const {
  constexpr std::size_t kStackSize = 32 * 7 + 1;  // Embree's builder makes at most 32 levels
  std::array<Entry, kStackSize> stack;
  std::size_t size = 0;
  stack[size++] = {-std::numeric_limits<float>::infinity(), root_};
  while (size > 0) {
    const Entry entry = stack[--size];
    if (!(entry.distance <= query.reach())) continue;
    if ((entry.child & 2U) == 0) {
      size = push_children(*reinterpret_cast<const BeamNode*>(entry.child), query, stack.data(), size);
    } else if (!visit(static_cast<std::size_t>(entry.child >> 2U))) {
      return;
    }
  }
}

/// A part of a scene, with its motion if it is placed.
struct QueriedPart {
  std::shared_ptr<const ScenePart> part;
  std::shared_ptr<const PartMotion> motion;  ///< of a placed part; null: its frame is the scene's
};

/// Queries over several parts, as over one tree of all their triangles: meshes are numbered across the parts, in their
/// order. A tree over the parts chooses those that a query meets; their own trees answer, placed parts' in their own
/// coordinates, into which the query is transformed. A part's tree for rays is built by the first ray that meets the
/// part.
class PartQueries {
 public:
  /// Builds the tree over the parts, of which one has a triangle. `frame`: that of the scene. Throws std::runtime_error
  /// if memory is insufficient.
  PartQueries(std::vector<QueriedPart> parts, const SceneFrame& frame);

  /// Answer queries of Embree's rtcIntersect1 and rtcOccluded1, with meshes as geometry numbers. If surfaces of several
  /// parts are equally near, the first part's counts. The ray's time is the scene's.
  void intersect(RTCRayHit& query) const;
  void test_occlusion(RTCRay& ray) const;
  /// Answer the queries of Scene's functions of the same names.
  void intersect(RayPacket8& packet) const;
  void test_occlusion(RayPacket8& packet) const;
  bool intersect(std::span<RayPacket8> beam) const;
  bool intersect_moving(std::span<const std::span<RayPacket8>> beams) const;
  void build_beam_trees() const { branches(); }

  /// Calls `look(part)`, a QueriedPart, for those whose box is nearer to the point (relative to the anchor) than
  /// `radius()`, which may shrink between calls.
  template <class Radius, class Look>
  void visit_near(const float (&point)[3], const Radius& radius, const Look& look) const;

 private:
  const std::vector<BeamBranch>& branches() const;
  float slack_at(float x, float y, float z) const;
  RTCScene tree_of(std::size_t part) const;

  void rotate_normals(std::span<RayPacket8> beam) const;

  std::vector<QueriedPart> parts_;
  std::vector<std::uint32_t> first_mesh_;  ///< of each part
  std::vector<std::uint32_t> placed_;      ///< for each mesh from first_placed_mesh_ on, its part
  std::uint32_t first_placed_mesh_ = 0;    ///< of placed parts, which follow the others
  float reach_m_;                          ///< largest absolute coordinate of a box
  PartTree tree_;
  mutable LazyTree<std::vector<BeamBranch>> branches_;
};

/// Distances of a point from boxes.
template <class Radius>
struct PointBoxes {
  const float (&point)[3];
  const Radius& radius;
  float slack_m;

  float reach() const { return radius(); }
  void distances(const BeamNode& node, float (&distance)[8]) const {
    for (int k = 0; k < 8; ++k) {
      float squared = 0.0F;
      for (int axis = 0; axis < 3; ++axis) {
        const float below = node.low[axis][k] - point[axis], above = point[axis] - node.high[axis][k];
        const float away = std::max(std::max(below, above), 0.0F);
        squared += away * away;
      }
      distance[k] = std::max(0.0F, std::sqrt(squared) * (1.0F - 1e-6F) - slack_m);
    }
  }
};

template <class Radius, class Look>
void PartQueries::visit_near(const float (&point)[3], const Radius& radius, const Look& look) const {
  const PointBoxes<Radius> query{point, radius, slack_at(point[0], point[1], point[2])};
  tree_.visit_parts(query, [&](std::size_t part) {
    look(parts_[part]);
    return true;
  });
}

}  // namespace tileflight::scene
