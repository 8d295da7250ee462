#include "tileflight/world/scene/beam_tree.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <memory>
#include <new>
#include <stdexcept>
#include <utility>
#include <vector>

namespace tileflight::scene {
namespace {

constexpr float kEmptyBound = 1e30F;  // finite, so that its product with 0 is 0

/// The triangles of all meshes, their corners relative to the anchor.
class TriangleSource {
 public:
  TriangleSource(const std::vector<imaging::TexturedMesh>& meshes, const geometry::Vec3& anchor)
      : meshes_(meshes), corners_(meshes.size()) {
    tbb::parallel_for(std::size_t{0}, meshes.size(), [&](std::size_t m) {
      const std::vector<geometry::Vec3>& vertices = meshes[m].mesh.vertices;
      corners_[m].reserve(vertices.size());
      for (const geometry::Vec3& vertex : vertices) corners_[m].push_back((vertex - anchor).cast<float>());
    });
  }

  const geometry::Triangle& triangle(std::uint32_t mesh, std::uint32_t triangle) const {
    return meshes_[mesh].mesh.triangles[triangle];
  }
  std::span<const geometry::Triangle> triangles(std::size_t mesh) const { return meshes_[mesh].mesh.triangles; }
  std::span<const Eigen::Vector3f> corners(std::size_t mesh) const { return corners_[mesh]; }
  std::size_t mesh_count() const { return meshes_.size(); }

 private:
  const std::vector<imaging::TexturedMesh>& meshes_;
  std::vector<std::vector<Eigen::Vector3f>> corners_;  ///< of each mesh's vertices
};

/// A primitive of the tree: one triangle, or two successive ones that share an edge, which halves the work. A box's
/// primID is the first triangle, with this bit if there is a second.
constexpr std::uint32_t kPair = 0x80000000U;

constexpr unsigned kMostGroups = 4;  ///< of a leaf, which has room for eight triangles

bool share_edge(const geometry::Triangle& a, const geometry::Triangle& b) {
  const auto is_of_a = [&](std::uint32_t vertex) { return vertex == a[0] || vertex == a[1] || vertex == a[2]; };
  return int{is_of_a(b[0])} + int{is_of_a(b[1])} + int{is_of_a(b[2])} >= 2;
}

/// Calls `work(first, count)` for each triangle or pair of a mesh.
template <class Work>
void for_each_group(std::span<const geometry::Triangle> triangles, const Work& work) {
  for (std::size_t t = 0; t < triangles.size();) {
    const std::size_t count = t + 1 < triangles.size() && share_edge(triangles[t], triangles[t + 1]) ? 2 : 1;
    work(t, count);
    t += count;
  }
}

/// The boxes of all groups, mesh by mesh, and the largest absolute coordinate.
struct TriangleBoxes {
  std::unique_ptr<RTCBuildPrimitive[]> boxes;  ///< not a vector, which would write all of it once more, by one thread
  std::size_t count = 0;
  float reach_m = 0.0F;
};

/// Writes the boxes of a mesh; returns its largest absolute coordinate.
float write_boxes(const TriangleSource& place, std::size_t m, RTCBuildPrimitive* box) {
  const std::span<const Eigen::Vector3f> corners = place.corners(m);
  const std::span<const geometry::Triangle> triangles = place.triangles(m);
  float reach_m = 0.0F;
  for_each_group(triangles, [&](std::size_t first, std::size_t count) {
    Eigen::Vector3f low = corners[triangles[first][0]], high = low;
    for (const geometry::Triangle& triangle : triangles.subspan(first, count)) {
      for (const std::uint32_t vertex : triangle) {
        low = low.cwiseMin(corners[vertex]);
        high = high.cwiseMax(corners[vertex]);
      }
    }
    const auto id = static_cast<std::uint32_t>(first) | (count == 2 ? kPair : 0U);
    *box++ = {low.x(), low.y(), low.z(), static_cast<std::uint32_t>(m), high.x(), high.y(), high.z(), id};
    reach_m = std::max(reach_m, std::max(-low.minCoeff(), high.maxCoeff()));
  });
  return reach_m;
}

TriangleBoxes boxes_of(const TriangleSource& place) {
  std::vector<std::size_t> counts(place.mesh_count());
  tbb::parallel_for(std::size_t{0}, counts.size(), [&](std::size_t m) {
    for_each_group(place.triangles(m), [&](std::size_t, std::size_t) { ++counts[m]; });
  });
  std::vector<std::size_t> first{0};
  for (const std::size_t count : counts) first.push_back(first.back() + count);
  TriangleBoxes all{std::unique_ptr<RTCBuildPrimitive[]>(new RTCBuildPrimitive[first.back()]), first.back(), 0.0F};
  std::vector<float> reaches_m(counts.size());
  tbb::parallel_for(std::size_t{0}, counts.size(),
                    [&](std::size_t m) { reaches_m[m] = write_boxes(place, m, &all.boxes[first[m]]); });
  for (const float reach_m : reaches_m) all.reach_m = std::max(all.reach_m, reach_m);
  return all;
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

void put_triangle(const TriangleSource& place, std::uint32_t mesh, std::uint32_t triangle, std::size_t at,
                  BeamLeaf& leaf) {
  leaf.mesh[at] = mesh;
  leaf.triangle[at] = triangle;
  for (std::size_t which = 0; which < 3; ++which) {
    const Eigen::Vector3f& corner = place.corners(mesh)[place.triangle(mesh, triangle)[which]];
    for (int axis = 0; axis < 3; ++axis) leaf.corner[which][axis][at] = corner[axis];
  }
}

void* create_leaf(RTCThreadLocalAllocator allocator, const RTCBuildPrimitive* boxes, std::size_t count, void* user) {
  const auto& place = *static_cast<const TriangleSource*>(user);
  auto* leaf = new (rtcThreadLocalAlloc(allocator, sizeof(BeamLeaf), alignof(BeamLeaf))) BeamLeaf;
  leaf->count = 0;
  for (const RTCBuildPrimitive& box : std::span(boxes, count)) {
    const std::uint32_t triangle = box.primID & ~kPair;
    put_triangle(place, box.geomID, triangle, leaf->count++, *leaf);
    if ((box.primID & kPair) != 0) put_triangle(place, box.geomID, triangle + 1, leaf->count++, *leaf);
  }
  for (std::size_t i = leaf->count; i < 8; ++i)
    put_triangle(place, leaf->mesh[leaf->count - 1], leaf->triangle[leaf->count - 1], i, *leaf);
  return reinterpret_cast<void*>(reinterpret_cast<BeamNode::Child>(leaf) | 1U);
}

}  // namespace

BeamNode::Child build_beam_nodes(RTCBuildArguments arguments, std::span<RTCBuildPrimitive> boxes) {
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
  TriangleSource place(meshes, anchor);
  const TriangleBoxes triangles = boxes_of(place);
  reach_m_ = triangles.reach_m;
  RTCBuildArguments arguments = rtcDefaultBuildArguments();
  arguments.sahBlockSize = kMostGroups;
  // Triangles that fit into a leaf are not divided, although its node has room for more children: a leaf costs the same
  // however many triangles it has.
  arguments.minLeafSize = kMostGroups;
  arguments.maxLeafSize = kMostGroups;
  arguments.bvh = memory_.get();
  arguments.createLeaf = create_leaf;
  arguments.userPtr = &place;
  root_ = build_beam_nodes(arguments, {triangles.boxes.get(), triangles.count});
  if (root_ == 0) throw std::runtime_error("Embree: the tree for beams was not built; is there enough memory?");
}

}  // namespace tileflight::scene
