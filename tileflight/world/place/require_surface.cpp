#include "tileflight/world/place/require_surface.h"

#include <algorithm>

#include "tileflight/core/base/input_error.h"

namespace tileflight::place {

void require_surface(const std::vector<imaging::TexturedMesh>& meshes, bool has_points, const std::string& source) {
  const auto has_triangle = [](const imaging::TexturedMesh& mesh) { return !mesh.mesh.triangles.empty(); };
  if (std::ranges::any_of(meshes, has_triangle)) return;
  if (has_points)
    throw InputError(source,
                     "contains only points there, which cannot be rendered; `extract` can turn them into voxels");
  throw InputError(source, "contains no triangle there; is the region empty?");
}

std::vector<imaging::TexturedMesh> with_placeholder(std::vector<imaging::TexturedMesh> meshes) {
  if (!meshes.empty()) return meshes;
  imaging::TexturedMesh nothing;
  nothing.mesh.vertices.assign(3, geometry::Vec3::Zero());
  nothing.mesh.triangles.push_back({0, 1, 2});
  return {nothing};
}

}  // namespace tileflight::place
