// Nearest point on a mesh: a tree of boxes with four children a node.
//
// Every node holds its children's boxes as floats relative to `anchor`, four abreast, so that one vector operation
// bounds the distance to all four. The boxes are rounded outwards and widened by more than the rounding of a query to
// float, so the bound is never above the true distance: floats decide only which triangles are looked at, doubles
// decide which is nearest. The tree is split at the median triangle, so the shape of every subtree follows from its
// number of triangles alone: each part knows its place in the arrays beforehand, and the parts are built in parallel.
#include "tileflight/geometry/triangle_index.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "tileflight/geometry/input_error.h"

namespace tileflight::geometry {
namespace {

using Float4 = Eigen::Array4f;

constexpr std::size_t kLeafTriangles = 4;
constexpr std::size_t kSerialBelow = 8192;

/// Coordinates beyond this, metres, would overflow the squares of floats.
constexpr double kFarthest_m = 1e15;

/// What rounding to float and the few operations after it can take away from a squared distance, with room to spare.
constexpr float kBoundShrink = 1.0F - 1e-5F;

struct alignas(64) Node {
  std::array<Float4, 3> low, high;               ///< [axis](child), metres relative to the anchor
  std::array<std::int32_t, 4> child{};           ///< node, or first triangle of a leaf; -1: no child
  std::array<std::int32_t, 4> leaf_triangles{};  ///< 0: the child is a node
};

struct Corners {
  Vec3 a, b, c;
  std::uint32_t triangle;  ///< index in the mesh
};

/// A triangle while the tree is built.
struct Item {
  std::array<float, 3> center;
  std::uint32_t triangle;
};

struct FloatBox {
  Eigen::Array3f low = Eigen::Array3f::Constant(std::numeric_limits<float>::max());
  Eigen::Array3f high = Eigen::Array3f::Constant(std::numeric_limits<float>::lowest());

  void extend(const FloatBox& other) {
    low = low.min(other.low);
    high = high.max(other.high);
  }
};

/// The sizes of the four parts that a range of `count` triangles is cut into; a part may be empty.
std::array<std::size_t, 4> quarters(std::size_t count) {
  const std::size_t left = count / 2;
  const std::size_t right = count - left;
  return {left / 2, left - left / 2, right / 2, right - right / 2};
}

/// How many nodes a subtree over `count` triangles has, for all counts that occur.
class NodeCounts {
 public:
  explicit NodeCounts(std::size_t triangles) { compute(triangles); }
  std::size_t operator()(std::size_t triangles) const {
    return triangles <= kLeafTriangles ? 0 : counts_.at(triangles);
  }

 private:
  std::size_t compute(std::size_t triangles) {
    if (triangles <= kLeafTriangles) return 0;
    if (const auto found = counts_.find(triangles); found != counts_.end()) return found->second;
    std::size_t nodes = 1;
    for (const std::size_t part : quarters(triangles)) nodes += compute(part);
    counts_[triangles] = nodes;
    return nodes;
  }

  std::map<std::size_t, std::size_t> counts_;
};

/// Puts the smaller `left` items along the longest axis of the centres in front.
void split(std::span<Item> items, std::size_t left) {
  std::array<float, 3> low = items[0].center;
  std::array<float, 3> high = items[0].center;
  for (const Item& item : items) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], item.center[axis]);
      high[axis] = std::max(high[axis], item.center[axis]);
    }
  }
  std::size_t longest = 0;
  for (std::size_t axis = 1; axis < 3; ++axis) {
    if (high[axis] - low[axis] > high[longest] - low[longest]) longest = axis;
  }
  std::nth_element(items.begin(), items.begin() + static_cast<std::ptrdiff_t>(left), items.end(),
                   [longest](const Item& a, const Item& b) {
                     if (a.center[longest] != b.center[longest]) return a.center[longest] < b.center[longest];
                     return a.triangle < b.triangle;
                   });
}

/// The next float towards `direction` of a double.
float rounded_towards(double value, float direction) { return std::nextafter(static_cast<float>(value), direction); }

}  // namespace

struct TriangleIndex::Tree {
  explicit Tree(const TriangleMesh& mesh);

  std::optional<SurfacePoint> nearest(const Vec3& query, double radius_m) const;

 private:
  struct Best {
    double distance2;
    std::uint32_t triangle = std::numeric_limits<std::uint32_t>::max();
    Vec3 position = Vec3::Zero();
  };

