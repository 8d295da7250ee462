// Nearest point on a mesh: a bounding volume hierarchy with four children per node.
//
// Every node stores its children's boxes as floats relative to `anchor`, so that one SIMD operation bounds the distance
// to all four. The boxes are rounded outwards and enlarged by more than the rounding error of a query in float, so the
// bound never exceeds the true distance: floats only select the triangles to visit, doubles decide which is nearest,
// also four at a time. The tree is split at the median triangle, so the shape of every subtree depends only on its
// number of triangles: each part's position in the arrays is known in advance, and the parts are built in parallel.
#include "tileflight/core/geometry/triangle_index.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/triangle_pack.h"

namespace tileflight::geometry {
namespace {

using Float4 = Eigen::Array4f;

constexpr std::size_t kLeafTriangles = TrianglePack::kSize;
constexpr std::size_t kSerialBelow = 8192;

/// Larger coordinates, metres, would overflow when squared as floats.
constexpr double kFarthest_m = 1e15;

/// Bound on the relative loss of a squared distance by rounding to float and the operations after it, with margin.
constexpr float kBoundShrink = 1.0F - 1e-5F;

struct alignas(64) Node {
  std::array<Float4, 3> low, high;      ///< [axis](child), metres relative to the anchor
  std::array<std::int32_t, 4> child{};  ///< node, or a leaf's pack; -1: no child
  std::array<bool, 4> is_leaf{};
};

/// A triangle during construction.
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

/// Sizes of the four parts into which a range of `count` triangles is split; a part may be empty.
std::array<std::size_t, 4> quarters(std::size_t count) {
  const std::size_t left = count / 2;
  const std::size_t right = count - left;
  return {left / 2, left - left / 2, right / 2, right - right / 2};
}

/// Number of nodes and leaves of a subtree, or the position of its parts in the arrays.
struct TreeSize {
  std::size_t nodes = 0;
  std::size_t leaves = 0;

  TreeSize& operator+=(const TreeSize& other) {
    nodes += other.nodes;
    leaves += other.leaves;
    return *this;
  }
};

/// Sizes of subtrees for all occurring numbers of triangles.
class TreeSizes {
 public:
  explicit TreeSizes(std::size_t triangles) { compute(triangles); }
  TreeSize operator()(std::size_t triangles) const {
    return triangles <= kLeafTriangles ? leaf(triangles) : sizes_.at(triangles);
  }

 private:
  static TreeSize leaf(std::size_t triangles) { return {0, triangles > 0 ? 1U : 0U}; }

  TreeSize compute(std::size_t triangles) {
    if (triangles <= kLeafTriangles) return leaf(triangles);
    if (const auto found = sizes_.find(triangles); found != sizes_.end()) return found->second;
    TreeSize size{1, 0};
    for (const std::size_t part : quarters(triangles)) size += compute(part);
    sizes_[triangles] = size;
    return size;
  }

  std::map<std::size_t, TreeSize> sizes_;
};

/// Moves the `left` items with the smallest centres along the longest axis to the front.
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

/// Rounds a double to a float towards `direction`.
float rounded_towards(double value, float direction) { return std::nextafter(static_cast<float>(value), direction); }

}  // namespace

struct TriangleIndex::Tree {
  explicit Tree(const TriangleMesh& mesh);

  std::optional<SurfacePoint> nearest(const Vec3& query, double radius_m) const;

 private:
  std::vector<Item> items_of(const TriangleMesh& mesh) const;
  FloatBox build(std::span<Item> items, const TreeSize& place, const TriangleMesh& mesh, const TreeSizes& sizes);
  FloatBox build_leaf(std::span<const Item> items, std::size_t leaf, const TriangleMesh& mesh);
  FloatBox box_of(const Vec3& a, const Vec3& b, const Vec3& c) const;
  Float4 distance2_bounds(const Node& node, const Eigen::Array3f& query) const;

