#include <algorithm>
#include <cmath>
#include <map>

#include "tileflight/core/base/order_statistics.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/drawing/number_format.h"
#include "tileflight/core/drawing/top_view.h"
#include "tileflight/experiments/report/figures.h"
#include "tileflight/experiments/report/key_figures.h"
#include "tileflight/experiments/report/map_errors.h"

namespace tileflight::report {
using drawing::Drawing;
using drawing::element;
using drawing::Figure;
using drawing::fit_extent;
using drawing::format_fixed;
using drawing::GroundExtent;
using drawing::Html;
using drawing::limit_aspect_ratio;
using drawing::on_page;
using drawing::Rgba8;
using drawing::svg_file;
using drawing::text;
using drawing::to_csv;
using drawing::to_drawing;
using drawing::TopView;

namespace {

/// The paper's colours.
constexpr Rgba8 kBlue{32, 84, 214, 255}, kRed{206, 32, 32, 255};
/// Edge of the ground squares used in these figures' files.
constexpr double kSquare_m = 5.0;

Rgba8 color_of(const FlightRun& flight) { return flight.key == "simulated" ? kBlue : kRed; }

/// Extent of all views from above: that of the truth, else of the maps without their farthest points.
GroundExtent extent_of_run(const RunFolder& run) {
  if (run.voxel_centers && !run.voxel_centers->empty())
    return limit_aspect_ratio(fit_extent(run.voxel_centers->positions, 0.02));
  std::optional<GroundExtent> extent;
  for (const FlightRun& flight : run.flights) {
    if (!flight.errors || flight.errors->empty()) continue;
    const GroundExtent own = fit_extent(flight.errors->positions, 0.05, 0.02);
    extent = extent ? drawing::merge_extents(*extent, own) : own;
  }
  return limit_aspect_ratio(extent.value_or(GroundExtent{-1, 1, -1, 1}));
}

Html layer_switch(const std::string& layer, const std::string& name) {
  const Html box =
      drawing::empty_element("input", {{"type", "checkbox"}, {"id", "show-" + layer}, {"checked", "checked"}});
  return element("label", {{"class", layer}},
                 box + element("span", {{"class", "swatch"}, {"aria-hidden", "true"}}, Html()) + text(name));
}

Html switches(const RunFolder& run) {
  Html boxes = element("legend", text("Layers"));
  if (run.voxel_centers) boxes += layer_switch("truth", "Ground truth");
  for (const FlightRun& flight : run.flights) {
    if (flight.errors) boxes += layer_switch(flight.key, flight.label + " map");
  }
  return element("fieldset", {{"class", "switches"}}, boxes);
}

TopView error_view(const FlightRun& flight, const GroundExtent& extent, double highest) {
  TopView view{flight.label + " map coloured by error",
               "Map points from above; blue is near the surface, red far",
               extent,
               {},
               {}};
  view.images.push_back(
      {"errors", drawing::draw_values(extent, flight.errors->positions, *best_distances(flight), highest)});
  return view;
}

/// South-west corner of a ground square, in squares from the origin, south first.
using Square = std::pair<std::int64_t, std::int64_t>;

Square square_of(const geometry::Vec3& p) {
  return {static_cast<std::int64_t>(std::floor(p.y() / kSquare_m)),
          static_cast<std::int64_t>(std::floor(p.x() / kSquare_m))};
}

std::vector<std::string> middle_of(const Square& square) {
  return {format_fixed((static_cast<double>(square.second) + 0.5) * kSquare_m, 1),
          format_fixed((static_cast<double>(square.first) + 0.5) * kSquare_m, 1)};
}

/// Number of occupied cells and of each map's points over each square.
std::vector<std::vector<std::string>> counts_on_ground(const RunFolder& run) {
  std::vector<std::vector<std::string>> lines{{"middle east, m", "middle north, m"}};
  std::map<Square, std::vector<std::size_t>> counts;
  const std::size_t columns = run.flights.size() + 1;
  const auto add = [&](const std::vector<geometry::Vec3>& points, std::size_t column) {
    for (const geometry::Vec3& p : points) {
      std::vector<std::size_t>& at = counts[square_of(p)];
      at.resize(columns);
      ++at[column];
    }
  };
  lines.front().emplace_back("occupied cells");
  if (run.voxel_centers) add(run.voxel_centers->positions, 0);
  for (std::size_t i = 0; i < run.flights.size(); ++i) {
    lines.front().push_back("points of " + run.flights[i].label);
    if (run.flights[i].errors) add(run.flights[i].errors->positions, i + 1);
  }
  for (const auto& [square, at] : counts) {
    lines.push_back(middle_of(square));
    for (const std::size_t number : at) lines.back().push_back(std::to_string(number));
  }
  return lines;
}

/// Number of points and their median error over each square.
std::vector<std::vector<std::string>> errors_on_ground(const FlightRun& flight) {
  std::vector<std::vector<std::string>> lines{{"middle east, m", "middle north, m", "points", "median error, m"}};
  std::map<Square, std::vector<float>> errors;
  const std::vector<float>& distances = *best_distances(flight);
  for (std::size_t i = 0; i < distances.size(); ++i) {
    if (std::isfinite(distances[i])) errors[square_of(flight.errors->positions[i])].push_back(distances[i]);
  }
  for (const auto& [square, values] : errors) {
    lines.push_back(middle_of(square));
    lines.back().push_back(std::to_string(values.size()));
    lines.back().push_back(format_fixed(base::upper_median(values), 4));
  }
  return lines;
}

}  // namespace

double color_limit(const RunFolder& run) {
  for (const FlightRun& flight : run.flights) {
    if (const auto cutoff_m = drawing::number_at(flight.values, "/map/cutoff"); cutoff_m && *cutoff_m > 0)
      return *cutoff_m;
  }
  return 1.0;
}

Figure maps_figure(const RunFolder& run) {
  TopView view{"Ground truth and maps from above",
               "Ground truth in green, simulated map in blue, second map in red",
               extent_of_run(run),
               {},
               {}};
  if (run.voxel_centers)
    view.images.push_back({"truth", drawing::draw_voxels(view.extent, *run.voxel_centers, run.voxel_m)});
  for (const FlightRun& flight : run.flights) {
    if (flight.errors)
      view.images.push_back(
          {flight.key, drawing::draw_points(view.extent, flight.errors->positions, color_of(flight))});
  }
  if (view.images.empty()) return {};
  std::string caption = "From above: ground truth in green (light is high)";
  for (const FlightRun& flight : run.flights) {
    if (flight.errors)
      caption += ", " + base::to_lower(flight.label) + " map in " + (flight.key == "simulated" ? "blue" : "red");
  }
  const Drawing drawing = to_drawing(view);
  Figure figure{"maps", "maps", switches(run) + on_page(drawing), caption + "."};
  figure.files = {{"maps.svg", "image/svg+xml", svg_file(view.title, {drawing})},
                  {"maps.csv", "text/csv", to_csv(counts_on_ground(run))}};
  return figure;
}

Figure error_maps_figure(const RunFolder& run) {
  const double highest = color_limit(run);
  const GroundExtent extent = extent_of_run(run);
  const bool to_surface = std::all_of(run.flights.begin(), run.flights.end(), [](const FlightRun& flight) {
    return best_distances(flight) == nullptr || find_scalar(flight, "surface_distance") != nullptr;
  });
  const Drawing colors = drawing::color_bar(
      highest, to_surface ? "distance to the exact surface, m" : "distance to the nearest voxel centre, m");
  Figure figure{"error-maps", "error-maps"};
  Html maps;
  for (const FlightRun& flight : run.flights) {
    if (best_distances(flight) == nullptr) continue;
    const TopView view = error_view(flight, extent, highest);
    const Drawing drawing = to_drawing(view);
    maps += element("div", {{"class", "error-map"}}, element("h3", text(flight.label)) + on_page(drawing));
    figure.files.push_back(
        {"error-map-" + flight.key + ".svg", "image/svg+xml", svg_file(view.title, {drawing, colors})});
    figure.files.push_back({"error-map-" + flight.key + ".csv", "text/csv", to_csv(errors_on_ground(flight))});
  }
  if (maps.empty()) return {};
  figure.content = element("div", {{"class", "columns"}}, maps) + on_page(colors);
  figure.caption = "Map points from above, coloured by their error; higher points are drawn over lower ones.";
  return figure;
}

}  // namespace tileflight::report
