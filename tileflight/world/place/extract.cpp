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

/// Contents of the region that are decoded for an estimate.
constexpr std::size_t kCostProbes = 40;

/// Bytes of the files of the region's contents; below 0: the source does not know them.
double bytes_to_read(const tileset::RegionReader& reader) {
  const std::optional<std::uintmax_t> bytes = reader.file_bytes();
  return bytes ? static_cast<double>(*bytes) : -1.0;
}

ExtractCost estimate_cost(tileset::RegionReader& reader, const ExtractSettings& settings) {
  const std::vector<std::size_t> contents = tileset::spread_sample(reader.content_count(), kCostProbes);
  std::vector<tileset::ContentMeasures> probes;
  for (const std::size_t content : contents) {
    for (const tileset::LoadedContent& loaded : reader.read({content})) {
      probes.push_back(tileset::measure_content(loaded.meshes, loaded.clouds, reader.placement().region.box()));
      probes.back().file_bytes = static_cast<double>(loaded.bytes);
    }
  }
  return estimate_extract_cost(probes, static_cast<double>(reader.content_count()), bytes_to_read(reader),
                               settings.samples_per_m2);
}

std::uintmax_t memory_limit(const ExtractSettings& settings) {
  return settings.max_memory_bytes.value_or(base::available_memory_bytes());
}

void require_affordable(const ExtractCost& cost, const ExtractSettings& settings, const std::filesystem::path& folder) {
  if (settings.block_m) return require_disk_space(cost, folder);
  require_affordable(cost, memory_limit(settings), folder);
}

/// Whether the files are so small that memory suffices whatever they hold, or so few from a server that they are not
/// worth fetching twice: then nothing is probed.
bool is_surely_affordable(const tileset::RegionReader& reader, const ExtractSettings& settings) {
  constexpr double kLargestRatio = 1000.0;  // of memory to file size
  constexpr double kSmall_bytes = 4e6;      // mesh.glb and the disk suffice, too
  const double bytes = bytes_to_read(reader);
  if (bytes < 0.0) return reader.content_count() < 10 * kCostProbes;
  return bytes < kSmall_bytes && kLargestRatio * bytes < static_cast<double>(memory_limit(settings));
}

/// Throws InputError if memory, disk or the largest size of a GLB certainly do not suffice.
void require_affordable(tileset::RegionReader& reader, const ExtractSettings& settings,
                        const std::filesystem::path& folder) {
  if (!is_surely_affordable(reader, settings)) require_affordable(estimate_cost(reader, settings), settings, folder);
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

Extraction extract_in_blocks(const ExtractSettings& settings, const base::OutputFolder& output,
                             const Progress& progress) {
  const auto start = std::chrono::steady_clock::now();
  if (!settings.part) base::require_writable(output);
  OpenRegion region(settings, progress);
  if (!settings.part) require_affordable(region.reader, settings, output.folder);
  TruthBlocks blocks(region.reader, settings, output.folder, progress);
  blocks.make();
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
  const ExtractCost cost = estimate_cost(region.reader, settings);
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