  Vec3 anchor_ = Vec3::Zero();
  float slack_ = 0.0F;  ///< enlargement of the boxes, metres
  std::vector<Node> nodes_;
  std::vector<TrianglePack> leaves_;
};

TriangleIndex::Tree::Tree(const TriangleMesh& mesh) {
  const Box3 box = bounds(mesh);
  for (const Vec3& v : mesh.vertices) {
    if (!(v.array().abs() <= kFarthest_m).all())
      throw InputError("mesh", "a vertex is not finite or farther than 1e15 m from the origin");
  }
  if (mesh.triangles.empty()) return;
  anchor_ = box.center();
  slack_ = static_cast<float>(box.sizes().maxCoeff()) * 4.0F * std::numeric_limits<float>::epsilon();
  std::vector<Item> items = items_of(mesh);
  const TreeSizes sizes(items.size());
  nodes_.resize(std::max<std::size_t>(sizes(items.size()).nodes, 1));
  leaves_.resize(std::max<std::size_t>(sizes(items.size()).leaves, 4));
  build(items, {}, mesh, sizes);
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

/// `place`: index of the subtree's root node and of its first leaf.
FloatBox TriangleIndex::Tree::build(std::span<Item> items, const TreeSize& place, const TriangleMesh& mesh,
                                    const TreeSizes& sizes) {
  const auto counts = quarters(items.size());
  const std::size_t half = counts[0] + counts[1];
  const bool serial = items.size() < kSerialBelow;
  split(items, half);
  const auto split_left = [&] { split(items.first(half), counts[0]); };
  const auto split_right = [&] { split(items.subspan(half), counts[2]); };
  if (serial) {
    split_left();
    split_right();
  } else {
    tbb::parallel_invoke(split_left, split_right);
  }

  std::array<FloatBox, 4> boxes;
  const std::array<std::size_t, 4> starts{0, counts[0], half, half + counts[2]};
  std::array<TreeSize, 4> places{TreeSize{place.nodes + 1, place.leaves}};
  for (std::size_t k = 1; k < 4; ++k) (places[k] = places[k - 1]) += sizes(counts[k - 1]);
  Node& node = nodes_[place.nodes];
  const auto build_child = [&](std::size_t k) {
    const std::span<Item> part = items.subspan(starts[k], counts[k]);
    node.is_leaf[k] = part.size() <= kLeafTriangles;
    const std::size_t child = node.is_leaf[k] ? places[k].leaves : places[k].nodes;
    node.child[k] = part.empty() ? -1 : static_cast<std::int32_t>(child);
    if (part.empty()) return;
    boxes[k] = node.is_leaf[k] ? build_leaf(part, child, mesh) : build(part, places[k], mesh, sizes);
  };
  if (serial) {
    for (std::size_t k = 0; k < 4; ++k) build_child(k);
  } else {
    tbb::parallel_for(std::size_t{0}, std::size_t{4}, build_child);
  }
  FloatBox all;
  for (int k = 0; k < 4; ++k) {
    const FloatBox& box = boxes[static_cast<std::size_t>(k)];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      node.low[axis][k] = box.low[static_cast<int>(axis)];
      node.high[axis][k] = box.high[static_cast<int>(axis)];
    }
    all.extend(box);
  }
  return all;
}

FloatBox TriangleIndex::Tree::build_leaf(std::span<const Item> items, std::size_t leaf, const TriangleMesh& mesh) {
  FloatBox box;
  std::array<std::uint32_t, kLeafTriangles> chosen{};
  for (std::size_t i = 0; i < items.size(); ++i) {
    chosen[i] = items[i].triangle;
    const Triangle& t = mesh.triangles[chosen[i]];
    box.extend(box_of(mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]));
  }
  leaves_[leaf] = TrianglePack(mesh, std::span(chosen).first(items.size()));
  return box;
}

FloatBox TriangleIndex::Tree::box_of(const Vec3& a, const Vec3& b, const Vec3& c) const {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  const Vec3 low = a.cwiseMin(b).cwiseMin(c) - anchor_;
  const Vec3 high = a.cwiseMax(b).cwiseMax(c) - anchor_;
  FloatBox box;
  for (int axis = 0; axis < 3; ++axis) {
    box.low[axis] = rounded_towards(low[axis], -kInfinity) - slack_;
    box.high[axis] = rounded_towards(high[axis], kInfinity) + slack_;
  }
  return box;
}

/// For each child, a lower bound of the squared distance from the query to its triangles.
Float4 TriangleIndex::Tree::distance2_bounds(const Node& node, const Eigen::Array3f& query) const {
  Float4 sum = Float4::Zero();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const Float4 q = Float4::Constant(query[static_cast<int>(axis)]);
    const Float4 outside = (node.low[axis] - q).max(q - node.high[axis]).max(Float4::Zero());
    sum += outside * outside;
  }
  return sum * kBoundShrink;
}

std::optional<SurfacePoint> TriangleIndex::Tree::nearest(const Vec3& query, double radius_m) const {
  struct Entry {
    float bound;
    std::int32_t child;
    bool is_leaf;
  };
  // At most three entries remain on each level; 32-bit triangle numbers give at most 16 levels.
  std::array<Entry, 64> stack;
  std::size_t size = 0;
  if (!nodes_.empty()) stack[size++] = {0.0F, 0, false};
  const Eigen::Array3f q = (query - anchor_).array().max(-1e18).min(1e18).cast<float>();
  constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
  TrianglePack::Nearest best{radius_m * radius_m, kNone};
  while (size > 0) {
    const Entry entry = stack[--size];
    if (static_cast<double>(entry.bound) > best.distance2) continue;
    const auto child = static_cast<std::size_t>(entry.child);
    if (entry.is_leaf) {
      const TrianglePack::Nearest found = leaves_[child].nearest(query);
      const bool lower = found.distance2 == best.distance2 && found.triangle < best.triangle;
      if (found.distance2 < best.distance2 || lower) best = found;
      continue;
    }
    const Node& node = nodes_[child];
    const Float4 bounds2 = distance2_bounds(node, q);
    const std::size_t bottom = size;
    for (std::size_t k = 0; k < 4; ++k) {
      const float bound = bounds2[static_cast<int>(k)];
      if (node.child[k] < 0 || static_cast<double>(bound) > best.distance2) continue;
      // Inserted in order, so that the nearest is on top.
      std::size_t at = size++;
      for (; at > bottom && stack[at - 1].bound < bound; --at) stack[at] = stack[at - 1];
      stack[at] = {bound, node.child[k], node.is_leaf[k]};
    }
  }
  if (best.triangle == kNone) return std::nullopt;
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
