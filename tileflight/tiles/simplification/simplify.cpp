#include "tileflight/tiles/simplification/simplify.h"

#include <meshoptimizer.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "tileflight/core/geometry/triangle_index.h"

namespace tileflight::simplification {
namespace {

using imaging::TexturedMesh;

/// All meshes in one array of float positions and indices, as the simplifier requires; first[i] is mesh i's first
/// vertex.
struct VertexPool {
  std::vector<float> positions;
  std::vector<unsigned int> indices;
  std::vector<std::uint32_t> first;
};

VertexPool pool_vertices(const std::vector<TexturedMesh>& meshes) {
  VertexPool pool;
  for (const TexturedMesh& m : meshes) {
    const auto first = static_cast<std::uint32_t>(pool.positions.size() / 3);
    pool.first.push_back(first);
    for (const geometry::Vec3& v : m.mesh.vertices)
      for (int axis = 0; axis < 3; ++axis) pool.positions.push_back(static_cast<float>(v[axis]));
    for (const geometry::Triangle& t : m.mesh.triangles)
      for (const std::uint32_t corner : t) pool.indices.push_back(first + corner);
  }
  pool.first.push_back(static_cast<std::uint32_t>(pool.positions.size() / 3));
  return pool;
}

std::vector<unsigned int> collapse_edges(const VertexPool& pool, double error_m) {
  const std::size_t vertices = pool.positions.size() / 3, stride = 3 * sizeof(float);
  const float scale_m = meshopt_simplifyScale(pool.positions.data(), vertices, stride);
  std::vector<unsigned int> result(pool.indices.size());
  const std::size_t count =
      meshopt_simplify(result.data(), pool.indices.data(), pool.indices.size(), pool.positions.data(), vertices, stride,
                       0, static_cast<float>(error_m) / scale_m, meshopt_SimplifyLockBorder, nullptr);
  result.resize(count);
  return result;
}

/// A copy with appearance and vertices but no triangles.
TexturedMesh without_triangles(const TexturedMesh& mesh) {
  TexturedMesh out = mesh;
  out.mesh.triangles.clear();
  return out;
}

/// A triangle, or part of one, whose distance from a surface is to be bounded.
struct TrianglePiece {
  geometry::Vec3 a, b, c;
};

/// Bounds of the maximum distance between a piece's points and the surface: `low_m` <= maximum <= `high_m`.
struct DistanceBounds {
  double low_m = 0.0, high_m = 0.0;
};

double distance_to_triangle_m(const geometry::Vec3& p, const geometry::TriangleMesh& surface, std::size_t triangle) {
  const geometry::Triangle& t = surface.triangles[triangle];
  const auto& v = surface.vertices;
  return (p - geometry::closest_point_on_triangle(p, v[t[0]], v[t[1]], v[t[2]])).norm();
}

/// More than the rounding errors of distances computed in different ways.
double with_slack_m(double distance_m) { return distance_m * (1.0 + 1e-9) + 1e-9; }

/// No point of the piece is farther from the surface: the distance to one triangle is convex, so its maximum over the
/// piece is at a corner, and the distance to the surface is no larger.
double upper_bound_m(const TrianglePiece& piece, const geometry::TriangleMesh& surface, std::size_t triangle) {
  return std::max({distance_to_triangle_m(piece.a, surface, triangle),
                   distance_to_triangle_m(piece.b, surface, triangle),
                   distance_to_triangle_m(piece.c, surface, triangle)});
}

/// `guess`: any triangle, the nearer to the piece the faster; becomes the nearest one. A piece of which no point is
/// farther than `known_m` tells nothing new: its bounds are zeros.
DistanceBounds bounds_of(const TrianglePiece& piece, const geometry::TriangleMesh& surface,
                         const geometry::TriangleIndex& index, double known_m, std::size_t& guess) {
  if (with_slack_m(upper_bound_m(piece, surface, guess)) <= known_m) return {};
  const geometry::Vec3 middle = (piece.a + piece.b + piece.c) / 3;
  double within_m = with_slack_m(distance_to_triangle_m(middle, surface, guess));
  if (!std::isfinite(within_m)) within_m = std::numeric_limits<double>::infinity();  // of a degenerate triangle
  const geometry::SurfacePoint nearest = *index.nearest(middle, within_m);
  guess = nearest.triangle;
  return {nearest.distance_m, upper_bound_m(piece, surface, nearest.triangle)};
}

void subdivide_piece(const TrianglePiece& p, std::vector<TrianglePiece>& pieces) {
  const geometry::Vec3 ab = (p.a + p.b) / 2, bc = (p.b + p.c) / 2, ca = (p.c + p.a) / 2;
  pieces.insert(pieces.end(), {{p.a, ab, ca}, {ab, p.b, bc}, {ca, bc, p.c}, {ab, bc, ca}});
}

/// Tolerance: the true distance may be smaller than the returned value by this.
double tolerance_m(double distance_m) { return std::max(1e-3, 0.01 * distance_m); }

/// Number of triangles processed together, which bounds memory.
constexpr std::size_t kTrianglesAtOnce = std::size_t{1} << 22;
/// Number of pieces between two updates of what is known, which spares others.
constexpr std::size_t kPiecesAtOnce = std::size_t{1} << 14;

/// Raises `known_m`, a lower bound attained at some point, until no piece can contain a point farther by more than the
/// tolerance: pieces that can are quartered in each round.
void raise_lower_bound(std::vector<TrianglePiece> pieces, const geometry::TriangleMesh& surface,
                       const geometry::TriangleIndex& index, double& known_m) {
  while (!pieces.empty()) {
    std::vector<DistanceBounds> bounds(pieces.size());
    for (std::size_t begin = 0; begin < pieces.size(); begin += kPiecesAtOnce) {
      const std::size_t end = std::min(pieces.size(), begin + kPiecesAtOnce);
      tbb::parallel_for(tbb::blocked_range<std::size_t>(begin, end), [&](const tbb::blocked_range<std::size_t>& range) {
        std::size_t guess = 0;  // pieces that follow each other are mostly neighbours
        for (std::size_t i = range.begin(); i < range.end(); ++i)
          bounds[i] = bounds_of(pieces[i], surface, index, known_m, guess);
      });
      for (std::size_t i = begin; i < end; ++i) known_m = std::max(known_m, bounds[i].low_m);
    }
    std::vector<TrianglePiece> open;
    for (std::size_t i = 0; i < pieces.size(); ++i)
      if (bounds[i].high_m > known_m + tolerance_m(known_m)) subdivide_piece(pieces[i], open);
    pieces = std::move(open);
  }
}

/// Upper bound, within the tolerance, of the distance from any point of `mesh` to the surface; at least `at_least_m`.
double directed_hausdorff_m(const geometry::TriangleMesh& mesh, const geometry::TriangleMesh& surface,
                            double at_least_m) {
  const geometry::TriangleIndex index(surface);
  double known_m = at_least_m;
  for (std::size_t begin = 0; begin < mesh.triangles.size(); begin += kTrianglesAtOnce) {
    const std::size_t end = std::min(mesh.triangles.size(), begin + kTrianglesAtOnce);
    std::vector<TrianglePiece> pieces;
    pieces.reserve(end - begin);
    for (std::size_t i = begin; i < end; ++i) {
      const geometry::Triangle& t = mesh.triangles[i];
      pieces.push_back({mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]});
    }
    raise_lower_bound(std::move(pieces), surface, index, known_m);
  }
  return known_m + tolerance_m(known_m);
}

}  // namespace

