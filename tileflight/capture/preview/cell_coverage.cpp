#include "tileflight/capture/preview/cell_coverage.h"

#include <algorithm>

#include "tileflight/world/ground_truth/voxelize.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::preview {

void CellCoverage::add(std::uint32_t id, const tileset::LoadedContent& content) {
  const geometry::TriangleMesh mesh = scene::merge_meshes(content.meshes);
  if (mesh.triangles.empty()) return;
  geometry::VoxelGrid grid = ground_truth::voxelize(mesh, region_.box(), edge_m_);
  std::erase_if(grid.occupied, [&](const geometry::Cell& cell) { return is_outside(grid.center(cell)); });
  cells_.set(id, grid);
}

void CellCoverage::finish(const ContentIds& region_cut) {
  region_cut_ = region_cut;
  occupied_ = cells_.count_covered(region_cut, std::vector<ContentIds>{region_cut}).front();
}

double CellCoverage::largest_share(const std::vector<ContentIds>& tiles) const {
  const std::vector<std::int64_t> counts = cells_.count_covered(region_cut_, tiles);
  return occupied_ == 0 ? 0.0 : static_cast<double>(*std::ranges::max_element(counts)) / static_cast<double>(occupied_);
}

bool CellCoverage::is_outside(const geometry::Vec3& center) const {
  return !region_.parts.empty() &&
         std::ranges::none_of(region_.parts, [&](const auto& part) { return contains(part, center); });
}

}  // namespace tileflight::preview
