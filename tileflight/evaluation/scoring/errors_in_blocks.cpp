#include "tileflight/evaluation/scoring/errors_in_blocks.h"

#include <utility>

#include "tileflight/evaluation/metrics/metrics_file.h"

namespace tileflight::scoring {

SurfaceDistances split_by_region(std::vector<double> distances_m, std::vector<bool> is_over) {
  SurfaceDistances split{std::move(distances_m), {}, std::move(is_over)};
  std::size_t over = 0;
  for (std::size_t i = 0; i < split.is_over.size(); ++i) {
    if (split.is_over[i]) {
      split.over_m[over++] = split.over_m[i];
    } else {
      split.off_m.push_back(split.over_m[i]);
    }
  }
  split.over_m.resize(over);
  return split;
}

void write_errors(const std::filesystem::path& ply, const MapPoints& map, const geometry::Sim3& T_local_map,
                  const std::vector<double>& voxel_m, const SurfaceDistances& surface, double cutoff_m) {
  std::size_t next = 0;
  auto over = surface.over_m.begin(), off = surface.off_m.begin();
  geometry::write_ply_in_blocks(ply, map.size(), [&] {
    metrics::PointErrors errors{geometry::transformed(T_local_map, map.read_block(next)), {}, {}};
    for (std::size_t i = 0; i < errors.aligned_map.size(); ++i, ++next) {
      errors.voxel_m.push_back(voxel_m[next]);
      if (surface.is_over.empty()) continue;
      errors.surface_m.push_back(surface.is_over[next] ? *over++ : *off++);
      errors.over_region.push_back(surface.is_over[next]);
    }
    return metrics::cloud_with_errors(std::move(errors), cutoff_m);
  });
}

}  // namespace tileflight::scoring
