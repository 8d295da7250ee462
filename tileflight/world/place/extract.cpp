#include "tileflight/world/place/extract.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/memory_budget.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/base/program.h"
#include "tileflight/core/base/progress.h"
#include "tileflight/tiles/fetch/open_source.h"
#include "tileflight/tiles/tileset/region_reader.h"
#include "tileflight/world/ground_truth/voxelize.h"
#include "tileflight/world/place/block_plan.h"
#include "tileflight/world/place/extract_cost.h"
#include "tileflight/world/place/truth_blocks.h"

namespace tileflight::place {
namespace {

using nlohmann::json;

std::vector<std::string> collect_warnings(const ExtractSettings& settings, const tileset::LoadedTiles& loaded,
                                          const TruthCounts& truth) {
  std::vector<std::string> warnings = loaded.warnings;
  const geometry::Box3 inside = truth.extent.intersection(loaded.region.box());
  const geometry::Vec3 size =
      inside.isEmpty() ? geometry::Vec3(geometry::Vec3::Zero()) : geometry::Vec3(inside.sizes());
  if (const auto line = ground_truth::coarse_voxel_warning(size, settings.voxel_m)) warnings.push_back(*line);
  return warnings;
}

ExtractResult describe(const ExtractSettings& settings, const tileset::LoadedTiles& loaded, const TruthCounts& truth,
                       std::chrono::steady_clock::time_point start) {
  const double error_m = loaded.geometric_error_max_m;
  return {.source = fetch::redact_source(settings.source),
          .tiles_wanted = loaded.tiles_wanted,
          .tiles_loaded = loaded.tiles_loaded,
          .tiles_failed = loaded.tiles_failed,
          .failures = loaded.failures,
          .complete = loaded.complete,
          .geometric_error_wanted_m = settings.load.error_m,
          .geometric_error_max_m = std::isfinite(error_m) ? std::optional(error_m) : std::nullopt,
          .triangles = static_cast<std::int64_t>(truth.triangles),
          .triangles_loaded = loaded.triangles,
          .points = static_cast<std::int64_t>(truth.cloud_points),
          .bytes_read = loaded.bytes_read,
          .cut_sha256 = loaded.cut_hash,
          .voxel_m = settings.voxel_m,
          .voxel_dims = truth.voxel_dims,
          .voxels_occupied = static_cast<std::int64_t>(truth.voxels_occupied),
          .surface_points = static_cast<std::int64_t>(truth.surface_points),
          .region = loaded.region,
          .origin = loaded.local_frame ? std::optional(loaded.local_frame->origin()) : std::nullopt,
          .attribution = loaded.attribution,
          .terms_provider = loaded.terms.provider,
          .terms_url = loaded.terms.url,
          .terms_accepted = settings.load.source.terms_accepted,
          .warnings = collect_warnings(settings, loaded, truth),
          .version = base::version(),
          .seconds = {.load_s = truth.load_seconds,
                      .truth_s = base::seconds_since(start) - truth.load_seconds,
                      .total_s = base::seconds_since(start)},
          .quantization_floor = truth.floor.statistics()};
}

void require_affordable(const ExtractCost& cost, const ExtractSettings& settings, const std::filesystem::path& folder) {
  if (settings.block_m) return require_disk_space(cost, folder);
  require_affordable(cost, memory_limit(settings), folder);
}

/// Throws InputError if blocks of the edge that was asked for are estimated to take too much memory.
void require_blocks_fit(const MemoryPlan& plan, const ExtractSettings& settings) {
  const double edge_m = *settings.block_m, bytes = plan.block_bytes(edge_m);
  const auto limit = static_cast<double>(memory_limit(settings));
  const double spread = plan.whole().spread;
  if (std::max(0.0, 1.0 - spread) * bytes <= limit) return;
  throw InputError(
      "--block " + base::trimmed_text(edge_m, 3),
      base::formatted("would take about %.3g GB of memory, more than %.3g GB: choose at most %.0f m, or raise "
                      "the limit (--memory)",
                      1e-9 * bytes, 1e-9 * limit, std::floor(plan.edge_within(limit))));
}

/// Throws InputError if memory, disk or the largest size of a GLB certainly do not suffice. Few tiles from a server are
/// not worth fetching twice; what they take is checked once they are read.
void require_affordable(tileset::RegionReader& reader, const ExtractSettings& settings,
                        const std::filesystem::path& folder) {
  constexpr std::size_t kFew = 400;
  require_program_memory(memory_limit(settings), folder);
  if (!reader.file_bytes() && reader.content_count() < kFew) return;
  const MemoryPlan plan(reader, settings);
  require_affordable(plan.whole(), settings, folder);
  if (settings.block_m && *settings.block_m > 0.0) require_blocks_fit(plan, settings);
}

/// A source with its region.
struct OpenRegion {
  OpenRegion(const ExtractSettings& settings, const Progress& progress)
      : files(fetch::open_source(settings.source, settings.load.source)),
        reader(*files, fetch::redact_source(settings.source), with_use(settings.load), progress) {}