  std::vector<Item> items_of(const TriangleMesh& mesh) const;
  FloatBox build(std::span<Item> items, std::size_t node, std::size_t first, const TriangleMesh& mesh,
                 const NodeCounts& node_counts);
  FloatBox build_leaf(std::span<const Item> items, std::size_t first, const TriangleMesh& mesh);
  FloatBox box_of(const Corners& t) const;
  Float4 distance2_bounds(const Node& node, const Eigen::Array3f& query) const;
  void visit_leaf(std::int32_t first, std::int32_t count, const Vec3& query, Best& best) const;

  Vec3 anchor_ = Vec3::Zero();
  float slack_ = 0.0F;  ///< by which boxes are widened, metres
  std::vector<Node> nodes_;
  std::vector<Corners> triangles_;  ///< in the order of the leaves
};

TriangleIndex::Tree::Tree(const TriangleMesh& mesh) {
  const Box3 box = bounds(mesh);
  for (const Vec3& v : mesh.vertices) {
    if (!(v.array().abs() <= kFarthest_m).all()) throw InputError("mesh", "a vertex is not finite or beyond 1e15 m");
  }
  if (mesh.triangles.empty()) return;
  anchor_ = box.center();
  slack_ = static_cast<float>(box.sizes().maxCoeff()) * 4.0F * std::numeric_limits<float>::epsilon();
  std::vector<Item> items = items_of(mesh);
  const NodeCounts node_counts(items.size());
  nodes_.resize(std::max<std::size_t>(node_counts(items.size()), 1));
  triangles_.resize(items.size());
  build(items, 0, 0, mesh, node_counts);
}

std::vector<Item> TriangleIndex::Tree::items_of(const TriangleMesh& mesh) const {
  std::vector<Item> items(mesh.triangles.size());
  tbb::parallel_for(std::size_t{0}, items.size(), [&](std::size_t i) {
    const Triangle& t = mesh.triangles[i];
    const Vec3 sum = mesh.vertices[t[0]] + mesh.vertices[t[1]] + mesh.vertices[t[2]];
    const Eigen::Vector3f center = (sum / 3.0 - anchor_).cast<float>();
    items[i] = {{center.x(), center.y(), center.z()}, static_cast<std::uint32_t>(i)};
  });
  return items;
}

FloatBox TriangleIndex::Tree::build(std::span<Item> items, std::size_t node, std::size_t first,
                                    const TriangleMesh& mesh, const NodeCounts& node_counts) {
  const auto sizes = quarters(items.size());
  const std::size_t half = sizes[0] + sizes[1];
  split(items, half);
  split(items.first(half), sizes[0]);
  split(items.subspan(half), sizes[2]);

  std::array<FloatBox, 4> boxes;
  std::array<std::size_t, 4> starts{0, sizes[0], half, half + sizes[2]};
  std::array<std::size_t, 4> child_nodes{node + 1};
  for (std::size_t k = 1; k < 4; ++k) child_nodes[k] = child_nodes[k - 1] + node_counts(sizes[k - 1]);
  const auto build_child = [&](std::size_t k) {
    const std::span<Item> part = items.subspan(starts[k], sizes[k]);
    const bool leaf = part.size() <= kLeafTriangles;
    nodes_[node].leaf_triangles[k] = leaf ? static_cast<std::int32_t>(part.size()) : 0;
    nodes_[node].child[k] = part.empty() ? -1 : static_cast<std::int32_t>(leaf ? first + starts[k] : child_nodes[k]);
    boxes[k] = leaf ? build_leaf(part, first + starts[k], mesh)
                    : build(part, child_nodes[k], first + starts[k], mesh, node_counts);
  };
  if (items.size() < kSerialBelow) {
    for (std::size_t k = 0; k < 4; ++k) build_child(k);
  } else {
    tbb::parallel_for(std::size_t{0}, std::size_t{4}, build_child);
  }
  FloatBox all;
  for (int k = 0; k < 4; ++k) {
    const FloatBox& box = boxes[static_cast<std::size_t>(k)];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      nodes_[node].low[axis][k] = box.low[static_cast<int>(axis)];
      nodes_[node].high[axis][k] = box.high[static_cast<int>(axis)];
    }
    all.extend(box);
  }
  return all;
}

