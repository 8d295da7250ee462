#include "tileflight/report/key_figures.h"

#include <cmath>
#include <functional>

#include "tileflight/report/numbers.h"

namespace tileflight::report {
namespace {

using nlohmann::json;
using Cell = std::function<std::string(const FlightColumn&)>;

std::vector<FlightColumn> columns_of(const json& results) {
  std::vector<FlightColumn> columns;
  const json paper = results.value("paper", json::object());
  for (const char* key : {"simulated", "real"}) {
    if (paper.contains(key)) columns.push_back({key, key == std::string("real") ? "Real" : "Simulated", true, paper[key]});
  }
  for (const char* key : {"simulated", "real"}) {
    if (results.contains(key) && results[key].is_object()) {
      columns.push_back({key, flight_label(key, results[key]), false, results[key]});
    }
  }
  return columns;
}

/// The paper's table may hold its numbers flat or under `map`, as metrics.json does.
std::optional<double> map_number(const FlightColumn& column, const std::string& key) {
  const std::optional<double> nested = number_at(column.values, "/map/" + key);
  return nested ? nested : number_at(column.values, "/" + key);
}

std::string resolution(const FlightColumn& column) {
  const std::optional<double> width = number_at(column.values, "/resolution/0"), height = number_at(column.values, "/resolution/1");
  return width && height ? shortest(width) + "\u00D7" + shortest(height) : kUnknown;
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
    if (value.is_number() && std::abs(std::strtod(name.c_str(), nullptr) - threshold_m) < 1e-9) return value.get<double>();
  }
  return std::nullopt;
}

std::string trajectory_error(const FlightColumn& column) {
  const std::optional<double> ate_m = number_at(column.values, "/trajectory/ate_rmse");
  const std::optional<double> share = ratio(ate_m, number_at(column.values, "/trajectory/path_length"));
  return ate_m ? fixed(ate_m, 3) + (share ? " (" + percent(share, 2) + ")" : "") : kUnknown;
}

FigureRow row(const std::string& label, const std::vector<FlightColumn>& columns, const Cell& cell) {
  FigureRow result{label, {}};
  for (const FlightColumn& column : columns) result.cells.push_back(cell(column));
  return result;
}

std::vector<FigureRow> published_rows(const std::vector<FlightColumn>& columns) {
  const auto map_count = [](const char* key) { return [key](const FlightColumn& c) { return count(map_number(c, key)); }; };
  const auto map_metres = [](const char* key) { return [key](const FlightColumn& c) { return fixed(map_number(c, key), 4); }; };
  const auto plain = [](const char* key, int digits) {
    return [key, digits](const FlightColumn& c) {
      const std::optional<double> value = number_at(c.values, key);
      return value ? shortest(std::round(*value * std::pow(10, digits)) / std::pow(10, digits)) : kUnknown;
    };
  };
  return {row("Map points estimated", columns, map_count("points")),
          row("Model-to-map correspondences", columns, map_count("correspondences")),
          row("Mean error, m", columns, map_metres("mean")),
          row("Standard deviation, m", columns, map_metres("std")),
          row("Field of view, degrees", columns, plain("/fov_deg", 1)),
          row("Resolution, pixels", columns, resolution),
          row("Frame rate, frames/s", columns, plain("/fps", 2)),
          row("Duration, frames", columns, [](const FlightColumn& c) { return count(number_at(c.values, "/frames")); })};
}

std::vector<FigureRow> further_rows(const std::vector<FlightColumn>& columns) {
  return {row("Mean error of a perfect map (floor), m", columns,
              [](const FlightColumn& c) { return fixed(number_at(c.values, "/map/quantization_floor/mean"), 4); }),
          row("Share of points within the cut-off", columns, [](const FlightColumn& c) { return percent(share_kept(c)); }),
          row("Median distance to the exact surface, m", columns,
              [](const FlightColumn& c) { return fixed(number_at(c.values, "/surface/median"), 4); }),
          row("F-score at 0.5 m", columns,
              [](const FlightColumn& c) { return percent(at_threshold(c.values, "f_score", 0.5)); }),
          row("Trajectory error (ATE), m (share of path)", columns, trajectory_error)};
}

std::string lost_part(const json& flight, const std::string& label) {
  const json::json_pointer lost("/odometry/lost");
  const bool is_lost = flight.contains(lost) && flight.at(lost).is_boolean() && flight.at(lost).get<bool>();
  return is_lost ? " Tracking of the " + label + " flight was lost before its end." : "";
}

std::string lower(std::string word) {
  if (!word.empty() && word[0] >= 'A' && word[0] <= 'Z') word[0] = static_cast<char>(word[0] - 'A' + 'a');
  return word;
}

std::string comparison_sentence(const json& comparison, const std::string& second) {
  const std::string margin = shortest(number_at(comparison, "/equivalence_margin_m").value_or(0.05));
  const std::string word = text_at(comparison, "/verdict").value_or("");
  if (word == "equivalent") return "equivalent within " + margin + " m: simulation predicted the " + second + " flight's error";
  if (word == "different") return "different by more than " + margin + " m: simulation did not predict the " + second + " flight's error";
  if (word == "undecided") return "neither shown to be equivalent within " + margin + " m nor to differ by more";
  return "";
}

std::string verdict_of_two(const json& results, const std::string& second) {
  const json& comparison = results["comparison"];
  const std::string sentence = comparison_sentence(comparison, second);
  const std::optional<double> low = number_at(comparison, "/mean_difference_ci95/0"), high = number_at(comparison, "/mean_difference_ci95/1");
  const std::string interval = low && high ? ", 95 % interval " + with_sign(low, 4) + " to " + with_sign(high, 4) + " m" : "";
  return "The simulated flight's map has a mean error of " + fixed(number_at(results, "/simulated/map/mean"), 4) + " m, the " + second +
         " flight's " + fixed(number_at(results, "/real/map/mean"), 4) + " m" +
         (sentence.empty() ? "" : " (difference " + with_sign(number_at(comparison, "/mean_difference"), 4) + " m" + interval + "): " + sentence) + ".";
}

}  // namespace

std::string flight_label(const std::string& key, const nlohmann::json& flight) {
  if (key == "simulated") return "Simulated";
  const std::string kind = text_at(flight, "/kind").value_or("");
  if (kind == "video") return "Real (video)";
  return kind == "surrogate" ? "Surrogate" : "Second flight";
}

KeyFigures key_figures(const nlohmann::json& results) {
  KeyFigures figures;
  figures.columns = columns_of(results);
  figures.as_published = published_rows(figures.columns);
  figures.beyond = further_rows(figures.columns);
  return figures;
}

std::string verdict(const nlohmann::json& results) {
  const bool has_simulated = number_at(results, "/simulated/map/mean").has_value();
  const bool has_second = number_at(results, "/real/map/mean").has_value();
  const std::string second = has_second ? lower(flight_label("real", results["real"])) : "";
  std::string sentence = "This run holds no scored map.";
  if (has_simulated && has_second) {
    sentence = verdict_of_two(results, second);
  } else if (has_simulated || has_second) {
    const json& flight = results[has_simulated ? "simulated" : "real"];
    sentence = "The " + (has_simulated ? "simulated" : second) + " flight's map has a mean error of " + fixed(number_at(flight, "/map/mean"), 4) +
               " m; there is no second flight to compare it with.";
  }
  if (results.contains("simulated")) sentence += lost_part(results["simulated"], "simulated");
  if (results.contains("real")) sentence += lost_part(results["real"], lower(flight_label("real", results["real"])));
  return sentence;
}

}  // namespace tileflight::report