void drop_unused_vertices(TexturedMesh& mesh) {
  constexpr std::uint32_t kUnused = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> new_index(mesh.mesh.vertices.size(), kUnused);
  TexturedMesh kept;
  for (geometry::Triangle& t : mesh.mesh.triangles) {
    for (std::uint32_t& corner : t) {
      if (new_index[corner] == kUnused) {
        new_index[corner] = static_cast<std::uint32_t>(kept.mesh.vertices.size());
        kept.mesh.vertices.push_back(mesh.mesh.vertices[corner]);
        if (!mesh.uv.empty()) kept.uv.push_back(mesh.uv[corner]);
        if (!mesh.colors.empty()) kept.colors.push_back(mesh.colors[corner]);
      }
      corner = new_index[corner];
    }
  }
  mesh.mesh.vertices = std::move(kept.mesh.vertices);
  mesh.uv = std::move(kept.uv);
  mesh.colors = std::move(kept.colors);
}

std::vector<TexturedMesh> simplify_meshes(const std::vector<TexturedMesh>& meshes, double error_m) {
  const VertexPool pool = pool_vertices(meshes);
  const std::vector<unsigned int> indices = collapse_edges(pool, error_m);
  std::vector<TexturedMesh> out;
  for (const TexturedMesh& mesh : meshes) out.push_back(without_triangles(mesh));
  for (std::size_t i = 0; i < indices.size(); i += 3) {
    const auto owner = std::upper_bound(pool.first.begin(), pool.first.end(), indices[i]) - pool.first.begin() - 1;
    const std::uint32_t first = pool.first[static_cast<std::size_t>(owner)];
    assert(indices[i + 1] >= first && indices[i + 2] >= first);
    out[static_cast<std::size_t>(owner)].mesh.triangles.push_back(
        {indices[i] - first, indices[i + 1] - first, indices[i + 2] - first});
  }
  for (TexturedMesh& mesh : out) drop_unused_vertices(mesh);
  return out;
}

geometry::TriangleMesh merge_meshes(const std::vector<TexturedMesh>& meshes) {
  geometry::TriangleMesh out;
  for (const TexturedMesh& m : meshes) {
    const auto first = static_cast<std::uint32_t>(out.vertices.size());
    out.vertices.insert(out.vertices.end(), m.mesh.vertices.begin(), m.mesh.vertices.end());
    for (const geometry::Triangle& t : m.mesh.triangles)
      out.triangles.push_back({first + t[0], first + t[1], first + t[2]});
  }
  return out;
}

double hausdorff_distance_m(const geometry::TriangleMesh& a, const geometry::TriangleMesh& b, double at_least_m) {
  double there_m = 0.0, back_m = 0.0;
  tbb::parallel_invoke([&] { there_m = directed_hausdorff_m(a, b, at_least_m); },
                       [&] { back_m = directed_hausdorff_m(b, a, at_least_m); });
  return std::max(there_m, back_m);
}

}  // namespace tileflight::simplification
