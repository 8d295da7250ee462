#include "tileflight/tiles/tileset/inspect.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <iomanip>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "command.h"
#include "input_options.h"
#include "tileflight/capture/preview/inspect_map.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/fetch/open_source.h"
#include "tileflight/world/place/extract.h"
#include "tileflight/world/place/extract_cost.h"
#include "tileflight/world/place/ground_heights.h"

namespace tileflight::app {
namespace {

/// Options of `inspect` that read the tiles' content.
struct InspectPlaceOptions {
  RegionOptions region;
  std::string map;  ///< image to write; empty: none
  int pixels = 1100;
  double memory_gb = 0.0;
  std::vector<std::string> at, at_local;  ///< points whose heights are queried
};

bool asks_heights(const InspectPlaceOptions& options) { return !options.at.empty() || !options.at_local.empty(); }

/// Merges two results: lists are concatenated without duplicates.
void merge(const nlohmann::json& more, nlohmann::json& all) {
  for (const auto& [key, value] : more.items()) {
    if (!value.is_array() || !all.contains(key) || !all[key].is_array()) {
      all[key] = value;
      continue;
    }
    for (const auto& line : value) {
      if (std::find(all[key].begin(), all[key].end(), line) == all[key].end()) all[key].push_back(line);
    }
  }
}

void draw_map(const std::string& source, const tileset::LoadOptions& load, const CLI::App& command,
              const InspectPlaceOptions& options, Output& output, const Progress& progress) {
  preview::InspectMapSettings settings{.source = source, .load = load, .error_m = {}, .longer_side_px = options.pixels};
  if (command.get_option("--error")->count() > 0) settings.error_m = options.region.error_m;
  if (options.memory_gb > 0) settings.max_memory_bytes = static_cast<std::uintmax_t>(options.memory_gb * 1e9);
  const nlohmann::json found = preview::inspect_map(settings, options.map, progress);
  merge(found, output.json);
  output.text += preview::inspect_map_text(found);
}

void ask_heights(const std::string& source, const tileset::LoadOptions& load, const InspectPlaceOptions& options,
                 Output& output, const Progress& progress) {
  std::vector<place::GroundQuery> points;
  for (const std::string& text : options.at) points.push_back(place::parse_geodetic_query(text));
  for (const std::string& text : options.at_local) points.push_back(place::parse_local_query(text));
  const nlohmann::json found = place::ground_heights({source, load}, points, progress);
  output.text += place::ground_heights_text(found);
  nlohmann::json part{{"points", found["points"]},
                      {"points_read", {{"tiles", found["tiles"]}, {"bytes", found["bytes_read"]}}},
                      {"frame", found["frame"]},
                      {"attribution", found["attribution"]},
                      {"warnings", found["warnings"]}};
  merge(part, output.json);
}

void add_inspect_place_options(CLI::App& command, InspectPlaceOptions& options) {
  command.add_option("--map", options.map,
                     "image (.png, .jpg) to write: the place from above with its grid, heights and gaps; also proposes "
                     "a region and a voxel size");
  command.add_option("--pixels", options.pixels, "length of the map's longer side, pixels (default 1100)");
  command.add_option("--memory", options.memory_gb, "memory limit for tiles, GB (default: half of the machine's)")
      ->check(CLI::PositiveNumber);
  command
      .add_option("--at", options.at, "LAT,LON of a point where to print the ground heights, degrees (may be repeated)")
      ->allow_extra_args(false);
  command
      .add_option("--at-local", options.at_local, "X,Y of such a point in the local frame, metres (may be repeated)")
      ->allow_extra_args(false);
  add_region_options(command, options.region);
}

void check_inspect_place(const CLI::App& command, const InspectPlaceOptions& options) {
  for (const char* option : {"--center", "--center-local", "--size", "--region", "--error", "--pixels", "--memory"}) {
    if (command.get_option(option)->count() > 0 && options.map.empty())
      throw InputError(option, "needs a map: add --map FILE.png");
  }
  if (command.get_option("--origin")->count() > 0 && options.map.empty() && !asks_heights(options))
    throw InputError("--origin", "needs a map or a point: add --map FILE.png, --at or --at-local");
}

/// Whether the whole tree is traversed as well: not if only heights are queried, nor for the map of a place on a
/// server, whose tree may be unbounded.
bool tells_whole_tileset(const InspectPlaceOptions& options, const std::string& source) {
  if (options.map.empty()) return !asks_heights(options);
  return !fetch::is_network_source(source);
}

/// Adds the results for the map and the points.
void inspect_place(const std::string& source, const fetch::SourceOptions& source_options, const CLI::App& command,
                   const InspectPlaceOptions& options, Output& output, const Progress& progress) {
  if (options.map.empty() && !asks_heights(options)) return;
  tileset::LoadOptions load = load_options(options.region);
  load.source = source_options;
  if (!options.map.empty()) draw_map(source, load, command, options, output, progress);
  if (asks_heights(options)) ask_heights(source, load, options, output, progress);
}

using nlohmann::json;

json levels_json(const tileset::TilesetSummary& s) {
  json levels = json::array();
  for (const tileset::LevelSummary& level : s.levels) {
    levels.push_back({{"tiles", level.tiles},
                      {"geometric_error_min", level.geometric_error_min_m},
                      {"geometric_error_max", level.geometric_error_max_m}});
  }
  return levels;
}

json center_json(const tileset::TilesetSummary& s) {
  if (!s.center) return nullptr;
  return {{"lat", s.center->latitude_deg}, {"lon", s.center->longitude_deg}, {"height", s.center->height.m}};
}

/// Counts over the whole tree.
json counts_json(const tileset::TilesetSummary& s) {
  const auto known = [&](std::int64_t number) { return s.content_sizes_known ? json(number) : json(nullptr); };
  return {{"tiles", s.tiles},
          {"tiles_with_content", s.tiles_with_content},
          {"leaves", s.leaves},
          {"depth", s.depth()},
          {"refine", {{"REPLACE", s.tiles_replace}, {"ADD", s.tiles_add}}},
          {"tiles_unsupported", s.tiles_unsupported},
          {"contents", s.contents},
          {"content_files", s.content_files},
          {"content_files_missing", known(s.content_files_missing)},
          {"content_bytes", known(s.content_bytes)},
          {"external_tilesets", s.external_tilesets},
          {"subtrees", s.subtrees},
          {"levels", levels_json(s)}};
}

/// Estimated cost of an extraction of the whole place.
struct ExtractEstimate {
  place::ExtractCost whole;
  double area_km2 = 0.0;  ///< area of the place's bounds
};

ExtractEstimate estimate_extract(const tileset::TilesetSummary& s) {
  const geometry::Vec3 size = s.bounds_local.sizes();
  ExtractEstimate estimate{
      place::estimate_extract_cost(s.probes, static_cast<double>(s.finest_contents),
                                   s.content_sizes_known ? static_cast<double>(s.finest_bytes) : -1.0,
                                   place::ExtractSettings().samples_per_m2),
      1e-6 * size.x() * size.y()};
  estimate.whole.spread = std::hypot(estimate.whole.spread, s.count_spread);
  return estimate;
}

json estimate_json(const tileset::TilesetSummary& s) {
  const ExtractEstimate estimate = estimate_extract(s);
  json out{{"nested_files", s.nested_files},
           {"nested_files_not_opened", s.nested_files - s.nested_files_opened},
           {"tiles_probed", s.probes.size()},
           {"spread", std::isfinite(estimate.whole.spread) ? json(estimate.whole.spread) : json()},
           {"area_km2", estimate.area_km2},
           {"extract", nullptr},
           {"extract_per_km2", nullptr}};
  if (!s.probes.empty()) {
    out["extract"] = to_json(estimate.whole);
    if (estimate.area_km2 > 0.0) out["extract_per_km2"] = to_json(estimate.whole.scaled(1.0 / estimate.area_km2));
  }
  if (s.is_estimate) out["counts"] = counts_json(s);
  return out;
}

json to_json(const tileset::TilesetSummary& s) {
  const auto corner = [](const geometry::Vec3& v) { return json{v.x(), v.y(), v.z()}; };
  json out{{"version", s.version},
           {"generator", s.generator},
           {"geometric_error", s.geometric_error_m ? json(*s.geometric_error_m) : json(nullptr)},
           {"extensions_used", s.extensions_used},
           {"extensions_required", s.extensions_required},
           {"extensions_unsupported", s.extensions_unsupported},
           {"georeferenced", s.georeferenced},
           {"center", center_json(s)},
           {"bounds", {{"min", corner(s.bounds_local.min())}, {"max", corner(s.bounds_local.max())}}},
           {"attribution", s.attribution},
           {"attribution_of_contents", s.contents_read},
           {"failures", s.failures},
           {"warnings", s.warnings},
           {"estimate", estimate_json(s)}};
  // An estimate is not passed as a count.
  const json counts = counts_json(s);
  for (const auto& [key, value] : counts.items()) out[key] = s.is_estimate ? json() : value;
  return out;
}

std::string list(const std::vector<std::string>& words) { return words.empty() ? "none" : base::joined(words); }

std::string spread_text(double spread) {
  return std::isfinite(spread) ? base::formatted("± %.0f %%", 100.0 * spread) : "from one of them: a guess";
}

/// Says how many external tilesets and subtrees were not opened; empty if all were.
std::string sample_text(const tileset::TilesetSummary& s) {
  if (!s.is_estimate) return "";
  return std::to_string(s.nested_files - s.nested_files_opened) + " of " + std::to_string(s.nested_files) +
         " external tilesets and subtrees were not opened: numbers of tiles, contents and files are estimates (" +
         spread_text(s.count_spread) + "); --all opens them\n";
}

std::string estimate_text(const tileset::TilesetSummary& s) {
  if (s.probes.empty()) return "";
  const ExtractEstimate estimate = estimate_extract(s);
  std::string text = "estimate of `extract` of everything, from " + std::to_string(s.probes.size()) +
                     " tiles: " + cost_text(estimate.whole) + "\n";
  if (estimate.area_km2 > 0.0)
    text += "  of 1 km² (of " + base::formatted("%.3g", estimate.area_km2) +
            "): " + cost_text(estimate.whole.scaled(1.0 / estimate.area_km2)) + "\n";
  return text;
}

std::string inspect_summary(const tileset::TilesetSummary& s) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(1);
  const char* about = s.is_estimate ? "about " : "";
  text << "3D Tiles " << s.version << (s.generator.empty() ? "" : ", made by " + s.generator) << "\n"
       << sample_text(s) << about << s.tiles << " tiles, " << s.leaves << " of them leaves, " << s.depth()
       << " levels; refine: REPLACE " << s.tiles_replace << ", ADD " << s.tiles_add << "\ncontents:";
  for (const auto& [kind, count] : s.contents) text << " " << count << " " << kind;
  text << " (" << s.content_files << " files";
  if (s.content_sizes_known) {
    text << ", " << static_cast<double>(s.content_bytes) / 1e6 << " MB, " << s.content_files_missing << " missing";
  }
  text << "), " << s.external_tilesets << " external tilesets, " << s.subtrees << " subtrees";
  if (!s.failures.empty()) text << ", " << s.failures.size() << " of these missing or broken (see below)";
  text << "\n";
  const geometry::Vec3 size = s.bounds_local.sizes();
  text << "extent: " << size.x() << " x " << size.y() << " x " << size.z() << " m, ";
  if (s.center) {
    text << std::setprecision(6) << "around " << s.center->latitude_deg << ", " << s.center->longitude_deg
         << std::setprecision(1) << ", " << s.center->height.m << " m above the ellipsoid\n";
  } else {
    const geometry::Vec3 middle = s.bounds_local.center();
    text << "not georeferenced, around (" << middle.x() << ", " << middle.y() << ", " << middle.z()
         << ") in its own frame\n";
  }
  for (std::size_t i = 0; i < s.levels.size(); ++i) {
    text << "  level " << i << ": " << s.levels[i].tiles << " tiles, geometric error " << std::setprecision(3)
         << s.levels[i].geometric_error_min_m << " to " << s.levels[i].geometric_error_max_m << " m\n";
  }
  text << "extensions required: " << list(s.extensions_required)
       << "; not supported: " << list(s.extensions_unsupported) << "\nattribution: " << list(s.attribution) << " ("
       << s.contents_read << " of " << s.content_files << " tile files read)\n";
  text << estimate_text(s);
  for (const std::string& failure : s.failures) text << "broken: " << failure << "\n";
  for (const std::string& warning : s.warnings) text << "note: " << warning << "\n";
  return text.str();
}

}  // namespace

