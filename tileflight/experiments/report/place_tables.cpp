#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tileflight/core/drawing/number_format.h"
#include "tileflight/experiments/report/map_errors.h"
#include "tileflight/experiments/report/tables.h"

namespace tileflight::report {
using drawing::format_count;
using drawing::format_percent;
using drawing::format_shortest;
using drawing::GroundExtent;
using drawing::kUnknown;
using drawing::number_at;

namespace {

using nlohmann::json;

/// Points within this distance of the surface count as correct, as in the page's F-score.
constexpr double kRight_m = 0.5;

std::string yes_or_no(const json& values, const std::string& pointer) {
  const json::json_pointer place(pointer);
  if (!values.contains(place) || !values.at(place).is_boolean()) return kUnknown;
  return values.at(place).get<bool>() ? "yes" : "no";
}

/// Results for the points over one part of the ground.
struct Part {
  std::vector<double> errors_m;  ///< infinite if unknown

  std::vector<std::string> cells() {
    if (errors_m.empty()) return {"0", kUnknown, kUnknown};
    const auto right = std::count_if(errors_m.begin(), errors_m.end(), [](double e) { return e <= kRight_m; });
    const auto middle = errors_m.begin() + static_cast<std::ptrdiff_t>(errors_m.size() / 2);
    std::nth_element(errors_m.begin(), middle, errors_m.end());
    return {format_count(static_cast<double>(errors_m.size())), drawing::format_fixed(*middle, 3),
            format_percent(static_cast<double>(right) / static_cast<double>(errors_m.size()))};
  }
};

/// The third of the range that contains a value.
std::size_t third(double value, double low, double high) {
  return static_cast<std::size_t>(std::clamp(std::floor(3 * (value - low) / (high - low)), 0.0, 2.0));
}

/// Nine parts, row by row from the north-west.
std::array<Part, 9> parts_of(const FlightRun& flight, const GroundExtent& ground) {
  std::array<Part, 9> parts;
  const std::vector<float>& distances = *best_distances(flight);
  for (std::size_t i = 0; i < distances.size(); ++i) {
    const geometry::Vec3& p = flight.errors->positions[i];
    if (p.x() < ground.west || p.x() > ground.east || p.y() < ground.south || p.y() > ground.north) continue;
    const std::size_t row = 2 - third(p.y(), ground.south, ground.north),
                      column = third(p.x(), ground.west, ground.east);
    const auto error_m = static_cast<double>(distances[i]);
    parts[3 * row + column].errors_m.push_back(std::isfinite(error_m) ? error_m : HUGE_VAL);
  }
  return parts;
}

}  // namespace

Table place_table(const json& results) {
  const auto whole = [&](const char* key) { return format_count(number_at(results, std::string("/truth/") + key)); };
  const auto metres = [&](const char* key) {
    return format_shortest(number_at(results, std::string("/truth/") + key));
  };
  if (!number_at(results, "/truth/voxels_occupied") && !number_at(results, "/truth/tiles_loaded")) return {};
  return {"The place as ground truth",
          {"", "Value"},
          {{"Tiles needed", whole("tiles_wanted")},
           {"Tiles loaded", whole("tiles_loaded")},
           {"Tiles that failed", whole("tiles_failed")},
           {"Complete at the requested error", yes_or_no(results, "/truth/complete")},
           {"Largest geometric error loaded, m", metres("geometric_error_max")},
           {"Triangles", whole("triangles")},
           {"Voxel edge, m", metres("voxel_size")},
           {"Occupied voxels", whole("voxels_occupied")}}};
}

Table coverage_table(const json& coverage) {
  Table table{"What the camera would have seen with each tile-loading strategy: shares of pixels",
              {"Strategy", "Tiles", "Correct", "Coarser", "Missing", "Missing, worst frame", "Voxels"},
              {}};
  if (!coverage.is_object() || !coverage.contains("strategies") || !coverage["strategies"].is_object()) return table;
  for (const auto& [name, values] : coverage["strategies"].items()) {
    const auto share = [&values = values](const char* key) {
      return format_percent(number_at(values, std::string("/") + key), 2);
    };
    table.rows.push_back({name, format_count(number_at(values, "/tiles")), share("right"), share("coarser"),
                          share("missing"), share("missing_worst"), share("cells_share")});
  }
  return table;
}

Table parts_table(const RunFolder& run) {
  Table table{
      "Parts of the place: points, their median error, and the share within " + format_shortest(kRight_m) + " m",
      {"Part"},
      {}};
  std::optional<GroundExtent> ground = ScoredRegion(run.results).extent;
  if (!ground && run.voxel_centers && !run.voxel_centers->empty())
    ground = drawing::fit_extent(run.voxel_centers->positions, 0.0);
  if (!ground) return table;
  for (const char* name :
       {"North-west", "North", "North-east", "West", "Middle", "East", "South-west", "South", "South-east"})
    table.rows.push_back({name});
  for (const FlightRun& flight : run.flights) {
    if (best_distances(flight) == nullptr) continue;
    table.groups.push_back(flight.label);
    for (const char* name : {"points", "median, m", "within"}) table.header.emplace_back(name);
    std::array<Part, 9> parts = parts_of(flight, *ground);
    for (std::size_t i = 0; i < parts.size(); ++i) {
      for (std::string& cell : parts[i].cells()) table.rows[i].push_back(std::move(cell));
    }
  }
  if (table.groups.empty()) table.rows.clear();
  return table;
}

}  // namespace tileflight::report
