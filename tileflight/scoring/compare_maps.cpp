#include "tileflight/scoring/compare_maps.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "tileflight/base/files.h"
#include "tileflight/base/input_error.h"
#include "tileflight/base/json_file.h"
#include "tileflight/base/output_folder.h"
#include "tileflight/evaluation/map_table.h"
#include "tileflight/evaluation/rank_correlation.h"
#include "tileflight/scoring/doubts.h"
#include "tileflight/scoring/evaluate.h"

namespace tileflight::scoring {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

/// "stadium/real" for out/stadium/real/metrics.json.
std::string map_name(const fs::path& metrics_json) {
  const fs::path flight = fs::absolute(metrics_json).lexically_normal().parent_path();
  const std::string run = flight.parent_path().filename().string();
  return (run.empty() ? "" : run + "/") + flight.filename().string();
}

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

/// A run in the form used for comparison by exact distances; nullopt without an exact surface, or if it was scored by
/// an older version that did not mark the points over the region. Moves the distances out of `metrics`.
std::optional<evaluation::ScoredMap> scored_map(const fs::path& metrics_json, evaluation::MetricsFile& metrics) {
  if (!metrics.surface) return std::nullopt;
  evaluation::ScoredMap map{.surface = std::move(*metrics.surface)};
  if (const fs::path seen = seen_surface_file(metrics_json); fs::exists(seen)) map.seen = read_seen_surface(seen);
  if (metrics.metrics.trajectory) map.ate_rmse_m = metrics.metrics.trajectory->ate_rmse_m;
  return map;
}

evaluation::ComparedMap read_compared_map(const std::vector<fs::path>& runs) {
  evaluation::ComparedMap map{.name = map_name(runs.front())};
  for (const fs::path& file : runs) {
    evaluation::MetricsFile read = evaluation::read_metrics(file);
    if (auto scored = scored_map(file, read)) map.scored.push_back(std::move(*scored));
    if (map.runs.empty()) {
      map.metrics = std::move(read.metrics);
    } else {
      append_distinct(map.metrics.doubts, read.metrics.doubts);
    }
    map.runs.push_back(std::move(read.voxel));
  }
  if (map.scored.size() < map.runs.size()) map.scored.clear();
  return map;
}

evaluation::DistanceComparisonOptions published_options(const EvaluationSettings& settings, std::uint64_t seed) {
  return {.equivalence_margin_m = settings.equivalence_margin_m, .seed = seed};
}

evaluation::MapComparisonOptions map_options(const EvaluationSettings& settings, std::uint64_t seed) {
  return {.cutoff_m = settings.cutoff_m,
          .ratio_margin = settings.ratio_margin,
          .share_margin = settings.share_margin,
          .completeness_margin = settings.completeness_margin,
          .lacking_margin = settings.lacking_margin,
          .path_margin_m = settings.path_margin_m,
          .seed = seed};
}

/// The metrics.json files of each map named by the arguments, the first run first.
std::vector<std::vector<fs::path>> maps_named(const std::vector<fs::path>& arguments) {
  std::vector<std::vector<fs::path>> maps;
  for (const fs::path& argument : arguments) {
    if (!fs::is_directory(argument)) {
      maps.push_back({argument});
      continue;
    }
    const std::size_t before = maps.size();
    if (fs::exists(argument / "metrics.json")) maps.push_back({argument / "metrics.json"});
    for (const char* flight : {"simulated", "real"}) {
      if (fs::exists(argument / flight / "metrics.json")) maps.push_back(list_metrics_files(argument / flight));
    }
    if (maps.size() == before)
      throw InputError(argument.string(), "contains no scored map; give a metrics.json or a folder written by `run`");
  }
  return maps;
}

/// Distinguishes maps of the same name by a number.
void make_names_unique(std::vector<evaluation::ComparedMap>& maps) {
  for (std::size_t i = 0; i < maps.size(); ++i) {
    const auto same = [&](const evaluation::ComparedMap& other) { return other.name == maps[i].name; };
    const auto before = maps.begin() + static_cast<std::ptrdiff_t>(i);
    for (int number = 2; std::any_of(maps.begin(), before, same); ++number)
      maps[i].name = maps[i].name.substr(0, maps[i].name.find(" #")) + " #" + std::to_string(number);
  }
}

fs::path pairs_file(const fs::path& csv) {
  fs::path file = csv;
  return file.replace_filename(csv.stem().string() + "-pairs" + csv.extension().string());
}

void require_no_input(const std::vector<std::vector<fs::path>>& maps, const ComparisonFiles& files) {
  std::vector<fs::path> inputs;
  for (const std::vector<fs::path>& runs : maps) {
    for (const fs::path& metrics_json : runs)
      inputs.insert(inputs.end(), {metrics_json, metrics_json.parent_path() / "errors.ply"});
  }
  if (!files.csv.empty()) base::require_not_input(files.csv, inputs);
  if (!files.csv.empty()) base::require_not_input(pairs_file(files.csv), inputs);
  if (!files.tex.empty()) base::require_not_input(files.tex, inputs);
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
  std::vector<evaluation::ComparedMap> maps{read_compared_map(simulated), read_compared_map(real)};
  maps[0].name = "simulated";
  maps[1].name = "real";
  const auto pairs =
      evaluation::compare_all_pairs(maps, published_options(settings, seed), map_options(settings, seed));
  return evaluation::to_json(pairs.front().comparison, pairs.front().maps, pairs.front().doubts);
}

json compare_maps(const std::vector<fs::path>& arguments, const EvaluationSettings& settings, std::uint64_t seed,
                  const ComparisonFiles& files) {
  const std::vector<std::vector<fs::path>> named = maps_named(arguments);
  require_no_input(named, files);
  std::vector<evaluation::ComparedMap> maps;
  for (const std::vector<fs::path>& runs : named) maps.push_back(read_compared_map(runs));
  make_names_unique(maps);
  const auto pairs =
      evaluation::compare_all_pairs(maps, published_options(settings, seed), map_options(settings, seed));
  if (!files.csv.empty()) {
    base::write_file(files.csv, evaluation::maps_csv(maps));
    base::write_file(pairs_file(files.csv), evaluation::pairs_csv(maps, pairs));
  }
  if (!files.tex.empty()) base::write_file(files.tex, evaluation::tables_tex(maps, pairs));
  json result = maps.size() == 2
                    ? evaluation::to_json(pairs.front().comparison, pairs.front().maps, pairs.front().doubts)
                    : json::object();
  result.update(evaluation::to_json(maps, pairs));
  return result;
}

json compare_ranking(const std::vector<fs::path>& run_folders, const std::string& by, std::uint64_t seed) {
  if (run_folders.size() < 2) throw InputError("ranking", "needs at least two run folders, one for each setting");
  std::vector<double> simulated, real;
  json list = json::array();
  for (const fs::path& folder : run_folders) {
    simulated.push_back(read_metric(folder / "simulated/metrics.json", by));
    real.push_back(read_metric(folder / "real/metrics.json", by));
    list.push_back({{"name", fs::absolute(folder / ".").lexically_normal().parent_path().filename().string()},
                    {"simulated", simulated.back()},
                    {"real", real.back()}});
  }
  json result = evaluation::to_json(evaluation::rank_correlation(simulated, real, 2000, seed));
  result["by"] = by;
  result["list"] = list;
  return result;
}

}  // namespace tileflight::scoring
