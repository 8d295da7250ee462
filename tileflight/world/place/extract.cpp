#include "tileflight/world/place/extract.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "tileflight/core/base/elapsed_time.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/memory_budget.h"
#include "tileflight/core/base/number_text.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/base/version.h"
#include "tileflight/tiles/fetch/open_source.h"
#include "tileflight/tiles/tileset/region_reader.h"
#include "tileflight/world/ground_truth/suggested_voxel.h"
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

json describe(const ExtractSettings& settings, const tileset::LoadedTiles& loaded, const TruthCounts& truth) {
  return {
      {"source", fetch::redact_source(settings.source)},
      {"tiles_wanted", loaded.tiles_wanted},
      {"tiles_loaded", loaded.tiles_loaded},
      {"tiles_failed", loaded.tiles_failed},
      {"failures", loaded.failures},
      {"complete", loaded.complete},
      {"geometric_error_wanted", settings.load.error_m},
      {"geometric_error_max", loaded.geometric_error_max_m},
      {"triangles", truth.triangles},
      {"triangles_loaded", loaded.triangles},
      {"points", truth.cloud_points},
      {"bytes_read", loaded.bytes_read},
      {"cut_sha256", loaded.cut_hash},
      {"voxel_size", settings.voxel_m},
      {"voxel_dims", truth.voxel_dims},
      {"voxels_occupied", truth.voxels_occupied},
      {"surface_points", truth.surface_points},
      {"region", region_json(loaded.region)},
      {"frame", frame_json(loaded.local_frame)},
      {"attribution", loaded.attribution},
      {"terms", {{"provider", loaded.terms.provider}, {"url", loaded.terms.url}}},
      {"terms_accepted", settings.load.source.terms_accepted},
      {"warnings", collect_warnings(settings, loaded, truth)},
      {"version", base::version()},
  };
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

/// Writes extract.json, whose content is returned.
json write_description(const ExtractSettings& settings, const OpenRegion& region, const TruthCounts& truth,
                       std::chrono::steady_clock::time_point start, const std::filesystem::path& folder) {
  json result = describe(settings, region.reader.summary(), truth);
  // Errors of a perfect map, stored so that no evaluation needs to read the samples again.
  result["quantization_floor"] = truth.floor.to_json();
  result["seconds"] = {{"load", truth.load_seconds},
                       {"truth", base::seconds_since(start) - truth.load_seconds},
                       {"total", base::seconds_since(start)}};
  base::write_file(folder / "extract.json", result.dump(2) + "\n");
  return result;
}

json extract_in_blocks(const ExtractSettings& settings, const base::OutputFolder& output, const Progress& progress) {
  const auto start = std::chrono::steady_clock::now();
  if (!settings.part) base::require_writable(output);
  OpenRegion region(settings, progress);
  if (!settings.part) require_affordable(region.reader, settings, output.folder);
  TruthBlocks blocks(region.reader, settings, output.folder, progress);
  blocks.make();
  json build = {{"blocks", blocks.count()}, {"blocks_reused", blocks.reused()}};
  if (!blocks.note().empty()) build["note"] = blocks.note();
  if (settings.part) {
    build["part"] = {settings.part->number, settings.part->count};
    build["blocks_made"] = blocks.made();
    return {{"build", build}};
  }
  const TruthCounts truth = blocks.join();
  json result = write_description(settings, region, truth, start, blocks.truth_folder());
  base::install_folder(blocks.truth_folder(), output);
  blocks.remove();
  result["build"] = build;
  return result;
}

}  // namespace

base::OutputFolder extract_output(const ExtractSettings& settings, const std::filesystem::path& folder, bool replace) {
  return {.folder = folder,
          .command = "extract",
          .replace = replace,
          .inputs = {fetch::local_path_of_source(settings.source)},
          .legacy = {.key_file = "extract.json",
                     .key_text = "tiles_wanted",
                     .files = {"mesh.glb", "surface.ply", "voxels.binvox", "voxels.ply", "octree.bt", "extract.json"}}};
}