void add_inspect(CLI::App& app, CommonOptions& common, Selection& selection) {
  struct Options {
    std::string source;
    SourceArguments arguments;
    InspectPlaceOptions place;
    bool all = false;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "inspect",
      "contents of a tileset: depth, tiles, formats, extent, errors, attribution; what an extraction takes; map from "
      "above; ground heights");
  command->footer(
      "Examples:\n  tileflight inspect tiles/tileset.json\n"
      "The place from above with its grid and heights, and a proposed region and voxel size:\n"
      "  tileflight inspect tiles/ --map place.png\n"
      "Ground heights at two points:\n"
      "  tileflight inspect tiles/ --at 35.310344,-80.740007 --at 35.310544,-80.740207");
  command->add_option("SOURCE", options->source, kSourceHelp)->required();
  command->add_flag("--all", options->all,
                    "open every external tileset and subtree (default: of very many, some that are spread evenly, and "
                    "numbers are estimates)");
  add_inspect_place_options(*command, options->place);
  add_source_options(*command, options->arguments);
  add_common_options(*command, common);
  command->callback([options, command, &selection] {
    selection.run = [options, command](const CommonOptions&, const Progress& progress) -> Output {
      const fetch::SourceOptions source = source_options(options->arguments);
      check_inspect_place(*command, options->place);
      Output output{nlohmann::json::object(), ""};
      if (tells_whole_tileset(options->place, options->source)) {
        const tileset::TilesetSummary s =
            tileset::inspect_tileset(options->source, source, {.all = options->all}, progress);
        output = {to_json(s), inspect_summary(s)};
      }
      inspect_place(options->source, source, *command, options->place, output, progress);
      return output;
    };
  });
}

}  // namespace tileflight::app
