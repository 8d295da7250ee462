#include "tileflight/experiments/report/key_figures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>
#include <string_view>
#include <system_error>
#include <utility>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/drawing/number_format.h"
#include "tileflight/experiments/report/map_comparison_tables.h"
#include "tileflight/experiments/report/warnings_panel.h"

namespace tileflight::report {

using drawing::format_count;
using drawing::format_fixed;
using drawing::format_percent;
using drawing::format_shortest;
using drawing::format_signed;
using drawing::kUnknown;
using drawing::number_at;
using drawing::text_at;

namespace {

std::string csv_line(const std::string& label, const std::vector<std::string>& cells) {
  std::string line = base::csv_field(label);
  for (const std::string& cell : cells) line += ',' + (cell == kUnknown ? std::string() : base::csv_field(cell));
  return line + "\r\n";
}

std::string latex_line(const std::string& label, const std::vector<std::string>& cells) {
  std::string line = latex_text(label);
  for (const std::string& cell : cells) line += " & " + latex_text(cell);
  return line + " \\\\\n";
}

const char* source_of(const FlightColumn& column) { return column.published ? "Paper" : "This run"; }

/// Number of columns from `first` on with the same source.
std::size_t group_size(const std::vector<FlightColumn>& columns, std::size_t first) {
  std::size_t last = first;
  while (last < columns.size() && columns[last].published == columns[first].published) ++last;
  return last - first;
}

/// Sources above their columns, with rules below them.
std::string latex_groups(const std::vector<FlightColumn>& columns) {
  std::string names, rules;
  for (std::size_t first = 0; first < columns.size(); first += group_size(columns, first)) {
    const std::size_t size = group_size(columns, first);
    names += " & \\multicolumn{" + std::to_string(size) + "}{c}{" + source_of(columns[first]) + "}";
    rules += "\\cmidrule(lr){" + std::to_string(first + 2) + "-" + std::to_string(first + size + 1) + "}\n";
  }
  return names.empty() ? "" : names + " \\\\\n" + rules;
}

}  // namespace

std::string latex_text(const std::string& plain) {
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 15> kCommands{{
      {"\\", "\\textbackslash{}"},
      {"&", "\\&"},
      {"%", "\\%"},
      {"$", "\\$"},
      {"#", "\\#"},
      {"_", "\\_"},
      {"{", "\\{"},
      {"}", "\\}"},
      {"~", "\\textasciitilde{}"},
      {"^", "\\textasciicircum{}"},
      {"\u00A0", "~"},
      {"\u00B0", "$^{\\circ}$"},
      {"\u00D7", "$\\times$"},
      {"\u2212", "$-$"},
      {"\u2013", "--"},
  }};
  std::string result;
  for (std::string_view rest = plain; !rest.empty();) {
    const auto* const command =
        std::find_if(kCommands.begin(), kCommands.end(), [&](const auto& c) { return rest.starts_with(c.first); });
    result += command == kCommands.end() ? rest.substr(0, 1) : command->second;
    rest.remove_prefix(command == kCommands.end() ? 1 : command->first.size());
  }
  return result;
}

std::string key_figures_csv(const KeyFigures& figures) {
  std::vector<std::string> names;
  for (const FlightColumn& column : figures.columns)
    names.push_back(std::string(source_of(column)) + ": " + column.label);
  std::string csv = csv_line("Figure", names);
  for (const auto* rows : {&figures.as_published, &figures.additional}) {
    for (const KeyFigureRow& row : *rows) csv += csv_line(row.label, row.cells);
  }
  return csv;
}

std::string key_figures_latex(const KeyFigures& figures) {
  std::vector<std::string> labels;
  for (const FlightColumn& column : figures.columns) labels.push_back(column.label);
  std::string table = "% needs \\usepackage{booktabs}\n\\begin{tabular}{l" + std::string(labels.size(), 'r') +
                      "}\n\\toprule\n" + latex_groups(figures.columns) + latex_line("", labels);
  for (const auto* rows : {&figures.as_published, &figures.additional}) {
    table += "\\midrule\n";
    for (const KeyFigureRow& row : *rows) table += latex_line(row.label, row.cells);
  }
  return table + "\\bottomrule\n\\end{tabular}\n";
}

void write_key_figures(const std::filesystem::path& folder, const KeyFigures& figures) {
  std::error_code error;  // ignored: writing the file reports the error
  std::filesystem::create_directories(folder, error);
  base::write_file(folder / "key-figures.csv", key_figures_csv(figures));
  base::write_file(folder / "key-figures.tex", key_figures_latex(figures));
}

namespace {

using nlohmann::json;
using KeyFigureFormatter = std::function<std::string(const FlightColumn&)>;

/// Tells whether the run had no place, so that its maps have no errors.
bool is_without_place(const json& results) { return results.contains("truth") && results["truth"].is_null(); }

std::vector<FlightColumn> columns_of(const json& results) {
  std::vector<FlightColumn> columns;
  const json paper = is_without_place(results) ? json::object() : results.value("paper", json::object());
  for (const char* key : {"simulated", "real"}) {
    if (paper.contains(key))
      columns.push_back({key, key == std::string("real") ? "Real" : "Simulated", true, paper[key]});
  }
  for (const char* key : {"simulated", "real"}) {
    if (results.contains(key) && results[key].is_object()) {
      columns.push_back({key, flight_label(key, results[key]), false, results[key]});
    }
  }
  return columns;
}

/// The paper's table may hold its numbers directly or under `map`, as metrics.json does.
std::optional<double> map_number(const FlightColumn& column, const std::string& key) {
  const std::optional<double> nested = number_at(column.values, "/map/" + key);
  return nested ? nested : number_at(column.values, "/" + key);
}

std::string resolution(const FlightColumn& column) {
  const std::optional<double> width = number_at(column.values, "/resolution/0"),
                              height = number_at(column.values, "/resolution/1");
  return width && height ? format_shortest(width) + "\u00D7" + format_shortest(height) : kUnknown;
}

std::optional<double> ratio(const std::optional<double>& part, const std::optional<double>& whole) {
  return part && whole && *whole > 0 ? std::optional(*part / *whole) : std::nullopt;
}

std::optional<double> share_kept(const FlightColumn& column) {
  return ratio(map_number(column, "correspondences"), map_number(column, "points"));
}

/// A value of a map from thresholds to shares; thresholds are written as "0.5" or "0.500000".
std::optional<double> at_threshold(const json& values, const std::string& key, double threshold_m) {
  const json::json_pointer place("/surface/" + key);
  if (!values.contains(place) || !values.at(place).is_object()) return std::nullopt;
  for (const auto& [name, value] : values.at(place).items()) {
    if (value.is_number() && std::abs(std::strtod(name.c_str(), nullptr) - threshold_m) < 1e-9)
      return value.get<double>();
  }
  return std::nullopt;
}

std::optional<double> path_error_m(const FlightColumn& column) {
  return number_at(column.values, "/trajectory/ate_rmse");
}

KeyFigureRow row(const std::string& label, const std::vector<FlightColumn>& columns, const KeyFigureFormatter& cell) {
  KeyFigureRow result{label, {}};
  for (const FlightColumn& column : columns) result.cells.push_back(cell(column));
  return result;
}

std::vector<KeyFigureRow> published_rows(const std::vector<FlightColumn>& columns) {
  const auto map_count = [](const char* key) {
    return [key](const FlightColumn& c) { return format_count(map_number(c, key)); };
  };
  const auto map_metres = [](const char* key) {
    return [key](const FlightColumn& c) { return format_fixed(map_number(c, key), 4); };
  };
  const auto plain = [](const char* key, int digits) {
    return [key, digits](const FlightColumn& c) {
      const std::optional<double> value = number_at(c.values, key);
      return value ? format_shortest(std::round(*value * std::pow(10, digits)) / std::pow(10, digits)) : kUnknown;
    };
  };
  return {row("Map points", columns, map_count("points")),
          row("Correspondences in cut-off", columns, map_count("correspondences")),
          row("Mean error, m", columns, map_metres("mean")),
          row("Standard deviation, m", columns, map_metres("std")),
          row("Field of view, \u00B0", columns, plain("/fov_deg", 1)),
          row("Resolution, px", columns, resolution),
          row("Frame rate, fps", columns, plain("/fps", 2)),
          row("Frames", columns, [](const FlightColumn& c) { return format_count(number_at(c.values, "/frames")); })};
}

constexpr const char* kReceiversError = "ATE of a perfect path, by the reference, m";

/// Removes the rows in which all cells are unknown.
void remove_empty(std::vector<KeyFigureRow>& rows, const std::function<bool(const KeyFigureRow&)>& may_go) {
  std::erase_if(rows, [&](const KeyFigureRow& row) {
    return may_go(row) && std::ranges::all_of(row.cells, [](const std::string& cell) { return cell == kUnknown; });
  });
}

std::vector<KeyFigureRow> further_rows(const std::vector<FlightColumn>& columns) {
  return {
      row("Floor: mean of a perfect map, m", columns,
          [](const FlightColumn& c) { return format_fixed(number_at(c.values, "/map/quantization_floor/mean"), 4); }),
      row("Share of points in cut-off", columns, [](const FlightColumn& c) { return format_percent(share_kept(c)); }),
      row("Median to the exact surface, m", columns,
          [](const FlightColumn& c) { return format_fixed(number_at(c.values, "/surface/median"), 4); }),
      row("F-score at 0.5 m", columns,
          [](const FlightColumn& c) { return format_percent(at_threshold(c.values, "f_score", 0.5)); }),
      row("Path error (ATE), m", columns, [](const FlightColumn& c) { return format_fixed(path_error_m(c), 3); }),
      row(kReceiversError, columns,
          [](const FlightColumn& c) {
            return format_fixed(number_at(c.values, "/trajectory/receiver/expected_rmse_m"), 3);
          }),
      row("Path error, share of the path", columns, [](const FlightColumn& c) {
        return format_percent(ratio(path_error_m(c), number_at(c.values, "/trajectory/path_length")), 2);
      })};
}

bool has_flag(const json& flight, const std::string& pointer, bool value) {
  const json::json_pointer place(pointer);
  return flight.contains(place) && flight.at(place).is_boolean() && flight.at(place).get<bool>() == value;
}

/// Caveats about a flight's numbers as further sentences, for results whose writer listed no warnings.
std::string unlisted_warnings(const json& results, const char* flight, const std::string& label) {
  if (results.contains("warnings") || !results.contains(flight)) return "";
  std::string sentences;
  if (has_flag(results[flight], "/odometry/lost", true))
    sentences += " Tracking of the " + label + " flight was lost before its end.";
  if (has_flag(results[flight], "/alignment/converged", false))
    sentences += " The alignment of the " + label + " map did not converge.";
  return sentences;
}

/// The number of warnings that accompany a verdict; empty if there are none.
std::string remark_on_warnings(const json& results) {
  const std::size_t warnings = warning_lines(results).size();
  if (warnings == 0) return "";
  return warnings == 1 ? " There is one warning about it."
                       : " There are " + std::to_string(warnings) + " warnings about it.";
}

/// "mean 0.5569 m simulated, 0.5769 m surrogate, a difference of -0.0200 m (95 % interval -0.03 to -0.01 m)". If runs
/// were compared, the means are those over the runs, consistent with the difference.
std::string means_of(const json& results, const std::string& second) {
  const json comparison = results.value("comparison", json());
  const bool of_runs = text_at(comparison, "/unit").value_or("") == "runs";
  const std::string mean = of_runs ? "/runs/spread/map/mean/mean" : "/map/mean";
  const auto over_runs = [&](const char* flight) {
    return of_runs ? " over " + format_count(number_at(comparison, std::string("/runs/") + flight)) + " runs"
                   : std::string();
  };
  const auto difference = number_at(comparison, "/mean_difference"),
             low = number_at(comparison, "/mean_difference_ci95/0"),
             high = number_at(comparison, "/mean_difference_ci95/1");
  std::string words = "mean " + format_fixed(number_at(results, "/simulated" + mean), 4) + " m simulated" +
                      over_runs("simulated") + ", " + format_fixed(number_at(results, "/real" + mean), 4) + " m " +
                      second + over_runs("real");
  if (difference) words += ", a difference of " + format_signed(difference, 4) + " m";
  if (difference && low && high)
    words += " (95 % interval " + format_signed(low, 4) + " to " + format_signed(high, 4) + " m)";
  return words;
}

std::string verdict_of_two(const json& results, const std::string& second) {
  const json comparison = results.value("comparison", json());
  const std::string by_published = ". By the published measure, distance to voxel centres: ";
  if (const std::string withheld = withheld_verdict_text(results, second); !withheld.empty())
    return withheld + by_published + means_of(results, second) + ".";
  if (has_map_comparison(comparison))
    return map_comparison_claim(comparison, second) + by_published + means_of(results, second) + "." +
           remark_on_warnings(results);
  const std::string what = "the " + second + " flight's map error within " +
                           format_shortest(number_at(comparison, "/equivalence_margin_m").value_or(0.05)) + " m";
  const std::string word = text_at(comparison, "/verdict").value_or("");
  std::string claim = "The maps of both flights are scored";
  if (word == "equivalent") claim = "Simulation predicted " + what;
  if (word == "different") claim = "Simulation did not predict " + what;
  if (word == "undecided") claim = "Inconclusive: the data do not decide whether simulation predicts " + what;
  return claim + ": " + means_of(results, second) + "." + remark_on_warnings(results);
}

}  // namespace

std::string flight_label(const std::string& key, const nlohmann::json& flight) {
  if (key == "simulated") return "Simulated";
  const std::string kind = text_at(flight, "/kind").value_or("");
  if (kind == "video") return "Real";
  return kind == "surrogate" ? "Surrogate" : "Second flight";
}

KeyFigures key_figures(const nlohmann::json& results) {
  KeyFigures figures;
  figures.columns = columns_of(results);
  figures.as_published = published_rows(figures.columns);
  figures.additional = further_rows(figures.columns);
  const auto any = [](const KeyFigureRow&) { return true; };
  remove_empty(figures.additional, [](const KeyFigureRow& row) { return row.label == kReceiversError; });
  if (!is_without_place(results)) return figures;
  remove_empty(figures.as_published, any);
  remove_empty(figures.additional, any);
  return figures;
}

std::string remark_on_floor(const nlohmann::json& results) {
  bool any = false, below = false;
  for (const char* key : {"/simulated", "/real"}) {
    const auto mean = number_at(results, std::string(key) + "/map/mean"),
               floor = number_at(results, std::string(key) + "/map/quantization_floor/mean");
    any = any || floor;
    below = below || (mean && floor && *mean < *floor);
  }
  if (!any) return "";
  return std::string(
             "The floor is the mean error of points that lie exactly on the true surface: it is not zero because "
             "surfaces do not pass through the centres of voxels.") +
         (below ? " A mean below the floor is not more accurate: the alignment moved the map from the surface towards "
                  "the voxel centres."
                : "");
}

std::string verdict(const nlohmann::json& results) {
  const bool has_simulated = number_at(results, "/simulated/map/mean").has_value();
  const bool has_second = number_at(results, "/real/map/mean").has_value();
  const std::string second = has_second ? base::to_lower(flight_label("real", results["real"])) : "";
  std::string sentence = "This run has no scored map.";
  if (is_without_place(results)) {
    sentence = "No place was given, so the error of the map is not known.";
    if (const auto path = number_at(results, "/real/trajectory/ate_rmse"))
      sentence += " The path differs from the recorded positions by " + format_fixed(path, 3) + " m (RMS).";
  }
  if (has_simulated && has_second) {
    sentence = verdict_of_two(results, second);
  } else if (has_simulated || has_second) {
    const json& flight = results[has_simulated ? "simulated" : "real"];
    sentence = "The " + (has_simulated ? "simulated" : second) + " flight's map has a mean error of " +
               format_fixed(number_at(flight, "/map/mean"), 4) + " m; there is no second flight to compare it with.";
  }
  sentence += unlisted_warnings(results, "simulated", "simulated");
  if (results.contains("real"))
    sentence += unlisted_warnings(results, "real", base::to_lower(flight_label("real", results["real"])));
  return sentence;
}

}  // namespace tileflight::report
