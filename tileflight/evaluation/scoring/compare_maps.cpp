#include "tileflight/evaluation/scoring/compare_maps.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/json_file.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/evaluation/metrics/map_table.h"
#include "tileflight/evaluation/metrics/rank_correlation.h"
#include "tileflight/evaluation/scoring/compared_maps.h"
#include "tileflight/evaluation/scoring/evaluate.h"
#include "tileflight/evaluation/scoring/warnings.h"

namespace tileflight::scoring {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

/// A run in the form used for comparison by exact distances; nullopt without an exact surface, or if it was scored by
/// an older version that did not mark the points over the region. Moves the distances out of `metrics`.
std::optional<metrics::ScoredMap> scored_map(const fs::path& metrics_json, metrics::MetricsFile& metrics) {
  if (!metrics.surface) return std::nullopt;
  metrics::ScoredMap map{.surface = std::move(*metrics.surface)};
  if (const fs::path seen = seen_surface_file(metrics_json); fs::exists(seen)) map.seen = read_seen_surface(seen);
  if (metrics.metrics.trajectory) map.ate_rmse_m = metrics.metrics.trajectory->ate_rmse_m;
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
