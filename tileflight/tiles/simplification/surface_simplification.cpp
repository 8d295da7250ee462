#include "tileflight/tiles/simplification/surface_simplification.h"

#include <meshoptimizer.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <unordered_map>

#include "tileflight/core/base/random_numbers.h"
#include "tileflight/tiles/simplification/simplify.h"

namespace tileflight::simplification {
namespace {

using geometry::Triangle;
using geometry::TriangleMesh;
using geometry::Vec3;

bool before(const Vec3& a, const Vec3& b) {
  return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end());
}

bool is_flat(const TriangleMesh& mesh, const Triangle& t) {
  const Vec3& a = mesh.vertices[t[0]];
  return !((mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a).squaredNorm() > 0);
}

/// Positions relative to the centre of the extent, to keep float precision.
std::vector<float> float_positions(const TriangleMesh& mesh) {
  const Vec3 middle = geometry::bounds(mesh).center();
  std::vector<float> out;
  out.reserve(3 * mesh.vertices.size());
  for (const Vec3& v : mesh.vertices)
    for (int axis = 0; axis < 3; ++axis) out.push_back(static_cast<float>(v[axis] - middle[axis]));
  return out;
}

/// The non-degenerate triangles of a list of vertex indices.
TriangleMesh with_corners(const TriangleMesh& mesh, const std::vector<unsigned int>& corners) {
  std::vector<Triangle> triangles;
  for (std::size_t i = 0; i + 2 < corners.size(); i += 3) {
    const Triangle t{corners[i], corners[i + 1], corners[i + 2]};
    if (!is_flat(mesh, t)) triangles.push_back(t);
  }
  return extract_triangles(mesh, triangles);
}

/// For each vertex, whether it is an end of an edge used by only one triangle.
std::vector<bool> on_border(const TriangleMesh& mesh) {
  std::vector<std::uint64_t> edges;
  edges.reserve(3 * mesh.triangles.size());
  for (const Triangle& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint64_t a = t[k], b = t[(k + 1) % 3];
      edges.push_back(std::min(a, b) << 32U | std::max(a, b));
    }
  tbb::parallel_sort(edges.begin(), edges.end());
  std::vector<bool> out(mesh.vertices.size());
  for (std::size_t i = 0; i < edges.size(); ++i) {
    const bool again = (i > 0 && edges[i] == edges[i - 1]) || (i + 1 < edges.size() && edges[i] == edges[i + 1]);
    if (!again) out[edges[i] >> 32U] = out[edges[i] & 0xffffffffU] = true;
  }
  return out;
}

/// Grid of points with cells as wide as the query radius.
class PointGrid {
 public:
  PointGrid(const std::vector<Vec3>& points, double radius_m) : points_(points), radius_m_(radius_m) {}

  /// The nearest point in the grid within the radius of a place.
  std::optional<std::uint32_t> nearest(const Vec3& place) const {
    std::optional<std::uint32_t> best;
    double best_m = radius_m_;
    visit(place, [&](std::uint32_t point, double distance_m) {
      if (distance_m > best_m) return;
      best = point;
      best_m = distance_m;
    });
    return best;
  }

  /// Calls `found(point, distance_m)` for points in the cells around a place.
  template <class Found>
  void visit(const Vec3& place, const Found& found) const {
    const Cell middle = cell_of(place);
    for (int i = 0; i < 27; ++i) {
      const auto cell = cells_.find({middle[0] + i / 9 - 1, middle[1] + i / 3 % 3 - 1, middle[2] + i % 3 - 1});
      if (cell == cells_.end()) continue;
      for (const std::uint32_t point : cell->second) found(point, (points_[point] - place).norm());
    }
  }

  void add(std::uint32_t point) { cells_[cell_of(points_[point])].push_back(point); }

 private:
  using Cell = std::array<std::int64_t, 3>;

  Cell cell_of(const Vec3& place) const {
    Cell out{};
    for (int axis = 0; axis < 3; ++axis)
      out[static_cast<std::size_t>(axis)] = static_cast<std::int64_t>(std::floor(place[axis] / radius_m_));
    return out;
  }

  const std::vector<Vec3>& points_;
  double radius_m_;
  std::map<Cell, std::vector<std::uint32_t>> cells_;
};

}  // namespace

std::size_t FixedVertices::Hash::operator()(const Key& key) const {
  return static_cast<std::size_t>(
      base::splitmix64_hash(key[0] ^ base::splitmix64_hash(key[1] ^ base::splitmix64_hash(key[2]))));
}

FixedVertices::Key FixedVertices::key(const Vec3& position) {
  const Vec3 p = position + Vec3::Zero();  // -0 + 0 is 0
  return {std::bit_cast<std::uint64_t>(p.x()), std::bit_cast<std::uint64_t>(p.y()),
          std::bit_cast<std::uint64_t>(p.z())};
}

