#include "tileflight/evaluation/map_table.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "tileflight/base/input_error.h"
#include "tileflight/base/number_text.h"
#include "tileflight/evaluation/block_bootstrap.h"

namespace tileflight::evaluation {

using nlohmann::json;

namespace {

/// A number of metrics.json that is shown in the tables.
struct Column {
  const char* key;    ///< in CSV and JSON, with its unit
  const char* title;  ///< in LaTeX; null: not shown
  json::json_pointer where;
  int digits;
};

const std::vector<Column>& columns() {
  static const std::vector<Column> kColumns{
      {"points", "Points", json::json_pointer("/map/points"), 0},
      {"correspondences", nullptr, json::json_pointer("/map/correspondences"), 0},
      {"share_kept", "Kept", json::json_pointer("/map/share_kept"), 3},
      {"mean_m", "Mean, m", json::json_pointer("/map/mean"), 4},
      {"std_m", "Std, m", json::json_pointer("/map/std"), 4},
      {"median_m", nullptr, json::json_pointer("/map/median"), 4},
      {"rmse_m", nullptr, json::json_pointer("/map/rmse"), 4},
      {"floor_mean_m", "Floor, m", json::json_pointer("/map/quantization_floor/mean"), 4},
      {"surface_median_m", "Surface, m", json::json_pointer("/surface/median"), 4},
      {"surface_rmse_m", nullptr, json::json_pointer("/surface/rmse"), 4},
      {"accuracy_0.5", nullptr, json::json_pointer("/surface/accuracy/0.5"), 4},
      {"completeness_0.5", nullptr, json::json_pointer("/surface/completeness/0.5"), 4},
      {"f_score_0.5", "F at 0.5 m", json::json_pointer("/surface/f_score/0.5"), 3},
      {"normals_mean_abs_cos", nullptr, json::json_pointer("/surface/normals/mean_abs_cos"), 4},
      {"entropy", nullptr, json::json_pointer("/entropy/mean"), 4},
      {"ate_rmse_m", "ATE, m", json::json_pointer("/trajectory/ate_rmse"), 4}};
  return kColumns;
}

json at_or_null(const json& object, const json::json_pointer& where) {
  return object.contains(where) ? object.at(where) : json(nullptr);
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

std::string maps_tex(const std::vector<ComparedMap>& maps) {
  std::string head = "Map", alignment = "l";
  for (const Column& column : columns()) {
    if (column.title == nullptr) continue;
    head += std::string(" & ") + column.title;
    alignment += 'r';
  }
  std::string text = "\\begin{tabular}{" + alignment + "}\n\\toprule\n" + head + " \\\\\n\\midrule\n";
  for (const ComparedMap& map : maps) {
    const json metrics = to_json(map.metrics);
    text += tex_text(map.name);
    for (const Column& column : columns()) {
      if (column.title) text += " & " + cell(at_or_null(metrics, column.where), column.digits, "--");
    }
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
  if (std::ranges::any_of(pair.doubts, forbids_verdict)) return kWithheld;
  return pair.maps ? pair.maps->verdict.word : pair.comparison.verdict;
}

Doubts doubts_of_both(const ComparedMap& first, const ComparedMap& second) {
  Doubts doubts;
  for (const ComparedMap* map : {&first, &second}) {
    for (Doubt doubt : map->metrics.doubts) {
      const bool of_truth = doubt.where == "truth";
      if (of_truth && map == &second) continue;
      if (!of_truth) doubt.where = map->name + "/" + doubt.where;
      doubts.push_back(std::move(doubt));
    }
  }
  return doubts;
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
                                            const MapComparisonOptions& map_options) {
  if (maps.size() < 2) throw InputError("comparison", "needs at least two maps");
  std::vector<ComparedPair> pairs;
  const std::size_t count = maps.size() * (maps.size() - 1) / 2;
  for (std::size_t i = 0; i < maps.size(); ++i) {
    for (std::size_t j = i + 1; j < maps.size(); ++j) {
      ComparedPair pair{i, j, compare_runs(maps[i].runs, maps[j].runs, options)};
      if (!maps[i].scored.empty() && !maps[j].scored.empty())
        pair.maps = compare_maps(maps[i].scored, maps[j].scored, map_options);
      pair.simultaneous_ci95 = simultaneous_interval(maps[i], maps[j], count, options);
      pair.doubts = doubts_of_both(maps[i], maps[j]);
      pairs.push_back(std::move(pair));
    }
  }
  return pairs;
}

json to_json(const std::vector<ComparedMap>& maps, const std::vector<ComparedPair>& pairs) {
  json object{{"maps", json::array()}, {"pairs", json::array()}};
  for (const ComparedMap& map : maps) {
    const json metrics = to_json(map.metrics);
    json line{{"name", map.name}, {"runs", map.runs.size()}};
    for (const Column& column : columns()) line[column.key] = at_or_null(metrics, column.where);
    object["maps"].push_back(std::move(line));
  }
  for (const ComparedPair& pair : pairs) {
    json line = to_json(pair.comparison, pair.maps, pair.doubts);
    line["first"] = maps[pair.first].name;
    line["second"] = maps[pair.second].name;
    line["simultaneous_ci95"] = pair.simultaneous_ci95;
    object["pairs"].push_back(std::move(line));
  }
  return object;
}

std::string maps_csv(const std::vector<ComparedMap>& maps) {
  std::string text = "name,runs";
  for (const Column& column : columns()) text += std::string(",") + column.key;
  text += "\r\n";
  for (const ComparedMap& map : maps) {
    const json metrics = to_json(map.metrics);
    text += csv_text(map.name) + "," + std::to_string(map.runs.size());
    for (const Column& column : columns())
      text += "," + cell(at_or_null(metrics, column.where), column.digits == 0 ? 0 : 6, "");
    text += "\r\n";
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

std::string tables_tex(const std::vector<ComparedMap>& maps, const std::vector<ComparedPair>& pairs) {
  return maps_tex(maps) + "\n" + pairs_tex(maps, pairs) + "\n" + metrics_tex(maps, pairs);
}

}  // namespace tileflight::evaluation
