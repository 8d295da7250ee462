#include "tileflight/scene/beam_tree.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <new>
#include <stdexcept>
#include <utility>

namespace tileflight::scene {
namespace {

constexpr float kEmptyBound = 1e30F;  // finite, so that its product with 0 is 0

struct TriangleSource {
  const std::vector<imaging::TexturedMesh>& meshes;
  const geometry::Vec3& anchor;

  Eigen::Vector3f corner(std::uint32_t mesh, std::uint32_t triangle, std::size_t which) const {
    const geometry::TriangleMesh& surface = meshes[mesh].mesh;
    return (surface.vertices[surface.triangles[triangle][which]] - anchor).cast<float>();
  }
};

/// Bounding boxes of all triangles, mesh by mesh.
std::vector<RTCBuildPrimitive> boxes_of(const TriangleSource& place) {
  std::vector<std::size_t> first{0};
  for (const imaging::TexturedMesh& mesh : place.meshes) first.push_back(first.back() + mesh.mesh.triangles.size());
  std::vector<RTCBuildPrimitive> boxes(first.back());
  tbb::parallel_for(std::size_t{0}, place.meshes.size(), [&](std::size_t m) {
    const auto mesh = static_cast<std::uint32_t>(m);
    for (std::uint32_t t = 0; t < place.meshes[m].mesh.triangles.size(); ++t) {
      const Eigen::Vector3f a = place.corner(mesh, t, 0), b = place.corner(mesh, t, 1), c = place.corner(mesh, t, 2);
      const Eigen::Vector3f low = a.cwiseMin(b).cwiseMin(c), high = a.cwiseMax(b).cwiseMax(c);
      boxes[first[m] + t] = {low.x(), low.y(), low.z(), mesh, high.x(), high.y(), high.z(), t};
    }
  });
  return boxes;
}

void* create_node(RTCThreadLocalAllocator allocator, unsigned, void*) {
  auto* node = new (rtcThreadLocalAlloc(allocator, sizeof(BeamNode), alignof(BeamNode))) BeamNode;
  for (int axis = 0; axis < 3; ++axis) {
    std::fill_n(node->low[axis], 8, kEmptyBound);
    std::fill_n(node->high[axis], 8, -kEmptyBound);
  }
  std::fill_n(node->child, 8, BeamNode::Child{0});
  return node;
}

void set_children(void* parent, void** children, unsigned count, void*) {
  auto* node = static_cast<BeamNode*>(parent);
  for (unsigned i = 0; i < count; ++i) node->child[i] = reinterpret_cast<BeamNode::Child>(children[i]);
}

void set_bounds(void* parent, const RTCBounds** bounds, unsigned count, void*) {
  auto* node = static_cast<BeamNode*>(parent);
  for (unsigned i = 0; i < count; ++i) {
    const RTCBounds& box = *bounds[i];
    const float low[3] = {box.lower_x, box.lower_y, box.lower_z};
    const float high[3] = {box.upper_x, box.upper_y, box.upper_z};
    for (int axis = 0; axis < 3; ++axis) {
      node->low[axis][i] = low[axis];
      node->high[axis][i] = high[axis];
    }
  }
}

void* create_leaf(RTCThreadLocalAllocator allocator, const RTCBuildPrimitive* boxes, std::size_t count, void* user) {
  const auto& place = *static_cast<const TriangleSource*>(user);
  auto* leaf = new (rtcThreadLocalAlloc(allocator, sizeof(BeamLeaf), alignof(BeamLeaf))) BeamLeaf;
  leaf->count = static_cast<std::uint32_t>(count);
  for (std::size_t i = 0; i < 8; ++i) {
    const RTCBuildPrimitive& box = boxes[std::min(i, count - 1)];
    leaf->mesh[i] = box.geomID;
    leaf->triangle[i] = box.primID;
    for (std::size_t which = 0; which < 3; ++which) {
      const Eigen::Vector3f corner = place.corner(box.geomID, box.primID, which);
      for (int axis = 0; axis < 3; ++axis) leaf->corner[which][axis][i] = corner[axis];
    }
  }
  return reinterpret_cast<void*>(reinterpret_cast<BeamNode::Child>(leaf) | 1U);
}

float largest_coordinate(const std::vector<RTCBuildPrimitive>& boxes) {
  float largest = 0.0F;
  for (const RTCBuildPrimitive& box : boxes) {
    for (const float x : {box.lower_x, box.lower_y, box.lower_z, box.upper_x, box.upper_y, box.upper_z}) {
      largest = std::max(largest, std::abs(x));
    }
  }
  return largest;
}

}  // namespace

BeamNode::Child build_beam_nodes(RTCBuildArguments arguments, std::vector<RTCBuildPrimitive>& boxes) {
  arguments.maxBranchingFactor = 8;
  arguments.primitives = boxes.data();
  arguments.primitiveCount = boxes.size();
  arguments.primitiveArrayCapacity = boxes.size();
  arguments.createNode = create_node;
  arguments.setNodeChildren = set_children;
  arguments.setNodeBounds = set_bounds;
  return reinterpret_cast<BeamNode::Child>(rtcBuildBVH(&arguments));
}

BeamTree::BeamTree(const std::vector<imaging::TexturedMesh>& meshes, const geometry::Vec3& anchor, DeviceHandle device)
    : device_(std::move(device)), memory_(rtcNewBVH(device_.get())) {
  if (!memory_) throw std::runtime_error("Embree: no memory for a tree");
  TriangleSource place{meshes, anchor};
  std::vector<RTCBuildPrimitive> boxes = boxes_of(place);
  reach_m_ = largest_coordinate(boxes);
  RTCBuildArguments arguments = rtcDefaultBuildArguments();
  arguments.sahBlockSize = 8;
  arguments.maxLeafSize = 8;
  arguments.bvh = memory_.get();
  arguments.createLeaf = create_leaf;
  arguments.userPtr = &place;
  root_ = build_beam_nodes(arguments, boxes);
  if (root_ == 0) throw std::runtime_error("Embree: the tree for beams was not built; is there enough memory?");
}

}  // namespace tileflight::scene
