#include "tileflight/world/scene/part_tree.h"

#include <stdexcept>
#include <utility>

namespace tileflight::scene {
namespace {

/// The part's number as a child: it tells itself from pointers, whose lowest bits are 0, and from 0.
void* create_part_leaf(RTCThreadLocalAllocator, const RTCBuildPrimitive* boxes, std::size_t, void*) {
  return reinterpret_cast<void*>(static_cast<BeamNode::Child>(boxes->primID) << 2U | 2U);
}

}  // namespace

PartTree::PartTree(std::span<const Eigen::AlignedBox3f> boxes, DeviceHandle device)
    : device_(std::move(device)), memory_(rtcNewBVH(device_.get())) {
  if (!memory_) throw std::runtime_error("Embree: no memory for a tree");
  std::vector<RTCBuildPrimitive> primitives;
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    if (boxes[i].isEmpty()) continue;
    const Eigen::Vector3f &low = boxes[i].min(), &high = boxes[i].max();
    primitives.push_back({low.x(), low.y(), low.z(), 0, high.x(), high.y(), high.z(), static_cast<std::uint32_t>(i)});
  }
  RTCBuildArguments arguments = rtcDefaultBuildArguments();
  arguments.maxLeafSize = 1;
  arguments.bvh = memory_.get();
  arguments.createLeaf = create_part_leaf;
  root_ = build_beam_nodes(arguments, primitives);
  if (root_ == 0) throw std::runtime_error("Embree: the tree of parts was not built; is there enough memory?");
}

}  // namespace tileflight::scene
