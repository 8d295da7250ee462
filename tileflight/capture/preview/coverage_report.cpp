#include "tileflight/capture/preview/coverage_report.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "tileflight/core/base/version.h"
#include "tileflight/tiles/fetch/open_source.h"
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

namespace {

using nlohmann::json;

double mean_share(const StrategyResult& strategy_result, std::int64_t PixelCounts::*which) {
  double sum = 0.0;
  for (const PixelCounts& shares : strategy_result.shares) sum += shares.share(shares.*which);
  return sum / static_cast<double>(strategy_result.shares.size());
}

json describe(const StrategyResult& strategy_result, const FrameSampling& watch, const CoverageContents& contents) {
  std::set<std::uint32_t> distinct;
  std::size_t most = 0;
  std::int64_t memory = 0, bytes = 0;
  for (const ContentIds& ids : strategy_result.tiles) {
    std::int64_t at_once = 0;
    for (const std::uint32_t id : ids) at_once += contents.facts(id).decoded_bytes;
    memory = std::max(memory, at_once);
    most = std::max(most, ids.size());
    distinct.insert(ids.begin(), ids.end());
  }
  for (const std::uint32_t id : distinct) bytes += contents.facts(id).bytes;
  const std::size_t worst = worst_frame(strategy_result);
  const PixelCounts& at_worst = strategy_result.shares[worst];
  return {{"about", strategy_result.strategy.description},
          {"tiles", distinct.size()},
          {"tiles_at_once", most},
          {"bytes", bytes},
          {"memory_bytes", memory},
          {"right", mean_share(strategy_result, &PixelCounts::right)},
          {"coarser", mean_share(strategy_result, &PixelCounts::coarser)},
          {"missing", mean_share(strategy_result, &PixelCounts::missing)},
          {"missing_worst", at_worst.share(at_worst.missing)},
          {"missing_worst_frame", watch.frames[worst]},
          {"cells_share", strategy_result.cells_share}};
}

}  // namespace

json result_json(const CoverageSettings& settings, const FrameSampling& watch, const std::vector<StrategyResult>& all,
                 const CoverageContents& contents, const ContentIds& truth, const CellCoverage& cells) {
  json result{{"source", fetch::redact_source(settings.source)},
              {"flight", settings.flight.string()},
              {"frames", watch.trajectory.size()},
              {"frames_looked_at", watch.frames.size()},
              {"error_px", settings.error_px},
              {"geometric_error_wanted", settings.load.error_m},
              {"tiles_seen", truth.size()},
              {"voxel_size", settings.voxel_m},
              {"voxels_occupied", cells.occupied()},
              {"version", base::version()}};
  for (const StrategyResult& strategy_result : all)
    result["strategies"][strategy_result.strategy.name] = describe(strategy_result, watch, contents);
  return result;
}

std::string frames_csv(const std::vector<StrategyResult>& all, const FrameSampling& watch) {
  std::ostringstream csv;
  csv << "frame,time_s,strategy,pixels,right,coarser,missing\n";
  for (std::size_t i = 0; i < watch.frames.size(); ++i) {
    for (const StrategyResult& strategy_result : all) {
      const PixelCounts& s = strategy_result.shares[i];
      csv << watch.frames[i] << ',' << watch.trajectory.poses[watch.frames[i]].time_s << ','
          << strategy_result.strategy.name << ',' << s.pixels << ',' << s.right << ',' << s.coarser << ',' << s.missing
          << '\n';
    }
  }
  return csv.str();
}

}  // namespace tileflight::preview
