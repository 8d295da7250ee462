#include "tileflight/simplification/surface_simplification.h"

#include <meshoptimizer.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <numeric>
#include <optional>
#include <unordered_map>

#include "tileflight/simplification/simplify.h"

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
class VertexGrid {
 public:
  explicit VertexGrid(const TriangleMesh& mesh, double radius_m) : mesh_(mesh), radius_m_(radius_m) {}

  /// The nearest vertex in the grid within the radius.
  std::optional<std::uint32_t> nearest(std::uint32_t vertex) const {
    std::optional<std::uint32_t> best;
    double best_m = radius_m_;
    const Cell middle = cell_of(vertex);
    for (int i = 0; i < 27; ++i) {
      const auto found = cells_.find({middle[0] + i / 9 - 1, middle[1] + i / 3 % 3 - 1, middle[2] + i % 3 - 1});
      if (found == cells_.end()) continue;
      for (const std::uint32_t other : found->second) {
        const double distance_m = (mesh_.vertices[other] - mesh_.vertices[vertex]).norm();
        if (distance_m > best_m) continue;
        best = other;
        best_m = distance_m;
      }
    }
    return best;
  }

  void add(std::uint32_t vertex) { cells_[cell_of(vertex)].push_back(vertex); }

 private:
  using Cell = std::array<std::int64_t, 3>;

  Cell cell_of(std::uint32_t vertex) const {
    Cell out{};
    for (int axis = 0; axis < 3; ++axis)
      out[static_cast<std::size_t>(axis)] =
          static_cast<std::int64_t>(std::floor(mesh_.vertices[vertex][axis] / radius_m_));
    return out;
  }

  const TriangleMesh& mesh_;
  double radius_m_;
  std::map<Cell, std::vector<std::uint32_t>> cells_;
};

}  // namespace

TriangleMesh join_borders(const TriangleMesh& surface, double within_m) {
  const std::vector<bool> is_border = on_border(surface);
  VertexGrid places(surface, std::max(within_m, 1e-9));
  std::vector<std::uint32_t> goes_to(surface.vertices.size());
  for (std::uint32_t i = 0; i < goes_to.size(); ++i) {
    const std::optional<std::uint32_t> near = is_border[i] ? places.nearest(i) : std::nullopt;
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

TriangleMesh simplify_to_count(const TriangleMesh& surface, std::size_t triangles) {
  const std::vector<float> positions = float_positions(surface);
  const std::size_t vertices = surface.vertices.size(), stride = 3 * sizeof(float);
  std::vector<unsigned int> indices;
  for (const Triangle& t : surface.triangles) indices.insert(indices.end(), t.begin(), t.end());
  std::vector<unsigned int> result(indices.size());
  constexpr float kAnyError = 1.0F;  // the whole extent: only the number of triangles limits the simplification
  result.resize(meshopt_simplify(result.data(), indices.data(), indices.size(), positions.data(), vertices, stride,
                                 3 * triangles, kAnyError, 0, nullptr));
  if (result.size() > 3 * 2 * triangles) {
    std::vector<unsigned int> sloppy(indices.size());
    sloppy.resize(meshopt_simplifySloppy(sloppy.data(), indices.data(), indices.size(), positions.data(), vertices,
                                         stride, 3 * triangles, kAnyError, nullptr));
    if (!with_corners(surface, sloppy).triangles.empty()) result = std::move(sloppy);
  }
  TriangleMesh out = with_corners(surface, result);
  return out.triangles.empty() ? surface : out;
}

}  // namespace tileflight::simplification
