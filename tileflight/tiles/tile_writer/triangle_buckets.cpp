#include "tileflight/tiles/tile_writer/triangle_buckets.h"

#include <array>
#include <bit>
#include <unordered_map>

#include "tileflight/core/base/random_numbers.h"

namespace tileflight::tile_writer {
namespace {

using imaging::TexturedMesh;

/// Triangles of one material as a mesh: corners that are equal in all are one vertex.
class MeshOfTriangles {
 public:
  explicit MeshOfTriangles(const mesh_files::SurfaceAppearance& look) : look_(look) {
    mesh_.texture = look.texture;
    mesh_.wrap_u = look.wrap_u;
    mesh_.wrap_v = look.wrap_v;
    mesh_.base_color = look.base_color;
  }

  void add(const mesh_files::SourceTriangle& triangle) {
    geometry::Triangle t{};
    for (std::size_t k = 0; k < 3; ++k) t[k] = vertex(triangle, k);
    mesh_.mesh.triangles.push_back(t);
  }

  TexturedMesh take() { return std::move(mesh_); }

 private:
  using Key = std::array<std::uint64_t, 5>;  ///< the bits of position, texture coordinates and colour
  struct Hash {
    std::size_t operator()(const Key& key) const {
      std::uint64_t hash = 0;
      for (const std::uint64_t part : key) hash = base::splitmix64_hash(hash ^ part);
      return static_cast<std::size_t>(hash);
    }
  };

  std::uint32_t vertex(const mesh_files::SourceTriangle& triangle, std::size_t k) {
    Key key{};
    for (std::size_t axis = 0; axis < 3; ++axis) key[axis] = std::bit_cast<std::uint64_t>(triangle.position[k][axis]);
    key[3] = std::bit_cast<std::uint64_t>(triangle.uv[k]);
    key[4] = std::bit_cast<std::uint32_t>(triangle.color[k]);
    const auto [at, is_new] = index_of_.try_emplace(key, static_cast<std::uint32_t>(mesh_.mesh.vertices.size()));
    if (!is_new) return at->second;
    mesh_.mesh.vertices.push_back(triangle.corner(k));
    if (look_.texture) mesh_.uv.emplace_back(triangle.uv[k].data());
    if (look_.has_colors) mesh_.colors.push_back(triangle.color[k]);
    return at->second;
  }

  const mesh_files::SurfaceAppearance& look_;
  TexturedMesh mesh_;
  std::unordered_map<Key, std::uint32_t, Hash> index_of_;
};

}  // namespace

std::vector<TexturedMesh> meshes_of(std::vector<mesh_files::SourceTriangle> triangles,
                                    const std::vector<mesh_files::SurfaceAppearance>& materials) {
  std::stable_sort(triangles.begin(), triangles.end(),
                   [](const mesh_files::SourceTriangle& a, const mesh_files::SourceTriangle& b) { return a.material < b.material; });
  std::vector<TexturedMesh> out;
  for (std::size_t i = 0; i < triangles.size();) {
    const std::uint32_t material = triangles[i].material;
    MeshOfTriangles mesh(materials[material]);
    for (; i < triangles.size() && triangles[i].material == material; ++i) mesh.add(triangles[i]);
    out.push_back(mesh.take());
  }
  return out;
}

}  // namespace tileflight::tile_writer
