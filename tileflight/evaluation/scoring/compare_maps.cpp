#include "tileflight/evaluation/scoring/compare_maps.h"

#include <fnmatch.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "tileflight/core/base/document_value.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/evaluation/metrics/map_table.h"
#include "tileflight/evaluation/metrics/rank_correlation.h"
#include "tileflight/evaluation/scoring/evaluate.h"
#include "tileflight/evaluation/scoring/warnings.h"

namespace tileflight::scoring {

namespace fs = std::filesystem;
namespace {

/// metrics.json of a flight's first run, then of its further runs that did not fail.
std::vector<fs::path> list_metrics_files(const fs::path& flight) {
  std::vector<fs::path> files;
  if (fs::is_directory(flight / "runs")) {
    for (const fs::directory_entry& entry : fs::directory_iterator(flight / "runs")) {
      if (fs::exists(entry.path() / "metrics.json") && !fs::exists(entry.path() / "failed.txt"))
        files.push_back(entry.path() / "metrics.json");
    }
  }
  std::sort(files.begin(), files.end());
  files.insert(files.begin(), flight / "metrics.json");
  return files;
}

void add_flights(const fs::path& run, std::vector<FoundMap>& maps) {
  for (const char* flight : {"simulated", "real"})
    if (fs::exists(run / flight / "metrics.json")) maps.push_back({"", list_metrics_files(run / flight)});
}

/// The run's variants that were scored, by name.
void add_variants(const fs::path& run, std::vector<FoundMap>& maps) {
  if (!fs::is_directory(run / "variants")) return;
  std::vector<fs::path> variants;
  for (const fs::directory_entry& entry : fs::directory_iterator(run / "variants")) variants.push_back(entry.path());
  std::ranges::sort(variants);
  for (const fs::path& variant : variants) add_flights(variant, maps);
}

/// The folders that a map's name is made of, from the last: of out/stadium/variants/dark/simulated simulated, dark,
/// stadium, out. `least`: how many of them a name has anyway.
struct NameParts {
  std::vector<std::string> folders{};
  std::size_t least = 2;