std::vector<Vec3> border_positions(const TriangleMesh& surface) {
  const std::vector<bool> is_border = on_border(surface);
  std::vector<Vec3> out;
  for (std::size_t i = 0; i < is_border.size(); ++i)
    if (is_border[i]) out.push_back(surface.vertices[i]);
  return out;
}

FixedVertices near_positions(const std::vector<Vec3>& positions, double within_m,
                             const std::function<void(const std::function<void(const Vec3&)>&)>& visit_others) {
  const double radius_m = std::max(within_m, 1e-9);
  PointGrid places(positions, radius_m);
  for (std::uint32_t i = 0; i < positions.size(); ++i) places.add(i);
  std::vector<bool> is_near(positions.size());
  visit_others([&](const Vec3& other) {
    places.visit(other, [&](std::uint32_t point, double distance_m) {
      if (distance_m <= radius_m) is_near[point] = true;
    });
  });
  FixedVertices out;
  for (std::size_t i = 0; i < positions.size(); ++i)
    if (is_near[i]) out.add(positions[i]);
  return out;
}

TriangleMesh join_borders(const TriangleMesh& surface, double within_m, const FixedVertices& fixed) {
  const std::vector<bool> is_border = on_border(surface);
  PointGrid places(surface.vertices, std::max(within_m, 1e-9));
  std::vector<std::uint32_t> goes_to(surface.vertices.size());
  std::vector<bool> is_fixed(fixed.empty() ? 0 : surface.vertices.size());
  for (std::uint32_t i = 0; i < is_fixed.size(); ++i) {
    is_fixed[i] = is_border[i] && fixed.contains(surface.vertices[i]);
    if (is_fixed[i]) places.add(i);
  }
  for (std::uint32_t i = 0; i < goes_to.size(); ++i) {
    goes_to[i] = i;
    if (!is_fixed.empty() && is_fixed[i]) continue;
    const std::optional<std::uint32_t> near = is_border[i] ? places.nearest(surface.vertices[i]) : std::nullopt;
    goes_to[i] = near.value_or(i);
    if (is_border[i] && !near) places.add(i);
  }
  std::vector<unsigned int> corners;
  corners.reserve(3 * surface.triangles.size());
  for (const Triangle& t : surface.triangles)
    for (const std::uint32_t corner : t) corners.push_back(goes_to[corner]);
  return with_corners(surface, corners);
}

TriangleMesh extract_triangles(const TriangleMesh& surface, const std::vector<Triangle>& triangles) {
  std::unordered_map<std::uint32_t, std::uint32_t> index_of;
  TriangleMesh out;
  for (Triangle t : triangles) {
    for (std::uint32_t& corner : t) {
      const auto [at, is_new] = index_of.try_emplace(corner, static_cast<std::uint32_t>(out.vertices.size()));
      if (is_new) out.vertices.push_back(surface.vertices[corner]);
      corner = at->second;
    }
    out.triangles.push_back(t);
  }
  return out;
}

TriangleMesh weld_vertices(const std::vector<imaging::TexturedMesh>& meshes) {
  const TriangleMesh all = merge_meshes(meshes);
  std::vector<std::uint32_t> order(all.vertices.size());
  std::iota(order.begin(), order.end(), 0U);
  tbb::parallel_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    const Vec3 &p = all.vertices[a], &q = all.vertices[b];
    return before(p, q) || (!before(q, p) && a < b);
  });
  std::vector<std::uint32_t> first(order.size());  // for each vertex: the first one at its position
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool again = i > 0 && all.vertices[order[i]] == all.vertices[order[i - 1]];
    first[order[i]] = again ? first[order[i - 1]] : order[i];
  }
  std::vector<unsigned int> indices;
  indices.reserve(3 * all.triangles.size());
  for (const Triangle& t : all.triangles)
    for (const std::uint32_t corner : t) indices.push_back(first[corner]);
  return with_corners(all, indices);
}

