#include "tileflight/tiling/simplify.h"

#include <meshoptimizer.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cassert>
#include <limits>

#include "tileflight/geometry/triangle_index.h"

namespace tileflight::tiling {
namespace {

using imaging::TexturedMesh;

/// All meshes in one array of float positions and indices, as the simplifier wants them; first[i] is mesh i's first
/// vertex.
struct Pool {
  std::vector<float> positions;
  std::vector<unsigned int> indices;
  std::vector<std::uint32_t> first;
};

Pool pooled(const std::vector<TexturedMesh>& meshes) {
  Pool pool;
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

std::vector<unsigned int> collapsed(const Pool& pool, double error_m) {
  const std::size_t vertices = pool.positions.size() / 3, stride = 3 * sizeof(float);
  const float scale_m = meshopt_simplifyScale(pool.positions.data(), vertices, stride);
  std::vector<unsigned int> result(pool.indices.size());
  const std::size_t count =
      meshopt_simplify(result.data(), pool.indices.data(), pool.indices.size(), pool.positions.data(), vertices, stride,
                       0, static_cast<float>(error_m) / scale_m, meshopt_SimplifyLockBorder, nullptr);
  result.resize(count);
  return result;
}

/// Appearance and vertices without triangles.
TexturedMesh without_triangles(const TexturedMesh& mesh) {
  TexturedMesh out = mesh;
  out.mesh.triangles.clear();
  return out;
}

/// A triangle, or a part of one, whose distance from a surface is sought.
struct Piece {
  geometry::Vec3 a, b, c;
};

/// The largest distance of a piece's points from the surface is at least `low_m` and at most `high_m`.
struct DistanceBounds {
  double low_m = 0.0, high_m = 0.0;
};

/// The distance from one triangle is convex, so over the piece it is largest at a corner; the surface is no farther
/// than that triangle.
DistanceBounds bounds_of(const Piece& piece, const geometry::TriangleMesh& surface,
                         const geometry::TriangleIndex& index) {
  const geometry::SurfacePoint nearest = *index.nearest((piece.a + piece.b + piece.c) / 3);
  const geometry::Triangle& t = surface.triangles[nearest.triangle];
  const auto from_it = [&](const geometry::Vec3& p) {
    const auto& v = surface.vertices;
    return (p - geometry::closest_point_on_triangle(p, v[t[0]], v[t[1]], v[t[2]])).norm();
  };
  return {nearest.distance_m, std::max({from_it(piece.a), from_it(piece.b), from_it(piece.c)})};
}

void add_quarters(const Piece& p, std::vector<Piece>& pieces) {
  const geometry::Vec3 ab = (p.a + p.b) / 2, bc = (p.b + p.c) / 2, ca = (p.c + p.a) / 2;
  pieces.insert(pieces.end(), {{p.a, ab, ca}, {ab, p.b, bc}, {ca, bc, p.c}, {ab, bc, ca}});
}

/// How much smaller than the value returned the true distance may be.
double tolerance_m(double distance_m) { return std::max(1e-3, 0.01 * distance_m); }

/// Triangles whose pieces are looked at together: what bounds the memory.
constexpr std::size_t kTrianglesAtOnce = std::size_t{1} << 22;

/// Raises `known_m`, a distance that some point is known to have, until no piece may hold a point that is farther by
/// more than the tolerance: pieces that may are quartered, round by round.
void raise_to_farthest(std::vector<Piece> pieces, const geometry::TriangleMesh& surface,
                       const geometry::TriangleIndex& index, double& known_m) {
  while (!pieces.empty()) {
    std::vector<DistanceBounds> bounds(pieces.size());
    tbb::parallel_for(std::size_t{0}, pieces.size(),
                      [&](std::size_t i) { bounds[i] = bounds_of(pieces[i], surface, index); });
    for (const DistanceBounds& b : bounds) known_m = std::max(known_m, b.low_m);
    std::vector<Piece> open;
    for (std::size_t i = 0; i < pieces.size(); ++i)
      if (bounds[i].high_m > known_m + tolerance_m(known_m)) add_quarters(pieces[i], open);
    pieces = std::move(open);
  }
}

/// Upper bound, within the tolerance, of the distance from any point of `mesh` to the surface, or of `at_least_m`.
double farthest_m(const geometry::TriangleMesh& mesh, const geometry::TriangleMesh& surface, double at_least_m) {
  const geometry::TriangleIndex index(surface);
  double known_m = at_least_m;
  for (std::size_t begin = 0; begin < mesh.triangles.size(); begin += kTrianglesAtOnce) {
    const std::size_t end = std::min(mesh.triangles.size(), begin + kTrianglesAtOnce);
    std::vector<Piece> pieces;
    pieces.reserve(end - begin);
    for (std::size_t i = begin; i < end; ++i) {
      const geometry::Triangle& t = mesh.triangles[i];
      pieces.push_back({mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]});
    }
    raise_to_farthest(std::move(pieces), surface, index, known_m);
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

std::vector<TexturedMesh> simplified(const std::vector<TexturedMesh>& meshes, double error_m) {
  const Pool pool = pooled(meshes);
  const std::vector<unsigned int> indices = collapsed(pool, error_m);
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

geometry::TriangleMesh joined(const std::vector<TexturedMesh>& meshes) {
  geometry::TriangleMesh out;
  for (const TexturedMesh& m : meshes) {
    const auto first = static_cast<std::uint32_t>(out.vertices.size());
    out.vertices.insert(out.vertices.end(), m.mesh.vertices.begin(), m.mesh.vertices.end());
    for (const geometry::Triangle& t : m.mesh.triangles)
      out.triangles.push_back({first + t[0], first + t[1], first + t[2]});
  }
  return out;
}

double surface_distance_m(const geometry::TriangleMesh& a, const geometry::TriangleMesh& b, double at_least_m) {
  return std::max(farthest_m(a, b, at_least_m), farthest_m(b, a, at_least_m));
}

}  // namespace tileflight::tiling
