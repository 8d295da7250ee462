#include "tileflight/evaluation/metrics/map_table.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>
#include <utility>

#include "tileflight/core/base/document_value.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/evaluation/metrics/block_bootstrap.h"

namespace tileflight::metrics {

using nlohmann::json;

namespace {

/// Keys of default_columns() that LaTeX and text show unless others are chosen.
constexpr std::array<std::string_view, 8> kPrinted{"points",       "share_kept",       "mean_m",      "std_m",
                                                   "floor_mean_m", "surface_median_m", "f_score_0.5", "ate_rmse_m"};

/// The value at a path whose parts are separated by points; keys may hold points themselves ("0.5"). Null if there is
/// none.
json value_at(const json& object, std::string_view path) {
  if (!object.is_object()) return nullptr;
  for (const auto& [key, value] : object.items()) {
    if (path == key) return value;
    if (!path.starts_with(key) || path[key.size()] != '.') continue;
    const json found = value_at(value, path.substr(key.size() + 1));
    if (!found.is_null()) return found;
  }
  return nullptr;
}

/// The map's number in a column, null if it is not known. `metrics`: the map's, as JSON.
json number_in(const TableColumn& column, const ComparedMap& map, const json& metrics) {
  return column.path == "runs" ? json(map.runs.size()) : value_at(metrics, column.path);
}

/// Paths of all numbers in an object.
void add_number_paths(const json& object, const std::string& before, std::vector<std::string>& paths) {
  for (const auto& [key, value] : object.items()) {
    if (value.is_number()) paths.push_back(before + key);
    if (value.is_object()) add_number_paths(value, before + key + ".", paths);
  }
}

std::string cell(const json& value, int digits, const char* unknown) {
  if (!value.is_number() || !std::isfinite(value.get<double>())) return unknown;
  return base::rounded_text(value.get<double>(), digits);
}

std::string csv_text(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

std::string tex_text(const std::string& text) {
  std::string result;
  for (const char c : text) {
    if (c == '\\') {
      result += "\\textbackslash{}";
    } else if (c == '~' || c == '^') {
      result += std::string("\\") + c + "{}";
    } else {
      if (std::string("&%$#_{}").find(c) != std::string::npos) result += '\\';
      result += c;
    }
  }
  return result;
}

std::array<double, 2> simultaneous_interval(const ComparedMap& a, const ComparedMap& b, std::size_t pairs,
                                            const DistanceComparisonOptions& options) {
  const std::vector<BlockSums> blocks = sum_by_block(a.runs.front(), b.runs.front(), options.block_m);
  std::array<double, 2> interval{std::nan(""), std::nan("")};
  if (blocks.size() < 2) return interval;
  const std::vector<double> differences = bootstrap_mean_differences(blocks, options.resamples, options.seed);
  if (differences.empty()) return interval;
  const double outside = 0.025 / static_cast<double>(pairs);
  return {quantile(differences, outside), quantile(differences, 1.0 - outside)};
}

std::string interval_tex(const std::array<double, 2>& ci) {
  if (!std::isfinite(ci[0]) || !std::isfinite(ci[1])) return "--";
  return "$[" + base::rounded_text(ci[0], 4) + ", " + base::rounded_text(ci[1], 4) + "]$";
}

std::string maps_tex(const std::vector<ComparedMap>& maps, const std::vector<TableColumn>& columns) {
  std::string head = "Map";
  for (const TableColumn& column : columns) head += " & " + tex_text(column.title);
  const std::string alignment = "l" + std::string(columns.size(), 'r');
  std::string text = "\\begin{tabular}{" + alignment + "}\n\\toprule\n" + head + " \\\\\n\\midrule\n";
  for (const ComparedMap& map : maps) {
    const json metrics = to_json(map.metrics);
    text += tex_text(map.name);
    for (const TableColumn& column : columns)
      text += " & " + cell(number_in(column, map, metrics), column.digits, "--");
    text += " \\\\\n";
  }
  return text + "\\bottomrule\n\\end{tabular}\n";
}

std::string pairs_tex(const std::vector<ComparedMap>& maps, const std::vector<ComparedPair>& pairs) {
  std::string text =
      "\\begin{tabular}{llrrrl}\n\\toprule\nFirst & Second & Difference, m & 95\\,\\% interval & all together & "
      "Verdict "
      "\\\\\n\\midrule\n";
  for (const ComparedPair& pair : pairs) {
    text += tex_text(maps[pair.first].name) + " & " + tex_text(maps[pair.second].name) + " & $" +
            base::rounded_text(pair.comparison.mean_difference_m, 4) + "$ & " +
            interval_tex(pair.comparison.mean_difference_ci95) + " & " + interval_tex(pair.simultaneous_ci95) + " & " +
            pair.comparison.verdict + " \\\\\n";
  }
  return text + "\\bottomrule\n\\end{tabular}\n";
}

/// Names of the metrics of all pairs, in order.
std::vector<std::string> metric_names(const std::vector<ComparedPair>& pairs) {
  std::vector<std::string> names;
  for (const ComparedPair& pair : pairs) {
    if (!pair.maps) continue;
    for (const ComparedMetric& m : pair.maps->metrics)
      if (std::find(names.begin(), names.end(), m.name) == names.end()) names.push_back(m.name);
  }
  return names;
}

/// Metric by name; nullptr if the pair has none.
const ComparedMetric* find_metric(const ComparedPair& pair, const std::string& name) {
  if (!pair.maps) return nullptr;
  const auto found = std::ranges::find(pair.maps->metrics, name, &ComparedMetric::name);
  return found == pair.maps->metrics.end() ? nullptr : &*found;
}

/// Interval of the ratio or of the difference, whichever is judged.
const std::array<double, 2>& judged_ci95(const ComparedMetric& m) {
  return m.scale == MarginScale::kRatio ? m.ratio_ci95 : m.difference_ci95;
}

std::string overall_verdict(const ComparedPair& pair) {
  if (std::ranges::any_of(pair.warnings, forbids_verdict)) return kWithheld;
  return pair.maps ? pair.maps->verdict.word : pair.comparison.verdict;
}

/// Indices of the pairs: all of them, or every other map with that of index `against`.
std::vector<std::pair<std::size_t, std::size_t>> list_pairs(std::size_t maps, std::optional<std::size_t> against) {
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (std::size_t i = 0; i < maps; ++i) {
    if (against && i != *against) pairs.emplace_back(i, *against);
    for (std::size_t j = i + 1; !against && j < maps; ++j) pairs.emplace_back(i, j);
  }
  return pairs;
}

Warnings warnings_of_both(const ComparedMap& first, const ComparedMap& second) {
  Warnings warnings;
  for (const ComparedMap* map : {&first, &second}) {
    for (Warning warning : map->metrics.warnings) {
      const bool of_truth = warning.where == "truth";
      if (of_truth && map == &second) continue;
      if (!of_truth) warning.where = map->name + "/" + warning.where;
      warnings.push_back(std::move(warning));
    }
  }
  return warnings;
}

std::string metrics_tex(const std::vector<ComparedMap>& maps, const std::vector<ComparedPair>& pairs) {
  std::string text =
      "\\begin{tabular}{lllrrrl}\n\\toprule\nFirst & Second & Measure & first & second & 95\\,\\% interval & Verdict "
      "\\\\\n\\midrule\n";
  for (const ComparedPair& pair : pairs) {
    if (!pair.maps) continue;
    for (const ComparedMetric& m : pair.maps->metrics) {
      const bool by_ratio = m.scale == MarginScale::kRatio;
      text += tex_text(maps[pair.first].name) + " & " + tex_text(maps[pair.second].name) + " & " + tex_text(m.name) +
              " & " + cell(m.simulated, 4, "--") + " & " + cell(m.real, 4, "--") + " & " +
              (by_ratio ? "$\\times$ " : "") + interval_tex(judged_ci95(m)) + " & " + m.verdict + " \\\\\n";
    }
  }
  return text + "\\bottomrule\n\\end{tabular}\n";
}

}  // namespace

std::vector<ComparedPair> compare_all_pairs(const std::vector<ComparedMap>& maps,
                                            const DistanceComparisonOptions& options,
                                            const MapComparisonOptions& map_options,
                                            std::optional<std::size_t> against) {
  if (maps.size() < 2) throw InputError("comparison", "needs at least two maps");
  std::vector<ComparedPair> pairs;
  const auto listed = list_pairs(maps.size(), against);
  for (const auto& [i, j] : listed) {
    ComparedPair pair{i, j, compare_runs(maps[i].runs, maps[j].runs, options)};
    if (!maps[i].scored.empty() && !maps[j].scored.empty())
      pair.maps = compare_maps(maps[i].scored, maps[j].scored, map_options);
    pair.simultaneous_ci95 = simultaneous_interval(maps[i], maps[j], listed.size(), options);
    pair.warnings = warnings_of_both(maps[i], maps[j]);
    pairs.push_back(std::move(pair));
  }
  return pairs;
}

const std::vector<TableColumn>& default_columns() {
  static const std::vector<TableColumn> kColumns{
      {"runs", "Runs", "runs", 0},
      {"points", "Points", "map.points", 0},
      {"correspondences", "Corresp.", "map.correspondences", 0},
      {"share_kept", "Kept", "map.share_kept", 3},
      {"mean_m", "Mean, m", "map.mean"},
      {"std_m", "Std, m", "map.std"},
      {"median_m", "Median, m", "map.median"},
      {"rmse_m", "RMSE, m", "map.rmse"},
      {"floor_mean_m", "Floor, m", "map.quantization_floor.mean"},
      {"surface_median_m", "Surface, m", "surface.median"},
      {"surface_rmse_m", "Surface RMSE, m", "surface.rmse"},
      {"accuracy_0.5", "Accuracy at 0.5 m", "surface.accuracy.0.5"},
      {"completeness_0.5", "Completeness at 0.5 m", "surface.completeness.0.5"},
      {"f_score_0.5", "F at 0.5 m", "surface.f_score.0.5", 3},
      {"normals_mean_abs_cos", "Normals", "surface.normals.mean_abs_cos"},
      {"entropy", "Entropy", "entropy.mean"},
      {"ate_rmse_m", "ATE, m", "trajectory.ate_rmse"}};
  return kColumns;
}

std::vector<TableColumn> printed_columns() {
  std::vector<TableColumn> printed;
  for (const TableColumn& column : default_columns())
    if (std::ranges::find(kPrinted, column.key) != kPrinted.end()) printed.push_back(column);
  return printed;
}

std::vector<TableColumn> choose_columns(const std::vector<std::string>& names, const std::vector<ComparedMap>& maps) {
  std::vector<std::string> known, paths;
  for (const TableColumn& column : default_columns()) known.push_back(column.key);
  for (const ComparedMap& map : maps) add_number_paths(to_json(map.metrics), "", paths);
  std::vector<TableColumn> chosen;
  for (const std::string& name : names) {
    const auto column = std::ranges::find(default_columns(), name, &TableColumn::key);
    if (column != default_columns().end()) {
      chosen.push_back(*column);
    } else if (std::ranges::find(paths, name) != paths.end()) {
      chosen.push_back({.key = name, .title = name, .path = name});
    } else {
      known.insert(known.end(), paths.begin(), paths.end());
      throw InputError("column '" + name + "'", "is neither known nor a number of metrics.json; did you mean '" +
                                                    base::nearest_key(name, known) + "'?");
    }
  }
  return chosen;
}

json to_json(const std::vector<ComparedMap>& maps, const std::vector<ComparedPair>& pairs,
             const std::vector<TableColumn>& columns) {
  json object{{"maps", json::array()}, {"pairs", json::array()}};
  for (const ComparedMap& map : maps) {
    const json metrics = to_json(map.metrics);
    json line{{"name", map.name}};
    for (const auto* some : {&default_columns(), &columns})
      for (const TableColumn& column : *some) line[column.key] = number_in(column, map, metrics);
    object["maps"].push_back(std::move(line));
  }
  for (const ComparedPair& pair : pairs) {
    json line = to_json(pair.comparison, pair.maps, pair.warnings);
    line["first"] = maps[pair.first].name;
    line["second"] = maps[pair.second].name;
    line["simultaneous_ci95"] = pair.simultaneous_ci95;
    object["pairs"].push_back(std::move(line));
  }
  return object;
}

std::string maps_csv(const std::vector<ComparedMap>& maps, const std::vector<TableColumn>& columns) {
  std::string text = "name";
  for (const TableColumn& column : columns) text += "," + csv_text(column.key);
  text += "\r\n";
  for (const ComparedMap& map : maps) {
    const json metrics = to_json(map.metrics);
    text += csv_text(map.name);
    for (const TableColumn& column : columns) {
      const json value = number_in(column, map, metrics);
      text += "," + cell(value, column.digits == 0 || value.is_number_integer() ? 0 : 6, "");
    }
    text += "\r\n";
  }
  return text;
}

std::string maps_text(const std::vector<ComparedMap>& maps, const std::vector<TableColumn>& columns) {
  std::vector<std::vector<std::string>> rows(1, {"map"});
  for (const TableColumn& column : columns) rows.front().push_back(column.key);
  for (const ComparedMap& map : maps) {
    const json metrics = to_json(map.metrics);
    rows.push_back({map.name});
    for (const TableColumn& column : columns) {
      const json value = number_in(column, map, metrics);
      rows.back().push_back(cell(value, value.is_number_integer() ? 0 : column.digits, "-"));
    }
  }
  std::vector<std::size_t> widths(columns.size() + 1, 0);
  for (const auto& row : rows)
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  std::string text;
  for (const auto& row : rows) {
    text += row[0] + std::string(columns.empty() ? 0 : widths[0] - row[0].size(), ' ');
    for (std::size_t i = 1; i < row.size(); ++i) text += std::string(2 + widths[i] - row[i].size(), ' ') + row[i];
    text += '\n';
  }
  return text;
}

std::string pairs_csv(const std::vector<ComparedMap>& maps, const std::vector<ComparedPair>& pairs) {
  std::string text =
      "first,second,unit,mean_difference_m,ci95_low_m,ci95_high_m,simultaneous_low_m,simultaneous_high_m,ks_statistic,"
      "wasserstein_m,equivalent_within_m,mean_difference_verdict";
  const std::vector<std::string> names = metric_names(pairs);
  for (const std::string& name : names) {
    for (const char* what : {"_first", "_second", "_low", "_high", "_verdict"}) text += "," + csv_text(name + what);
  }
  text += ",verdict\r\n";
  for (const ComparedPair& pair : pairs) {
    const DistanceComparison& c = pair.comparison;
    text += csv_text(maps[pair.first].name) + "," + csv_text(maps[pair.second].name) + "," + c.sampling_unit;
    for (const double value :
         {c.mean_difference_m, c.mean_difference_ci95[0], c.mean_difference_ci95[1], pair.simultaneous_ci95[0],
          pair.simultaneous_ci95[1], c.ks_statistic, c.wasserstein_m, c.equivalent_within_m.value_or(std::nan(""))})
      text += "," + cell(value, 6, "");
    text += "," + c.verdict;
    for (const std::string& name : names) {
      const ComparedMetric* m = find_metric(pair, name);
      for (const double value : m ? std::vector{m->simulated, m->real, judged_ci95(*m)[0], judged_ci95(*m)[1]}
                                  : std::vector(4, std::nan("")))
        text += "," + cell(value, 6, "");
      text += "," + (m ? m->verdict : std::string());
    }
    text += "," + overall_verdict(pair) + "\r\n";
  }
  return text;
}

std::string tables_tex(const std::vector<ComparedMap>& maps, const std::vector<ComparedPair>& pairs,
                       const std::vector<TableColumn>& columns) {
  return maps_tex(maps, columns) + "\n" + pairs_tex(maps, pairs) + "\n" + metrics_tex(maps, pairs);
}

}  // namespace tileflight::metrics
