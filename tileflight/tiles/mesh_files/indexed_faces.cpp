#include "tileflight/tiles/mesh_files/indexed_faces.h"

#include <algorithm>

#include "tileflight/core/base/srgb.h"
#include "tileflight/core/geometry/polygon.h"

namespace tileflight::mesh_files {

using imaging::TexturedMesh;

TexturedMesh VertexDeduplicator::build_mesh(const FaceGroup& group, bool with_uv) {
  TexturedMesh out;
  for (const auto& corners : group.triangles) {
    const bool has_uv =
        std::all_of(corners.begin(), corners.end(), [](const FaceCorner& c) { return c.uv != kInvalidIndex; });
    if (has_uv != with_uv) continue;
    geometry::Triangle t{};
    for (std::size_t k = 0; k < 3; ++k)
      t[k] = vertex({corners[k].position, with_uv ? corners[k].uv : kInvalidIndex}, out);
    out.mesh.triangles.push_back(t);
  }
  for (const FaceCorner& used : vertices_) newest_[used.position] = kInvalidIndex;
  vertices_.clear();
  older_.clear();
  return out;
}

std::uint32_t VertexDeduplicator::vertex(const FaceCorner& corner, TexturedMesh& out) {
  for (std::uint32_t at = newest_[corner.position]; at != kInvalidIndex; at = older_[at])
    if (vertices_[at].uv == corner.uv) return at;
  const auto index = static_cast<std::uint32_t>(vertices_.size());
  vertices_.push_back(corner);
  older_.push_back(newest_[corner.position]);
  newest_[corner.position] = index;
  out.mesh.vertices.push_back(faces_.positions[corner.position]);
  if (corner.uv != kInvalidIndex) out.uv.push_back(faces_.uv[corner.uv]);
  if (!faces_.colors.empty()) out.colors.push_back(base::linear_rgba_from_srgb(faces_.colors[corner.position]));
  return index;
}

std::size_t find_or_add_group(const std::string& material, std::map<std::string, std::size_t>& group_of,
                              IndexedFaces& faces) {
  const auto [at, is_new] = group_of.try_emplace(material, faces.groups.size());
  if (is_new) faces.groups.push_back({material, {}});
  return at->second;
}

void add_face(const std::vector<FaceCorner>& corners, const std::vector<geometry::Vec3>& positions, FaceGroup& group) {
  if (corners.size() == 3) {
    group.triangles.push_back({corners[0], corners[1], corners[2]});
    return;
  }
  std::vector<geometry::Vec3> places;
  for (const FaceCorner& c : corners) places.push_back(positions[c.position]);
  for (const auto& t : geometry::triangulate(places))
    group.triangles.push_back({corners[t[0]], corners[t[1]], corners[t[2]]});
}

}  // namespace tileflight::mesh_files