nlohmann::json extract(const ExtractSettings& settings, const std::filesystem::path& folder, bool replace,
                       const Progress& progress) {
  const base::OutputFolder output = extract_output(settings, folder, replace);
  if (settings.block_m) return extract_in_blocks(settings, output, progress);
  const auto start = std::chrono::steady_clock::now();
  base::require_writable(output);
  OpenRegion region(settings, progress);
  require_affordable(region.reader, settings, folder);
  json result;
  base::write_folder(output, [&](const std::filesystem::path& temporary) {
    const TruthCounts truth = write_whole_truth(region.reader, settings, temporary, progress);
    result = write_description(settings, region, truth, start, temporary);
  });
  return result;
}

nlohmann::json preview_extract(const ExtractSettings& settings, const std::filesystem::path& folder, bool replace,
                               const Progress& progress) {
  base::require_writable(extract_output(settings, folder, replace));
  OpenRegion region(settings, progress);
  const ExtractCost cost = estimate_cost(region.reader, settings);
  require_affordable(cost, settings, folder);
  return {{"dry_run", true},
          {"source", fetch::redact_source(settings.source)},
          {"estimate", to_json(cost)},
          {"tiles_probed", cost.tiles_probed},
          {"spread", std::isfinite(cost.spread) ? json(cost.spread) : json()},
          {"in_blocks", settings.block_m.has_value()},
          {"memory_limit_bytes", memory_limit(settings)},
          {"text", cost_text(cost)}};
}

nlohmann::json read_extract_json(const std::filesystem::path& folder) {
  const std::filesystem::path file = folder / "extract.json";
  const json result = json::parse(base::read_text(file), nullptr, false);
  if (!result.is_object())
    throw InputError(file.string(), "not a JSON object; make the folder with `tileflight extract`");
  return result;
}

json region_json(const tileset::Region& region) {
  const auto corner = [](const geometry::Vec3& v) { return json{v.x(), v.y(), v.z()}; };
  json out = {{"center", corner(region.center)}, {"size", corner(region.size)}};
  for (const geometry::Prism& part : region.parts) {
    json rings = json::array();
    for (const geometry::Ring& ring : part.base.rings()) {
      rings.push_back(json::array());
      for (const Eigen::Vector2d& point : ring) rings.back().push_back({point.x(), point.y()});
    }
    out["polygons"].push_back({{"rings", rings}, {"bottom", part.bottom_m}, {"top", part.top_m}});
  }
  return out;
}

json frame_json(const std::optional<geometry::LocalFrame>& frame) {
  if (!frame) return {{"origin_lat", nullptr}, {"origin_lon", nullptr}, {"origin_height", nullptr}};
  const geometry::Geodetic& origin = frame->origin();
  return {
      {"origin_lat", origin.latitude_deg}, {"origin_lon", origin.longitude_deg}, {"origin_height", origin.height.m}};
}

std::optional<geometry::Geodetic> origin_from_json(const nlohmann::json& extract_json) {
  const json frame = extract_json.value("frame", json::object());
  if (!frame.is_object() || !frame.contains("origin_lat") || frame["origin_lat"].is_null()) return std::nullopt;
  return geometry::Geodetic{frame.at("origin_lat").get<double>(), frame.at("origin_lon").get<double>(),
                            geometry::EllipsoidalHeight{frame.at("origin_height").get<double>()}};
}

std::map<std::string, std::string> describe_frame(const std::optional<geometry::Geodetic>& origin) {
  if (!origin) return {{"frame.kind", "tileset"}};
  return {{"frame.kind", "east-north-up"},
          {"frame.origin_lat", base::fixed_text(origin->latitude_deg)},
          {"frame.origin_lon", base::fixed_text(origin->longitude_deg)},
          {"frame.origin_height", base::fixed_text(origin->height.m)}};
}

}  // namespace tileflight::place