namespace {

/// Collapses edges until about so many triangles are left. Fixed vertices stay where they are. Returns corners.
std::vector<unsigned int> collapse_edges(const TriangleMesh& surface, std::size_t triangles,
                                         const FixedVertices& fixed) {
  const std::vector<float> positions = float_positions(surface);
  const std::size_t vertices = surface.vertices.size(), stride = 3 * sizeof(float);
  constexpr float kAnyError = 1.0F;  // the whole extent: only the number of triangles limits the simplification
  std::vector<unsigned int> corners;
  for (const Triangle& t : surface.triangles) corners.insert(corners.end(), t.begin(), t.end());
#if MESHOPTIMIZER_VERSION >= 220
  std::vector<unsigned char> is_fixed(vertices);
  for (std::size_t i = 0; i < vertices; ++i)
    is_fixed[i] = !fixed.empty() && fixed.contains(surface.vertices[i]) ? 1 : 0;
  std::vector<unsigned int> result(corners.size());
  result.resize(meshopt_simplifyWithAttributes(result.data(), corners.data(), corners.size(), positions.data(),
                                               vertices, stride, nullptr, 0, nullptr, 0, is_fixed.data(), 3 * triangles,
                                               kAnyError, 0, nullptr));
#else
  // A triangle without extent at each fixed vertex: the simplifier takes the edge from a vertex to itself for a second
  // open edge there, and leaves such vertices where they are (meshoptimizer 0.18, classifyVertices). Triangles without
  // extent are not in its result.
  for (std::uint32_t i = 0; !fixed.empty() && i < vertices; ++i)
    if (fixed.contains(surface.vertices[i])) corners.insert(corners.end(), 3, i);
  std::vector<unsigned int> result(corners.size());
  result.resize(meshopt_simplify(result.data(), corners.data(), corners.size(), positions.data(), vertices, stride,
                                 3 * triangles, kAnyError, 0, nullptr));
#endif
  return result;
}

/// Collapses edges like collapse_edges(), but fixes no vertex and does not keep the topology.
std::vector<unsigned int> collapse_sloppily(const TriangleMesh& surface, std::size_t triangles) {
  const std::vector<float> positions = float_positions(surface);
  std::vector<unsigned int> corners;
  for (const Triangle& t : surface.triangles) corners.insert(corners.end(), t.begin(), t.end());
  std::vector<unsigned int> result(corners.size());
  result.resize(meshopt_simplifySloppy(result.data(), corners.data(), corners.size(), positions.data(),
                                       surface.vertices.size(), 3 * sizeof(float), 3 * triangles, 1.0F, nullptr));
  return result;
}

/// Vertex clustering (Rossignac, Borrel 1993): the vertices in a cell of a grid become the first of them, but fixed
/// ones remain.
class VertexClustering {
 public:
  VertexClustering(const TriangleMesh& surface, const FixedVertices& fixed)
      : surface_(surface), box_(geometry::bounds(surface)) {
    for (const Vec3& v : surface.vertices) is_fixed_.push_back(fixed.contains(v));
  }

  /// The finest of a series of grids that leaves no more than `triangles`, or else the coarsest.
  TriangleMesh to_count(std::size_t triangles) const {
    std::size_t low = 1, high = std::size_t{1} << 20;  // cells along the longest side
    while (high - low > std::max<std::size_t>(1, low / 64)) {
      const std::size_t middle = (low + high) / 2;
      (clustered(middle).triangles.size() <= triangles ? low : high) = middle;
    }
    return clustered(low);
  }

 private:
  TriangleMesh clustered(std::size_t cells) const {
    const double edge_m = std::max(box_.sizes().maxCoeff(), 1e-9) / static_cast<double>(cells);
    std::map<std::array<std::int64_t, 3>, std::uint32_t> first;
    std::vector<std::uint32_t> goes_to(surface_.vertices.size());
    for (std::uint32_t i = 0; i < goes_to.size(); ++i) {
      const Vec3 at = (surface_.vertices[i] - box_.min()) / edge_m;
      const auto cell = [&](int axis) { return static_cast<std::int64_t>(std::floor(at[axis])); };
      goes_to[i] = is_fixed_[i] ? i : first.try_emplace({cell(0), cell(1), cell(2)}, i).first->second;
    }
    std::vector<unsigned int> corners;
    std::set<Triangle> seen;
    for (const Triangle& t : surface_.triangles) {
      Triangle moved{goes_to[t[0]], goes_to[t[1]], goes_to[t[2]]};
      std::rotate(moved.begin(), std::min_element(moved.begin(), moved.end()), moved.end());
      if (moved[0] == moved[1] || moved[1] == moved[2] || moved[0] == moved[2] || !seen.insert(moved).second) continue;
      corners.insert(corners.end(), moved.begin(), moved.end());
    }
    return with_corners(surface_, corners);
  }

  const TriangleMesh& surface_;
  geometry::Box3 box_;
  std::vector<bool> is_fixed_;
};

}  // namespace

TriangleMesh simplify_to_count(const TriangleMesh& surface, std::size_t triangles, const FixedVertices& fixed) {
  std::vector<unsigned int> result = collapse_edges(surface, triangles, fixed);
  if (result.size() > 3 * 2 * triangles && fixed.empty()) {
    std::vector<unsigned int> sloppy = collapse_sloppily(surface, triangles);
    if (!with_corners(surface, sloppy).triangles.empty()) result = std::move(sloppy);
  }
  TriangleMesh out = with_corners(surface, result);
  if (!fixed.empty() && out.triangles.size() > 2 * triangles) {
    TriangleMesh clustered = VertexClustering(surface, fixed).to_count(triangles);
    if (!clustered.triangles.empty() && clustered.triangles.size() < out.triangles.size()) out = std::move(clustered);
  }
  return out.triangles.empty() ? surface : out;
}

}  // namespace tileflight::simplification
