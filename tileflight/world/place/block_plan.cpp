#include "tileflight/world/place/block_plan.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/memory_budget.h"
#include "tileflight/core/base/program.h"
#include "tileflight/tiles/fetch/open_source.h"
#include "tileflight/world/ground_truth/voxelize.h"
#include "tileflight/world/place/block_store.h"

namespace tileflight::place {

using geometry::Box3;
using geometry::Vec3;

BlockGrid::BlockGrid(const Box3& region, double voxel_m, std::int32_t edge)
    : region_(region), voxel_m_(voxel_m), edge_(edge), dims_(ground_truth::grid_dims(region, voxel_m)) {
  constexpr double kMostBlocks = 1e6;
  if (std::ceil(static_cast<double>(dims_[0]) / edge) * std::ceil(static_cast<double>(dims_[1]) / edge) > kMostBlocks) {
    throw InputError("--block " + base::trimmed_text(edge_m(), 3) + " m",
                     "would give more than a million blocks: choose a larger edge, in metres");
  }
  for (std::int32_t x = 0; x < dims_[0]; x += edge) {
    for (std::int32_t y = 0; y < dims_[1]; y += edge)
      blocks_.push_back(
          {{x, y, 0}, {std::min(x + edge, dims_[0]) - 1, std::min(y + edge, dims_[1]) - 1, dims_[2] - 1}});
  }
}

std::string BlockGrid::name(std::size_t block) const {
  return base::formatted("x%05d_y%05d", blocks_[block].low[0] / edge_, blocks_[block].low[1] / edge_);
}

Box3 BlockGrid::reach(std::size_t block, std::int32_t border) const {
  const auto corner = [&](const std::array<std::int32_t, 3>& cell, double shift) {
    return Vec3(region_.min() + voxel_m_ * (Vec3(cell[0], cell[1], cell[2]) + Vec3::Constant(shift)));
  };
  return {corner(blocks_[block].low, -border - 0.6), corner(blocks_[block].high, border + 1.6)};
}

Box3 BlockGrid::bounds(std::size_t block) const {
  const Box3 own = reach(block, 0);
  const Vec3 slack = Vec3::Constant(0.6 * voxel_m_);
  return {own.min() + slack, own.max() - slack};
}

std::int32_t edge_in_cells(double edge_m, double voxel_m) {
  return static_cast<std::int32_t>(std::clamp(std::round(edge_m / voxel_m), 1.0, static_cast<double>(1 << 24)));
}

using geometry::Vec3;
using nlohmann::json;

namespace {

/// Memory that the truth of a content takes while it is made, as a multiple of memory_bytes: copies of its triangles,
/// samples, voxels and files.
constexpr double kTruthMemory = 3.0;

/// Share of the default memory limit that blocks chosen by memory may take on average: some hold more.
constexpr double kMemoryShare = 0.5;

/// Memory of a content once it is read, bytes: the mean of a few.
double mean_content_bytes(tileset::RegionReader& reader) {
  constexpr std::size_t kProbes = 8;
  const std::size_t contents = reader.content_count(), probes = std::min(kProbes, contents);
  double bytes = 0.0;
  for (std::size_t k = 0; k < probes; ++k) {
    for (const tileset::LoadedContent& content : reader.read({k * contents / probes})) {
      for (const imaging::TexturedMesh& mesh : content.meshes) {
        bytes += static_cast<double>(tileset::memory_bytes(mesh));
        if (mesh.texture) bytes += static_cast<double>(mesh.texture->pixels.size() * sizeof(imaging::Rgb8));
      }
      for (const geometry::PointCloud& cloud : content.clouds)
        bytes += static_cast<double>(cloud.size() * sizeof(Vec3));
    }
  }
  return bytes / static_cast<double>(std::max<std::size_t>(1, probes));
}

/// A block's edge, metres, for which the average block takes that share of the memory, estimated from a few contents.
double edge_by_memory(tileset::RegionReader& reader, const ExtractSettings& settings) {
  const Vec3 size = reader.placement().region.box().sizes();
  const double whole = mean_content_bytes(reader) * static_cast<double>(reader.content_count());
  const double share = kMemoryShare *
                       static_cast<double>(settings.max_memory_bytes.value_or(base::default_memory_bytes())) /
                       (settings.processes * kTruthMemory * whole);
  return std::min(std::max(size.x(), size.y()), std::sqrt(size.x() * size.y() * share));
}

}  // namespace

json truth_inputs(const tileset::RegionReader& reader, const ExtractSettings& settings) {
  return {{"program", base::program_fingerprint()},
          {"source", fetch::redact_source(settings.source)},
          {"tiles", reader.cut_hash()},
          {"region", base::sha256_hex(region_json(reader.placement().region).dump())},
          {"frame", frame_json(reader.placement().local_frame)},
          {"voxel", settings.voxel_m},
          {"samples", settings.samples_per_m2},
          {"textures", settings.load.textures},
          {"incomplete tiles", settings.load.allow_incomplete}};
}

std::int32_t choose_edge(tileset::RegionReader& reader, const ExtractSettings& settings, const json& inputs,
                         const std::filesystem::path& store) {
  if (*settings.block_m > 0.0) return edge_in_cells(*settings.block_m, settings.voxel_m);
  json before = jobs::BuildFolder::read_inputs(store);
  if (before.is_object() && before.contains("block") && before["block"].is_number_integer()) {
    const auto edge = before["block"].get<std::int32_t>();
    before.erase("block");
    if (before == inputs && edge > 0) return edge;
  }
  return edge_in_cells(edge_by_memory(reader, settings), settings.voxel_m);
}

std::vector<double> block_costs(const tileset::RegionReader& reader, const BlockGrid& grid) {
  constexpr double kEmptyBlock = 0.01;
  std::vector<double> costs;
  for (std::size_t i = 0; i < grid.size(); ++i)
    costs.push_back(kEmptyBlock + static_cast<double>(reader.contents_in(grid.reach(i, 1)).size()));
  return costs;
}

BlockPlan plan_truth_blocks(const ExtractSettings& settings, const std::filesystem::path& output, int parts) {
  const auto source = fetch::open_source(settings.source, settings.load.source);
  tileset::LoadOptions load = settings.load;
  load.uses = {fetch::Use::kExtract};
  tileset::RegionReader reader(*source, fetch::redact_source(settings.source), load);
  json inputs = truth_inputs(reader, settings);
  const std::int32_t edge = choose_edge(reader, settings, inputs, BlockStore::folder_for(output));
  inputs["block"] = edge;
  const BlockGrid grid(reader.placement().region.box(), settings.voxel_m, edge);
  const std::vector<double> costs = block_costs(reader, grid);
  return {.edge_m = grid.edge_m(),
          .parts = static_cast<int>(std::min(grid.size(), static_cast<std::size_t>(std::max(1, parts)))),
          .memory_bytes = kTruthMemory * mean_content_bytes(reader) * std::ranges::max(costs),
          .inputs_sha256 = base::sha256_hex(inputs.dump())};
}

}  // namespace tileflight::place
