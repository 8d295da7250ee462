#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "tileflight/world/scene/beam_tree.h"
#include "tileflight/world/scene/embree_tree.h"

namespace tileflight::scene {

/// A bounding volume hierarchy over the boxes of a scene's parts. Its leaves are the parts' numbers.
class PartTree {
 public:
  /// `boxes`: of each part, relative to the anchor; low > high for one without triangles, which is left out. Not all
  /// are. Throws std::runtime_error if memory is insufficient.
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

}  // namespace tileflight::scene
