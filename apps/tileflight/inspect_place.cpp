#include "inspect_place.h"

#include <nlohmann/json.hpp>

#include <algorithm>

#include "tileflight/core/base/input_error.h"
#include "tileflight/world/place/ground_heights.h"
#include "tileflight/capture/preview/inspect_map.h"

namespace tileflight::app {
namespace {

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

}  // namespace

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

bool tells_whole_tileset(const InspectPlaceOptions& options, const std::string& source) {
  if (options.map.empty()) return !asks_heights(options);
  return !fetch::is_network_source(source);
}

void inspect_place(const std::string& source, const fetch::SourceOptions& source_options, const CLI::App& command,
                   const InspectPlaceOptions& options, Output& output, const Progress& progress) {
  if (options.map.empty() && !asks_heights(options)) return;
  tileset::LoadOptions load = load_options(options.region);
  load.source = source_options;
  if (!options.map.empty()) draw_map(source, load, command, options, output, progress);
  if (asks_heights(options)) ask_heights(source, load, options, output, progress);
}

}  // namespace tileflight::app
