#include "tileflight/experiments/report/score_tables.h"

#include <algorithm>
#include <functional>
#include <nlohmann/json.hpp>

#include "tileflight/core/drawing/number_format.h"

namespace tileflight::report {
using drawing::format_count;
using drawing::format_fixed;
using drawing::format_percent;
using drawing::kUnknown;
using drawing::number_at;
using drawing::text_at;

namespace {

using nlohmann::json;
using ScoreFormatter = std::function<std::string(const json&)>;

ScoreFormatter number_cell(const std::string& pointer, int decimals) {
  return [=](const json& values) { return format_fixed(number_at(values, pointer), decimals); };
}
ScoreFormatter percent_cell(const std::string& pointer) {
  return [=](const json& values) { return format_percent(number_at(values, pointer)); };
}

json at(const json& values, const std::string& pointer) {
  const json::json_pointer place(pointer);
  return values.contains(place) ? values.at(place) : json();
}

/// Adds a row unless the value is unknown for all flights.
void add_row(Table& table, const std::string& label, const std::vector<FlightRun>& flights,
             const ScoreFormatter& shown) {
  std::vector<std::string> cells{label};
  for (const FlightRun& flight : flights) cells.push_back(shown(flight.values));
  const auto is_unknown = [](const std::string& cell) { return cell == kUnknown; };
  if (!std::all_of(cells.begin() + 1, cells.end(), is_unknown)) table.rows.push_back(std::move(cells));
}

Table table_of(const std::string& caption, const std::vector<FlightRun>& flights) {
  Table table{caption, {""}, {}};
  for (const FlightRun& flight : flights) table.header.push_back(flight.label);
  return table;
}

std::vector<std::string> statistics(const json& values) {
  return {format_count(number_at(values, "/points")), format_fixed(number_at(values, "/mean"), 4),
          format_fixed(number_at(values, "/median"), 4)};
}

/// "Held out, at 12, −30, 4 m".
std::string region_name(const json& region) {
  std::string name = text_at(region, "/use").value_or("") == "held-out" ? "Held out, at " : "Aligned on, at ";
  for (const char* axis : {"0", "1", "2"})
    name += format_fixed(number_at(region, std::string("/center/") + axis), 0) + (axis[0] == '2' ? " m" : ", ");
  return name;
}

void add_region_row(Table& table, const std::string& label, const std::vector<FlightRun>& flights,
                    const std::string& pointer) {
  std::vector<std::string> cells{label};
  for (const FlightRun& flight : flights) {
    for (std::string& cell : statistics(at(flight.values, pointer))) cells.push_back(std::move(cell));
  }
  table.rows.push_back(std::move(cells));
}

/// The longest list of all flights.
const json* longest_list(const std::vector<FlightRun>& flights, const std::string& pointer) {
  const json* longest = nullptr;
  for (const FlightRun& flight : flights) {
    const json::json_pointer place(pointer);
    if (!flight.values.contains(place) || !flight.values.at(place).is_array()) continue;
    const json& list = flight.values.at(place);
    if (!longest || list.size() > longest->size()) longest = &list;
  }
  return longest;
}

std::vector<std::string> run_row(const std::string& label, const json& run) {
  std::string name = label + ", " + text_at(run, "/name").value_or(kUnknown);  // "Simulated, 2-backwards"
  std::replace(name.begin(), name.end(), '-', ' ');
  if (const auto why = text_at(run, "/failed")) return {name, "failed", *why, kUnknown, kUnknown};
  return {name, format_count(number_at(run, "/points")), format_fixed(number_at(run, "/mean"), 4),
          format_fixed(number_at(run, "/surface_median"), 4), format_fixed(number_at(run, "/ate_rmse"), 4)};
}

/// "0.4497 ± 0.0021 (0.4470 to 0.4524)".
std::string spread_text(const json& spread) {
  std::string words =
      format_fixed(number_at(spread, "/mean"), 4) + " \u00b1 " + format_fixed(number_at(spread, "/std"), 4);
  const auto low = number_at(spread, "/ci95/0"), high = number_at(spread, "/ci95/1");
  return low && high ? words + " (" + format_fixed(low, 4) + " to " + format_fixed(high, 4) + ")" : words;
}

}  // namespace

Table regions_table(const std::vector<FlightRun>& flights) {
  Table table{
      "Regions used for the alignment and regions held out from it: points and their distance, m", {"Region"}, {}};
  const json* const each = longest_list(flights, "/regions/each");
  if (!each) return table;
  for (const FlightRun& flight : flights) {
    table.groups.push_back(flight.label);
    for (const char* name : {"points", "mean", "median"}) table.header.emplace_back(name);
  }
  add_region_row(table, "All aligned on", flights, "/regions/aligned_on");
  add_region_row(table, "All held out", flights, "/regions/held_out");
  for (std::size_t i = 0; i < each->size(); ++i)
    add_region_row(table, region_name((*each)[i]), flights, "/regions/each/" + std::to_string(i));
  return table;
}

Table quality_table(const std::vector<FlightRun>& flights) {
  Table table = table_of("Shape, sharpness and drift", flights);
  add_row(table, "Normals: mean |cos| to the surface's", flights, number_cell("/surface/normals/mean_abs_cos", 3));
  add_row(table, "Normals within 30\u00b0 of the surface's", flights,
          percent_cell("/surface/normals/share_within_30_deg"));
  add_row(table, "Mean map entropy (lower is sharper)", flights, number_cell("/entropy/mean", 3));
  add_row(table, "Radius of the entropy, m", flights, number_cell("/entropy/radius", 2));
  add_row(table, "Drift, share of the distance", flights, [](const json& values) {
    const auto drift = number_at(values, "/trajectory/drift/translation_percent");
    return drift ? format_percent(*drift / 100, 3) : kUnknown;
  });
  add_row(table, "Drift, \u00b0 a metre", flights, number_cell("/trajectory/drift/rotation_deg_per_m", 5));
  add_row(table, "Largest drift of the scale", flights, percent_cell("/trajectory/scale_drift/largest"));
  return table;
}

Table moving_table(const std::vector<FlightRun>& flights) {
  Table table = table_of("Points on moving objects: left out of all other scores", flights);
  const auto of = [](const char* pointer) { return std::string("/moving_objects") + pointer; };
  add_row(table, "Points", flights, [&](const json& values) { return format_count(number_at(values, of("/points"))); });
  add_row(table, "Share of the map", flights, percent_cell(of("/share")));
  add_row(table, "Mean distance to the surface, m", flights, number_cell(of("/surface/mean"), 4));
  add_row(table, "RMS distance of the map to the surface with them, m", flights,
          number_cell(of("/with_them/surface/rmse"), 4));
  add_row(table, "Mean distance of the map to the voxel centres with them, m", flights,
          number_cell(of("/with_them/voxel/mean"), 4));
  return table;
}

Table budget_table(const std::vector<FlightRun>& flights) {
  Table table = table_of("What makes up the distance to the surface, m", flights);
  const std::vector<std::pair<std::string, std::string>> parts{
      {"voxel", "Voxels (truth; not in distances to the surface)"},
      {"tiles", "Tiles (truth)"},
      {"alignment", "Alignment"},
      {"path", "Path"},
      {"odometry", "Odometry"},
      {"reference", "Reference (poses located in the tiles; in the path's part)"}};
  for (const auto& [key, label] : parts) {
    const bool any = std::ranges::any_of(flights, [&key = key](const FlightRun& flight) {
      return number_at(flight.values, "/error_budget/" + key + "/metres").has_value();
    });
    if (key == "reference" && !any) continue;
    add_row(table, label, flights, [&key = key](const json& values) -> std::string {
      const auto metres = number_at(values, "/error_budget/" + key + "/metres");
      return metres ? format_fixed(metres, 4) + ", " + text_at(values, "/error_budget/" + key + "/kind").value_or("")
                    : kUnknown;
    });
  }
  add_row(table, "Together (RMS)", flights, number_cell("/error_budget/total", 4));
  add_row(table, "of the points within, m", flights, number_cell("/error_budget/within", 2));
  return table;
}

Table runs_table(const std::vector<FlightRun>& flights) {
  Table table{"Repeated runs and their spread: mean \u00b1 standard deviation (95 % interval of the mean)",
              {"Run", "Points", "Mean to voxels, m", "Median to surface, m", "Path error, m"},
              {}};
  for (const FlightRun& flight : flights) {
    const json list = at(flight.values, "/runs/list");
    if (!list.is_array() || list.empty()) continue;
    for (const json& run : list) table.rows.push_back(run_row(flight.label, run));
    const auto spread = [&](const char* key) {
      return spread_text(at(flight.values, std::string("/runs/spread/") + key));
    };
    table.rows.push_back({flight.label + ", all",
                          format_count(number_at(flight.values, "/runs/spread/map/points/mean")), spread("map/mean"),
                          spread("surface/median"), spread("trajectory/ate_rmse")});
  }
  return table;
}

Table failure_table(const json& results) {
  Table table{"How well the simulated flight predicted the other flight's failures",
              {"", "Cases", "Both", "Simulated only", "Other only", "Neither", "\u03c6", "Predicted", "False alarms"},
              {}};
  const auto add = [&](const char* label, const std::string& pointer) {
    const json t = at(results, pointer);
    if (!t.is_object()) return;
    std::vector<std::string> cells{label};
    for (const char* key : {"questions", "both", "only_simulated", "only_real", "neither"})
      cells.push_back(format_count(number_at(t, std::string("/") + key)));
    cells.push_back(format_fixed(number_at(t, "/phi"), 3));
    for (const char* key : {"predicted", "false_alarms"})
      cells.push_back(format_percent(number_at(t, std::string("/") + key)));
    table.rows.push_back(std::move(cells));
  };
  add("Frames lost", "/failure/frames");
  add("Places missed", "/failure/places/missed");
  return table;
}

}  // namespace tileflight::report
