#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tileflight/core/drawing/number_format.h"
#include "tileflight/experiments/report/chart_figure.h"
#include "tileflight/experiments/report/figures.h"
#include "tileflight/experiments/report/map_errors.h"

namespace tileflight::report {
using drawing::Chart;
using drawing::Figure;
using drawing::format_fixed;
using drawing::number_at;

namespace {

using nlohmann::json;

/// Right end of the cumulative curve, which points farther away keep below 100 %.
constexpr double kCumulativeLimit_m = 2.0;

/// Share of each bin of metrics.json's histogram; empty if there is none.
struct Bins {
  std::vector<double> edges, shares;
};

Bins bins_of(const json& values) {
  const json histogram = values.value(json::json_pointer("/map/histogram"), json());
  Bins bins;
  if (!histogram.is_object() || !histogram.contains("edges") || !histogram.contains("counts")) return bins;
  double total = 0;
  for (std::size_t i = 0; number_at(histogram, "/edges/" + std::to_string(i)); ++i)
    bins.edges.push_back(*number_at(histogram, "/edges/" + std::to_string(i)));
  for (std::size_t i = 0; number_at(histogram, "/counts/" + std::to_string(i)); ++i) {
    bins.shares.push_back(*number_at(histogram, "/counts/" + std::to_string(i)));
    total += bins.shares.back();
  }
  for (double& share : bins.shares) share /= std::max(total, 1.0);
  if (bins.edges.size() != bins.shares.size() + 1) return {};
  return bins;
}

}  // namespace

Figure histogram_figure(const RunFolder& run) {
  Chart chart{"Histogram of map errors",
              "",
              {"distance to the nearest voxel centre, m", 0, 1},
              {"share of correspondences, %", 0, 1},
              {},
              {}};
  double highest = 0;
  for (const FlightRun& flight : run.flights) {
    Bins bins = bins_of(flight.values);
    if (bins.shares.empty()) continue;
    for (double& share : bins.shares) highest = std::max(highest, share *= 100);
    chart.x.high = bins.edges.back();
    chart.lines.push_back({flight.label, flight.key, drawing::histogram_outline(bins.edges, bins.shares), true});
    if (const auto mean = number_at(flight.values, "/map/mean")) {
      chart.marks.push_back({flight.label + ", mean " + format_fixed(mean, 4) + " m", flight.key, *mean});
      chart.description += flight.label + ": mean " + format_fixed(mean, 4) + " m, standard deviation " +
                           format_fixed(number_at(flight.values, "/map/std"), 4) + " m. ";
    }
    const auto floor = number_at(flight.values, "/map/quantization_floor/mean");
    if (floor && chart.lines.size() == 1)
      chart.marks.push_back({"Floor: mean of a perfect map, " + format_fixed(floor, 4) + " m", "floor", *floor});
  }
  if (chart.lines.empty()) return {};
  chart.y.high = 1.08 * std::max(highest, 1e-9);
  return chart_figure(
      "error-histogram", chart,
      "Distances from map points to the nearest voxel centre, within the cut-off. The floor is the mean of a perfect "
      "map: it is not zero because surfaces do not pass through the centres of voxels.");
}

Figure cumulative_figure(const RunFolder& run) {
  const ScoredRegion region(run.results);
  Chart chart{"Cumulative map error",
              "",
              {"distance to the exact surface, m", 0, kCumulativeLimit_m},
              {"share of map points, %", 0, 100},
              {},
              {}};
  for (const FlightRun& flight : run.flights) {
    const std::vector<float>* distances = best_distances(flight);
    if (!distances || distances->empty()) continue;
    const std::vector<double> over_region = distances_in_region(region, flight, *distances);
    std::vector<geometry::Vec2> points =
        drawing::cumulative_points(over_region, over_region.size(), kCumulativeLimit_m);
    for (geometry::Vec2& p : points) p.y() *= 100;
    chart.description +=
        flight.label + ": " + format_fixed(points[points.size() / 4].y(), 1) + " % of points within 0.5 m. ";
    if (!find_scalar(flight, "surface_distance")) chart.x.label = "distance to the nearest voxel centre, m";
    chart.lines.push_back({flight.label, flight.key, std::move(points), false});
  }
  if (chart.lines.empty()) return {};
  return chart_figure("error-cumulative", chart,
                      "Share of the map points over the region that lie within a given distance of the true surface. "
                      "All points count: those farther away than the right edge keep the curve below 100 %.");
}

}  // namespace tileflight::report