  static tileset::LoadOptions with_use(tileset::LoadOptions load) {
    load.uses = {fetch::Use::kExtract};
    return load;
  }

  std::unique_ptr<fetch::TileSource> files;
  tileset::RegionReader reader;
};

/// Makes the blocks; those whose edge is chosen by memory are made smaller if one takes more than estimated.
std::unique_ptr<TruthBlocks> make_blocks(tileset::RegionReader& reader, ExtractSettings& settings,
                                         const base::OutputFolder& output, const Progress& progress) {
  const bool may_divide = *settings.block_m == 0.0 && !settings.part;
  while (true) {
    auto blocks = std::make_unique<TruthBlocks>(reader, settings, output.folder, progress);
    const double edge_m = blocks->edge_m();
    try {
      blocks->make();
      return blocks;
    } catch (const tileset::MemoryLimitExceeded&) {
      if (!may_divide || edge_m <= settings.voxel_m) throw;
      settings.block_m = edge_m / 2;
    }
  }
}

Extraction extract_in_blocks(ExtractSettings settings, const base::OutputFolder& output, const Progress& progress) {
  const auto start = std::chrono::steady_clock::now();
  if (!settings.part) base::require_writable(output);
  OpenRegion region(settings, progress);
  region.reader.settle_region(progress);
  if (!settings.part) require_affordable(region.reader, settings, output.folder);
  const std::unique_ptr<TruthBlocks> made = make_blocks(region.reader, settings, output, progress);
  TruthBlocks& blocks = *made;
  BlockBuild build{.blocks = blocks.count(), .blocks_reused = blocks.reused(), .note = blocks.note()};
  if (settings.part) {
    build.part = settings.part;
    build.blocks_made = blocks.made();
    return {std::nullopt, build};
  }
  const TruthCounts truth = blocks.join();
  const ExtractResult result = describe(settings, region.reader.summary(), truth, start);
  write_extract_json(result, blocks.truth_folder());
  base::install_folder(blocks.truth_folder(), output);
  blocks.remove();
  return {result, build};
}

}  // namespace

base::OutputFolder extract_output(const ExtractSettings& settings, const std::filesystem::path& folder, bool replace) {
  return {.folder = folder,
          .command = "extract",
          .replace = replace,
          .inputs = {fetch::local_path_of_source(settings.source)}};
}

Extraction extract(const ExtractSettings& settings, const std::filesystem::path& folder, bool replace,
                   const Progress& progress) {
  const base::OutputFolder output = extract_output(settings, folder, replace);
  if (settings.block_m) return extract_in_blocks(settings, output, progress);
  const auto start = std::chrono::steady_clock::now();
  base::require_writable(output);
  OpenRegion region(settings, progress);
  require_affordable(region.reader, settings, folder);
  Extraction made;
  base::write_folder(output, [&](const std::filesystem::path& temporary) {
    const TruthCounts truth = write_whole_truth(region.reader, settings, temporary, progress);
    made.result = describe(settings, region.reader.summary(), truth, start);
    write_extract_json(*made.result, temporary);
  });
  return made;
}

json to_json(const Extraction& extraction) {
  json about = extraction.result ? to_json(*extraction.result) : json();
  if (!extraction.build) return about;
  const BlockBuild& build = *extraction.build;
  json& out = about["build"];
  out = {{"blocks", build.blocks}, {"blocks_reused", build.blocks_reused}};
  if (!build.note.empty()) out["note"] = build.note;
  if (build.part) {
    out["part"] = {build.part->number, build.part->count};
    out["blocks_made"] = build.blocks_made;
  }
  return about;
}

ExtractPreview preview_extract(const ExtractSettings& settings, const std::filesystem::path& folder, bool replace,
                               const Progress& progress) {
  base::require_writable(extract_output(settings, folder, replace));
  OpenRegion region(settings, progress);
  const ExtractCost cost = MemoryPlan(region.reader, settings).whole();
  require_affordable(cost, settings, folder);
  return {.source = fetch::redact_source(settings.source),
          .cost = cost,
          .in_blocks = settings.block_m.has_value(),
          .memory_limit_bytes = memory_limit(settings)};
}

json to_json(const ExtractPreview& preview) {
  const ExtractCost& cost = preview.cost;
  return {{"dry_run", true},
          {"source", preview.source},
          {"estimate", to_json(cost)},
          {"tiles_probed", cost.tiles_probed},
          {"spread", std::isfinite(cost.spread) ? json(cost.spread) : json()},
          {"in_blocks", preview.in_blocks},
          {"memory_limit_bytes", preview.memory_limit_bytes},
          {"text", cost_text(cost)}};
}

}  // namespace tileflight::place