FloatBox TriangleIndex::Tree::build_leaf(std::span<const Item> items, std::size_t first, const TriangleMesh& mesh) {
  FloatBox box;
  for (std::size_t i = 0; i < items.size(); ++i) {
    const Triangle& t = mesh.triangles[items[i].triangle];
    triangles_[first + i] = {mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]], items[i].triangle};
    box.extend(box_of(triangles_[first + i]));
  }
  return box;
}

FloatBox TriangleIndex::Tree::box_of(const Corners& t) const {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  const Vec3 low = t.a.cwiseMin(t.b).cwiseMin(t.c) - anchor_;
  const Vec3 high = t.a.cwiseMax(t.b).cwiseMax(t.c) - anchor_;
  FloatBox box;
  for (int axis = 0; axis < 3; ++axis) {
    box.low[axis] = rounded_towards(low[axis], -kInfinity) - slack_;
    box.high[axis] = rounded_towards(high[axis], kInfinity) + slack_;
  }
  return box;
}

/// Never above the squared distance of the query to any triangle of the child, for each child.
Float4 TriangleIndex::Tree::distance2_bounds(const Node& node, const Eigen::Array3f& query) const {
  Float4 sum = Float4::Zero();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const Float4 q = Float4::Constant(query[static_cast<int>(axis)]);
    const Float4 outside = (node.low[axis] - q).max(q - node.high[axis]).max(Float4::Zero());
    sum += outside * outside;
  }
  return sum * kBoundShrink;
}

void TriangleIndex::Tree::visit_leaf(std::int32_t first, std::int32_t count, const Vec3& query, Best& best) const {
  for (const Corners& t :
       std::span(triangles_).subspan(static_cast<std::size_t>(first), static_cast<std::size_t>(count))) {
    const Vec3 position = closest_point_on_triangle(query, t.a, t.b, t.c);
    const double distance2 = (position - query).squaredNorm();
    if (distance2 < best.distance2 || (distance2 == best.distance2 && t.triangle < best.triangle)) {
      best = {distance2, t.triangle, position};
    }
  }
}

std::optional<SurfacePoint> TriangleIndex::Tree::nearest(const Vec3& query, double radius_m) const {
  struct Entry {
    float bound;
    std::int32_t child, leaf_triangles;
  };
  // Three entries stay behind on each level; 32-bit triangle numbers give at most 16 levels.
  std::array<Entry, 64> stack;
  std::size_t size = 0;
  if (!triangles_.empty()) stack[size++] = {0.0F, 0, 0};
  const Eigen::Array3f q = (query - anchor_).array().max(-1e18).min(1e18).cast<float>();
  Best best{radius_m * radius_m};
  while (size > 0) {
    const Entry entry = stack[--size];
    if (static_cast<double>(entry.bound) > best.distance2) continue;
    if (entry.leaf_triangles > 0) {
      visit_leaf(entry.child, entry.leaf_triangles, query, best);
      continue;
    }
    const Node& node = nodes_[static_cast<std::size_t>(entry.child)];
    const Float4 bounds2 = distance2_bounds(node, q);
    const std::size_t bottom = size;
    for (std::size_t k = 0; k < 4; ++k) {
      const float bound = bounds2[static_cast<int>(k)];
      if (node.child[k] < 0 || static_cast<double>(bound) > best.distance2) continue;
      // Inserted so that the nearest lies on top.
      std::size_t at = size++;
      for (; at > bottom && stack[at - 1].bound < bound; --at) stack[at] = stack[at - 1];
      stack[at] = {bound, node.child[k], node.leaf_triangles[k]};
    }
  }
  if (best.triangle == std::numeric_limits<std::uint32_t>::max()) return std::nullopt;
  return SurfacePoint{best.position, std::sqrt(best.distance2), best.triangle};
}

TriangleIndex::TriangleIndex(const TriangleMesh& mesh) : tree_(std::make_unique<Tree>(mesh)) {}
TriangleIndex::~TriangleIndex() = default;
TriangleIndex::TriangleIndex(TriangleIndex&&) noexcept = default;
TriangleIndex& TriangleIndex::operator=(TriangleIndex&&) noexcept = default;

std::optional<SurfacePoint> TriangleIndex::nearest(const Vec3& query, double radius_m) const {
  if (!query.allFinite() || !(radius_m >= 0.0)) return std::nullopt;
  return tree_->nearest(query, radius_m);
}

}  // namespace tileflight::geometry
