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
#include "tileflight/tiles/tileset/content_sample.h"
#include "tileflight/world/ground_truth/surface_samples.h"
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

/// Contents of the region that are decoded for an estimate.
constexpr std::size_t kCostProbes = 40;

/// Share of the memory limit that blocks chosen by memory may take by the estimate.
constexpr double kMemoryShare = 0.5;

/// Bytes of the files of the region's contents; below 0: the source does not know them.
double bytes_to_read(const tileset::RegionReader& reader) {
  const std::optional<std::uintmax_t> bytes = reader.file_bytes();
  return bytes ? static_cast<double>(*bytes) : -1.0;
}

}  // namespace

tileset::ContentMeasures measure_within(const std::vector<imaging::TexturedMesh>& meshes,
                                        const std::vector<geometry::PointCloud>& clouds, const Box3& box) {
  tileset::ContentMeasures out = tileset::measure_content(meshes, clouds, box);
  out.area_m2 = 0.0;  // of large triangles, only a part may lie in the box
  for (const imaging::TexturedMesh& mesh : meshes) out.area_m2 += ground_truth::area_within(mesh.mesh, box);
  return out;
}

MemoryPlan::MemoryPlan(tileset::RegionReader& reader, const ExtractSettings& settings)
    : size_(reader.placement().region.box().sizes()), voxel_m_(settings.voxel_m) {
  std::vector<tileset::ContentMeasures> measured;
  const double program_bytes = extraction_memory_bytes({}, settings.samples_per_m2);
  for (const std::size_t content : tileset::spread_sample(reader.content_count(), kCostProbes)) {
    for (const tileset::LoadedContent& loaded : reader.read({content})) {
      const Box3 region = reader.placement().region.box();
      tileset::ContentMeasures measures = measure_within(loaded.meshes, loaded.clouds, region);
      measures.file_bytes = static_cast<double>(loaded.bytes);
      measured.push_back(measures);
      Probe& probe = probes_.emplace_back();
      probe.divided_bytes = extraction_memory_bytes(measures, settings.samples_per_m2) - program_bytes;
      for (const imaging::TexturedMesh& mesh : loaded.meshes)
        probe.fixed_bytes += static_cast<double>(imaging::vertex_bytes(mesh) +
                                                 mesh.mesh.triangles.size() * sizeof(mesh.mesh.triangles[0]));
      const Box3 held = reader.found(content)->bounds.intersection(region);
      if (!held.isEmpty()) {
        probe.east_m = held.sizes().x();
        probe.north_m = held.sizes().y();
      }
    }
  }
  size_ = reader.placement().region.box().sizes();
  whole_ = estimate_extract_cost(measured, reader.estimated_count(), bytes_to_read(reader), settings.samples_per_m2);
}

/// The densest of the known contents, and the others as they are on average.
double MemoryPlan::block_bytes(double edge_m) const {
  const double wide_m = edge_m + 2 * voxel_m_;  // with the cells around it
  const auto share = [&](double side_m) { return side_m > wide_m ? wide_m / side_m : 1.0; };
  const double program_bytes = extraction_memory_bytes({}, 0.0);
  const double all = whole_.memory_bytes - program_bytes, part = share(size_.x()) * share(size_.y());
  double most = all * part;
  for (const Probe& probe : probes_) {
    const double inside = share(probe.east_m) * share(probe.north_m);
    most = std::max(most,
                    probe.fixed_bytes + probe.divided_bytes * inside + std::max(0.0, all - probe.divided_bytes) * part);
  }
  return program_bytes + most;
}

double MemoryPlan::edge_within(double bytes) const {
  constexpr double kStep = 0.95;
  double edge_m = std::max(size_.x(), size_.y());
  while (edge_m > voxel_m_ && block_bytes(edge_m) > bytes) edge_m *= kStep;
  return std::max(edge_m, voxel_m_);
}

std::uintmax_t memory_limit(const ExtractSettings& settings) {
  return settings.max_memory_bytes.value_or(base::available_memory_bytes());
}

void require_memory(const std::vector<imaging::TexturedMesh>& meshes, const std::vector<geometry::PointCloud>& clouds,
                    const Box3& box, double edge_m, const ExtractSettings& settings) {
  const double bytes = extraction_memory_bytes(measure_within(meshes, clouds, box), settings.samples_per_m2);
  const auto limit = static_cast<double>(memory_limit(settings));
  if (bytes <= limit) return;
  throw tileset::MemoryLimitExceeded(
      fetch::redact_source(settings.source),
      (edge_m > 0.0 ? "a block of " + base::trimmed_text(edge_m, 3) + " m" : std::string("the region")) +
          base::formatted(" takes about %.3g GB of memory, more than %.3g GB: ", 1e-9 * bytes, 1e-9 * limit) +
          (edge_m > 0.0 ? "choose smaller blocks (--block)" : "extract in blocks (--block auto)") +
          " or fewer samples (--samples), or raise the limit (--memory)");
}

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
  const auto limit = static_cast<double>(settings.max_memory_bytes.value_or(base::default_memory_bytes()));
  const double edge_m = MemoryPlan(reader, settings).edge_within(kMemoryShare * limit / settings.processes);
  return std::max(1, static_cast<std::int32_t>(std::floor(edge_m / settings.voxel_m + 1e-9)));
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
  reader.settle_region();
  json inputs = truth_inputs(reader, settings);
  const std::int32_t edge = choose_edge(reader, settings, inputs, BlockStore::folder_for(output));
  inputs["block"] = edge;
  const BlockGrid grid(reader.placement().region.box(), settings.voxel_m, edge);
  return {.edge_m = grid.edge_m(),
          .parts = static_cast<int>(std::min(grid.size(), static_cast<std::size_t>(std::max(1, parts)))),
          .memory_bytes = MemoryPlan(reader, settings).block_bytes(grid.edge_m()),
          .inputs_sha256 = base::sha256_hex(inputs.dump())};
}

}  // namespace tileflight::place
