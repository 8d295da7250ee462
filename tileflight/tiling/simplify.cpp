#include "tileflight/tiling/simplify.h"

#include <meshoptimizer.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <cassert>
#include <cmath>
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

double farthest_m(const std::vector<geometry::Vec3>& samples, const geometry::TriangleIndex& surface) {
  const tbb::blocked_range<std::size_t> all(0, samples.size(), 1024);
  return tbb::parallel_reduce(
      all, 0.0,
      [&](const tbb::blocked_range<std::size_t>& range, double far) {
        for (std::size_t i = range.begin(); i != range.end(); ++i)
          far = std::max(far, surface.nearest(samples[i])->distance_m);
        return far;
      },
      [](double x, double y) { return std::max(x, y); });
}

/// The middles of the n x n small triangles that cut (a, b, c) into pieces of at most `spacing_m`.
void add_samples(const geometry::Vec3& a, const geometry::Vec3& b, const geometry::Vec3& c, double spacing_m,
                 std::vector<geometry::Vec3>& samples) {
  const double longest_m = std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
  const int n = std::max(1, static_cast<int>(std::ceil(longest_m / spacing_m)));
  for (int i = 0; i < n; ++i) {
    for (int j = 0; i + j < n; ++j) {
      samples.push_back(a + (b - a) * ((i + 1.0 / 3) / n) + (c - a) * ((j + 1.0 / 3) / n));
      if (i + j + 1 < n) samples.push_back(a + (b - a) * ((i + 2.0 / 3) / n) + (c - a) * ((j + 2.0 / 3) / n));
    }
  }
}

std::vector<geometry::Vec3> samples_of(const geometry::TriangleMesh& mesh, double spacing_m) {
  std::vector<geometry::Vec3> samples = mesh.vertices;
  for (const geometry::Triangle& t : mesh.triangles)
    add_samples(mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]], spacing_m, samples);
  return samples;
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

double surface_distance_m(const geometry::TriangleMesh& coarse, const geometry::TriangleMesh& fine, double spacing_m) {
  const geometry::TriangleIndex coarse_index(coarse), fine_index(fine);
  return std::max(farthest_m(samples_of(coarse, spacing_m), fine_index), farthest_m(fine.vertices, coarse_index));
}

}  // namespace tileflight::tiling