  std::string name(std::size_t count) const {
    std::string text;
    for (std::size_t i = 0; i < std::min(std::max(count, least), folders.size()); ++i)
      text = folders[i] + (i == 0 ? "" : "/") + text;
    return text;
  }
};

NameParts name_parts(const fs::path& metrics_json) {
  NameParts parts;
  for (fs::path folder = fs::absolute(metrics_json).lexically_normal().parent_path(); folder.has_relative_path();
       folder = folder.parent_path()) {
    const std::string name = folder.filename().string();
    if (parts.folders.size() == 2 && name == "variants")
      parts.least = 3;  // the run's name, too
    else
      parts.folders.push_back(name);
  }
  return parts;
}

/// Gives each map the shortest name by which it differs from the others.
void name_maps(std::vector<FoundMap>& maps) {
  std::vector<NameParts> parts;
  for (const FoundMap& map : maps) parts.push_back(name_parts(map.metrics_files.front()));
  std::vector<std::size_t> counts(maps.size(), 0);
  for (bool longer = true; longer;) {
    std::map<std::string, std::vector<std::size_t>> same;
    for (std::size_t i = 0; i < maps.size(); ++i) same[parts[i].name(counts[i])].push_back(i);
    longer = false;
    for (const auto& [name, indices] : same) {
      for (const std::size_t i : indices) {
        maps[i].name = name;
        const std::size_t used = std::max(counts[i], parts[i].least);
        if (indices.size() == 1 || used >= parts[i].folders.size()) continue;
        counts[i] = used + 1;
        longer = true;
      }
    }
  }
}

fs::path file_of(const FoundMap& map) { return fs::weakly_canonical(map.metrics_files.front()); }

/// Names all maps. One that is given twice counts once, since nothing in its paths can differ; then it has a number.
void name_all(std::vector<FoundMap>& maps) {
  std::map<fs::path, std::size_t> places;  // in `once`
  std::vector<FoundMap> once;
  for (const FoundMap& map : maps)
    if (places.emplace(file_of(map), once.size()).second) once.push_back(map);
  name_maps(once);
  std::vector<std::size_t> seen(once.size(), 0);
  for (FoundMap& map : maps) {
    const std::size_t place = places.at(file_of(map));
    map.name = once[place].name;
    if (++seen[place] > 1) map.name += " #" + std::to_string(seen[place]);
  }
}

bool matches(const FoundMap& map, const std::string& pattern) {
  return map.name == pattern || fnmatch(pattern.c_str(), map.name.c_str(), 0) == 0;
}

std::vector<std::string> names_of(const std::vector<FoundMap>& maps) {
  std::vector<std::string> names;
  for (const FoundMap& map : maps) names.push_back(map.name);
  return names;
}

}  // namespace

std::vector<FoundMap> find_maps(const std::vector<fs::path>& arguments) {
  std::vector<FoundMap> maps;
  for (const fs::path& argument : arguments) {
    if (!fs::is_directory(argument)) {
      maps.push_back({"", {argument}});
      continue;
    }
    const std::size_t before = maps.size();
    if (fs::exists(argument / "metrics.json")) maps.push_back({"", {argument / "metrics.json"}});
    add_flights(argument, maps);
    add_variants(argument, maps);
    if (maps.size() == before)
      throw InputError(argument.string(), "contains no scored map; give a metrics.json or a folder written by `run`");
  }
  name_all(maps);
  return maps;
}

std::vector<FoundMap> choose_maps(const std::vector<FoundMap>& maps, const std::vector<std::string>& patterns) {
  std::vector<FoundMap> chosen;
  for (const std::string& pattern : patterns) {
    bool is_used = false;
    for (const FoundMap& map : maps) {
      if (!matches(map, pattern)) continue;
      is_used = true;
      if (std::ranges::find(chosen, map.name, &FoundMap::name) == chosen.end()) chosen.push_back(map);
    }
    if (!is_used)
      throw InputError("row '" + pattern + "'",
                       "matches none of the maps; did you mean '" + base::nearest_key(pattern, names_of(maps)) + "'?");
  }
  return chosen;
}

FoundMap find_baseline(const std::vector<FoundMap>& maps, const std::string& baseline) {
  std::vector<FoundMap> found;
  for (const FoundMap& map : maps)
    if (map.name == baseline) return map;
  for (const FoundMap& map : maps)
    if (matches(map, baseline)) found.push_back(map);
  if (found.empty()) {
    if (!fs::exists(baseline))
      throw InputError("baseline '" + baseline + "'", "is neither a map nor a file; did you mean '" +
                                                          base::nearest_key(baseline, names_of(maps)) + "'?");
    found = find_maps({baseline});
    for (FoundMap& map : found) {
      const auto same =
          std::ranges::find_if(maps, [&](const FoundMap& other) { return file_of(other) == file_of(map); });
      if (same != maps.end())
        map = *same;
      else if (std::ranges::find(maps, map.name, &FoundMap::name) != maps.end())
        map.name += " (baseline)";
    }
  }
  if (found.size() > 1)
    throw InputError("baseline '" + baseline + "'", "names " + std::to_string(found.size()) + " maps (" +
                                                        base::joined(names_of(found)) + "): name one");
  return found.front();
}

namespace fs = std::filesystem;
namespace {

using nlohmann::json;

/// A run in the form used for comparison by exact distances; nullopt without an exact surface, or if it was scored by
/// an older version that did not mark the points over the region. Moves the distances out of `metrics`.
std::optional<metrics::ScoredMap> scored_map(const fs::path& metrics_json, metrics::MetricsFile& metrics) {
  if (!metrics.surface) return std::nullopt;
  metrics::ScoredMap map{.surface = std::move(*metrics.surface)};
  if (const fs::path seen = seen_surface_file(metrics_json); fs::exists(seen)) map.seen = read_seen_surface(seen);
  // A receiver's error is no property of the flight: it says nothing about what the simulation predicted.
  const auto& path = metrics.metrics.trajectory;
  if (path && !path->receiver) map.ate_rmse_m = path->ate_rmse_m;
  return map;
}

metrics::ComparedMap read_compared_map(const FoundMap& found) {
  metrics::ComparedMap map{.name = found.name};
  for (const fs::path& file : found.metrics_files) {
    metrics::MetricsFile read = metrics::read_metrics(file);
    if (auto scored = scored_map(file, read)) map.scored.push_back(std::move(*scored));
    if (map.runs.empty()) {
      map.metrics = std::move(read.metrics);
    } else {
      append_distinct(map.metrics.warnings, read.metrics.warnings);
    }
    map.runs.push_back(std::move(read.voxel));
  }
  if (map.scored.size() < map.runs.size()) map.scored.clear();
  return map;
}

metrics::DistanceComparisonOptions published_options(const EvaluationSettings& settings, std::uint64_t seed) {
  return {.equivalence_margin_m = settings.equivalence_margin_m, .seed = seed};
}

metrics::MapComparisonOptions map_options(const EvaluationSettings& settings, std::uint64_t seed) {
  return {.cutoff_m = settings.cutoff_m,
          .ratio_margin = settings.ratio_margin,
          .share_margin = settings.share_margin,
          .completeness_margin = settings.completeness_margin,
          .lacking_margin = settings.lacking_margin,
          .path_margin_m = settings.path_margin_m,
          .seed = seed};
}

fs::path pairs_file(const fs::path& csv) {
  fs::path file = csv;
  return file.replace_filename(csv.stem().string() + "-pairs" + csv.extension().string());
}

void require_no_input(const std::vector<FoundMap>& maps, const ComparisonFiles& files) {
  std::vector<fs::path> inputs;
  for (const FoundMap& map : maps) {
    for (const fs::path& metrics_json : map.metrics_files)
      inputs.insert(inputs.end(), {metrics_json, metrics_json.parent_path() / "errors.ply"});
  }
  if (!files.csv.empty()) base::prepare_output_file(files.csv, inputs);
  if (!files.csv.empty()) base::prepare_output_file(pairs_file(files.csv), inputs);
  for (const fs::path& file : {files.tex, files.text})
    if (!file.empty()) base::prepare_output_file(file, inputs);
}

/// The chosen maps, with the baseline among them, and its index.
struct Chosen {
  std::vector<FoundMap> maps;
  std::optional<std::size_t> baseline{};
};

Chosen choose(const std::vector<fs::path>& arguments, const MapSelection& selection) {
  const std::vector<FoundMap> all = find_maps(arguments);
  Chosen chosen{selection.rows.empty() ? all : choose_maps(all, selection.rows)};
  if (selection.against.empty()) return chosen;
  const FoundMap baseline = find_baseline(all, selection.against);
  auto found = std::ranges::find(chosen.maps, baseline.name, &FoundMap::name);
  if (found == chosen.maps.end()) found = chosen.maps.insert(chosen.maps.begin(), baseline);
  chosen.baseline = static_cast<std::size_t>(found - chosen.maps.begin());
  return chosen;
}

double read_metric(const fs::path& metrics_json, const std::string& by) {
  std::string place = "/" + by;
  std::ranges::replace(place, '.', '/');
  const json metrics = base::read_json(metrics_json);
  const json::json_pointer pointer(place);
  if (!metrics.contains(pointer) || !metrics.at(pointer).is_number()) {
    throw InputError(
        metrics_json.string(),
        "has no number '" + by +
            "' to rank by; use a number of metrics.json, such as map.mean, surface.median or trajectory.ate_rmse");
  }
  return metrics.at(pointer).get<double>();
}

}  // namespace

json compare_flights(const std::vector<fs::path>& simulated, const std::vector<fs::path>& real,
                     const EvaluationSettings& settings, std::uint64_t seed) {
  if (simulated.empty() || real.empty()) throw InputError("comparison", "needs at least one run of each flight");
  const std::vector<metrics::ComparedMap> maps{read_compared_map({"simulated", simulated}),
                                               read_compared_map({"real", real})};
  const auto pairs = metrics::compare_all_pairs(maps, published_options(settings, seed), map_options(settings, seed));
  return metrics::to_json(pairs.front().comparison, pairs.front().maps, pairs.front().warnings);
}

MapsComparison compare_maps(const std::vector<fs::path>& arguments, const EvaluationSettings& settings,
                            std::uint64_t seed, const ComparisonFiles& files, const MapSelection& selection) {
  const Chosen chosen = choose(arguments, selection);
  require_no_input(chosen.maps, files);
  std::vector<metrics::ComparedMap> maps;
  for (const FoundMap& map : chosen.maps) maps.push_back(read_compared_map(map));
  const auto own = metrics::choose_columns(selection.columns, maps);
  const auto pairs =
      metrics::compare_all_pairs(maps, published_options(settings, seed), map_options(settings, seed), chosen.baseline);
  const auto& of_csv = own.empty() ? metrics::default_columns() : own;
  const auto printed = own.empty() ? metrics::printed_columns() : own;
  if (!files.csv.empty()) {
    base::write_file(files.csv, metrics::maps_csv(maps, of_csv));
    base::write_file(pairs_file(files.csv), metrics::pairs_csv(maps, pairs));
  }
  if (!files.tex.empty()) base::write_file(files.tex, metrics::tables_tex(maps, pairs, printed));
  MapsComparison result{{}, metrics::maps_text(maps, printed)};
  if (!files.text.empty()) base::write_file(files.text, result.table);
  result.json = maps.size() == 2
                    ? metrics::to_json(pairs.front().comparison, pairs.front().maps, pairs.front().warnings)
                    : json::object();
  result.json.update(metrics::to_json(maps, pairs, own));
  return result;
}

json compare_ranking(const std::vector<fs::path>& run_folders, const std::string& by, std::uint64_t seed) {
  if (run_folders.size() < 2) throw InputError("ranking", "needs at least two run folders, one for each setting");
  std::vector<double> simulated, real;
  std::vector<fs::path> files;
  for (const fs::path& folder : run_folders) {
    files.push_back(folder / "simulated/metrics.json");
    simulated.push_back(read_metric(files.back(), by));
    real.push_back(read_metric(folder / "real/metrics.json", by));
  }
  const std::vector<FoundMap> named = find_maps(files);
  json list = json::array();
  for (std::size_t i = 0; i < named.size(); ++i) {
    std::string name = named[i].name;
    name.erase(name.find("/simulated"), std::string_view("/simulated").size());
    list.push_back({{"name", name}, {"simulated", simulated[i]}, {"real", real[i]}});
  }
  json result = metrics::to_json(metrics::rank_correlation(simulated, real, 2000, seed));
  result["by"] = by;
  result["list"] = list;
  return result;
}

}  // namespace tileflight::scoring
