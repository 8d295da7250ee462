#include "tileflight/report/figures.h"

#include <algorithm>
#include <cmath>

#include "tileflight/report/chart.h"
#include "tileflight/report/frame_pairs.h"
#include "tileflight/report/key_figures.h"
#include "tileflight/report/numbers.h"
#include "tileflight/report/top_view.h"

namespace tileflight::report {
namespace {

using nlohmann::json;

constexpr std::size_t kPairs = 3;
constexpr int kThumbnailPixels = 640;
/// The cumulative curve ends here; farther points are in its share at the right edge.
constexpr double kCumulativeLimit_m = 2.0;
/// The paper's colours.
constexpr Rgba8 kBlue{32, 84, 214, 255}, kRed{206, 32, 32, 255};

Html figure(const std::string& style, const Html& content, const std::string& caption) {
  return element("figure", {{"class", style}}, content + element("figcaption", text(caption)));
}

std::string seconds_text(double time_s) { return fixed(time_s, 2) + " s"; }

Html frame_cell(const FlightRun& flight, const FrameFile& frame) {
  const std::string alt = flight.label + " flight, picture at " + seconds_text(frame.time_s);
  const Html image = empty_element("img", {{"src", thumbnail_uri(frame.image, kThumbnailPixels)}, {"alt", alt}});
  return element("div", {{"class", "frame " + flight.key}},
                 image + element("p", text(flight.label + ", " + seconds_text(frame.time_s))));
}

std::string pair_note(const FramePair& pair) {
  if (!pair.distance_m) return "";
  return "Cameras " + fixed(pair.distance_m, 1) + " m and " + fixed(pair.angle_deg, 0) + "\u00B0 apart.";
}

Html pairs_of(const FlightRun& first, const FlightRun& second) {
  Html rows;
  for (const FramePair& pair : frame_pairs(first, second, kPairs)) {
    rows += element("div", {{"class", "pair"}},
                    frame_cell(first, pair.first) + frame_cell(second, pair.second) +
                        element("p", {{"class", "note"}}, text(pair_note(pair))));
  }
  return rows;
}

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

/// A scalar of the aligned map, where it has it.
const std::vector<float>* scalar(const FlightRun& flight, const std::string& name) {
  if (!flight.errors) return nullptr;
  const auto found = flight.errors->scalars.find(name);
  return found == flight.errors->scalars.end() ? nullptr : &found->second;
}

/// Distances to the exact surface, else to voxel centres.
const std::vector<float>* best_distances(const FlightRun& flight) {
  const std::vector<float>* surface = scalar(flight, "surface_distance");
  return surface ? surface : scalar(flight, "voxel_distance");
}

Rgba8 color_of(const FlightRun& flight) { return flight.key == "simulated" ? kBlue : kRed; }

/// What all views from above show: the truth's extent, else the maps' without their farthest points.
GroundExtent extent_of_run(const RunFolder& run) {
  if (run.voxel_centers && !run.voxel_centers->empty()) return roomy(extent_of(run.voxel_centers->positions, 0.02));
  std::optional<GroundExtent> extent;
  for (const FlightRun& flight : run.flights) {
    if (!flight.errors || flight.errors->empty()) continue;
    const GroundExtent own = extent_of(flight.errors->positions, 0.05, 0.02);
    extent = extent ? united(*extent, own) : own;
  }
  return roomy(extent.value_or(GroundExtent{-1, 1, -1, 1}));
}

Html layer_switch(const std::string& layer, const std::string& name) {
  const Html box = empty_element("input", {{"type", "checkbox"}, {"id", "show-" + layer}, {"checked", "checked"}});
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

std::vector<geometry::Vec3> positions_of(const geometry::Trajectory& trajectory) {
  std::vector<geometry::Vec3> positions;
  for (const geometry::StampedPose& pose : trajectory.poses) positions.push_back(pose.T_local_camera.translation);
  return positions;
}

/// Lines of one flight and their names; the estimate lies on top.
void add_tracks(const FlightRun& flight, std::vector<TrackLayer>& tracks, std::vector<LegendEntry>& entries) {
  if (!flight.telemetry.empty()) {
    tracks.push_back({flight.key + " telemetry", flight.telemetry, true});
    entries.push_back({flight.label + ", receiver's positions", "dots-sample " + flight.key + " telemetry"});
  }
  if (flight.truth && !flight.truth->empty()) {
    tracks.push_back({flight.key + " true-path", positions_of(*flight.truth), false});
    entries.push_back({flight.label + ", true path", "line " + flight.key + " true-path"});
  }
  if (flight.estimate && !flight.estimate->empty()) {
    tracks.push_back({flight.key + " estimate", positions_of(*flight.estimate), false});
    entries.push_back({flight.label + ", estimated", "line " + flight.key + " estimate"});
  }
}

/// Where the colours of the error maps end: the cut-off of the paper's metric.
double color_limit(const RunFolder& run) {
  for (const FlightRun& flight : run.flights) {
    if (const auto cutoff_m = number_at(flight.values, "/map/cutoff"); cutoff_m && *cutoff_m > 0) return *cutoff_m;
  }
  return 1.0;
}

Html error_map(const FlightRun& flight, const GroundExtent& extent, double highest) {
  TopView view{flight.label + " map coloured by error",
               "Map points from above; blue is near the surface, red far",
               extent,
               {},
               {}};
  view.images.push_back({"errors", draw_values(extent, flight.errors->positions, *best_distances(flight), highest)});
  return element("div", {{"class", "error-map"}}, element("h3", text(flight.label)) + draw(view));
}

/// Whether a point lies over the region that was scored; beside it there is no surface to be measured against.
struct ScoredRegion {
  std::optional<GroundExtent> extent;

  explicit ScoredRegion(const json& results) {
    const auto at = [&](const char* key, int axis) {
      return number_at(results, "/truth/region/" + std::string(key) + "/" + std::to_string(axis));
    };
    const auto east = at("center", 0), north = at("center", 1), width = at("size", 0), height = at("size", 1);
    if (east && north && width && height)
      extent = GroundExtent{*east - *width / 2, *east + *width / 2, *north - *height / 2, *north + *height / 2};
  }
  bool holds(const geometry::Vec3& p) const {
    return !extent ||
           (p.x() >= extent->west && p.x() <= extent->east && p.y() >= extent->south && p.y() <= extent->north);
  }
};

std::vector<double> distances_over(const ScoredRegion& region, const FlightRun& flight,
                                   const std::vector<float>& distances) {
  std::vector<double> result;
  for (std::size_t i = 0; i < distances.size(); ++i) {
    if (region.holds(flight.errors->positions[i]))
      result.push_back(std::isfinite(distances[i]) ? distances[i] : HUGE_VAL);
  }
  return result;
}

}  // namespace

Html frames_figure(const RunFolder& run) {
  std::vector<const FlightRun*> filmed;
  for (const FlightRun& flight : run.flights) {
    if (!flight.frames.empty()) filmed.push_back(&flight);
  }
  if (filmed.empty()) return {};
  if (filmed.size() == 2) {
    return figure("frames", pairs_of(*filmed[0], *filmed[1]),
                  "Pictures of both flights that show most nearly the same.");
  }
  Html cells;
  for (const FrameFile& frame : spread(filmed[0]->frames, 2 * kPairs)) cells += frame_cell(*filmed[0], frame);
  return figure("frames", element("div", {{"class", "pair"}}, cells),
                "Pictures of the " + filmed[0]->label + " flight.");
}

Html histogram_figure(const RunFolder& run) {
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
    chart.lines.push_back({flight.label, flight.key, outline(bins.edges, bins.shares), true});
    if (const auto mean = number_at(flight.values, "/map/mean")) {
      chart.marks.push_back({flight.label + ", mean " + fixed(mean, 4) + " m", flight.key, *mean});
      chart.description += flight.label + ": mean " + fixed(mean, 4) + " m, standard deviation " +
                           fixed(number_at(flight.values, "/map/std"), 4) + " m. ";
    }
    const auto floor = number_at(flight.values, "/map/quantization_floor/mean");
    if (floor && chart.lines.size() == 1)
      chart.marks.push_back({"Floor: a perfect map's mean, " + fixed(floor, 4) + " m", "floor", *floor});
  }
  if (chart.lines.empty()) return {};
  chart.y.high = 1.08 * std::max(highest, 1e-9);
  return figure(
      "chart-figure", draw(chart),
      "Distances from map points to the nearest voxel centre, those within the cut-off. Even a perfect map has "
      "errors of this size, since surfaces do not pass through the centres of voxels.");
}

Html cumulative_figure(const RunFolder& run) {
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
    const std::vector<double> over_region = distances_over(region, flight, *distances);
    std::vector<geometry::Vec2> points = cumulative(over_region, over_region.size(), kCumulativeLimit_m);
    for (geometry::Vec2& p : points) p.y() *= 100;
    chart.description += flight.label + ": " + fixed(points[points.size() / 4].y(), 1) + " % of points within 0.5 m. ";
    if (!scalar(flight, "surface_distance")) chart.x.label = "distance to the nearest voxel centre, m";
    chart.lines.push_back({flight.label, flight.key, std::move(points), false});
  }
  if (chart.lines.empty()) return {};
  return figure("chart-figure", draw(chart),
                "Share of the map points over the region that lie within a distance of the true surface. Nothing is "
                "cut off: points farther "
                "than the right edge keep the curve below 100 %.");
}

Html maps_figure(const RunFolder& run) {
  TopView view{"Ground truth and maps from above",
               "Ground truth in green, simulated map in blue, second map in red",
               extent_of_run(run),
               {},
               {}};
  if (run.voxel_centers) view.images.push_back({"truth", draw_voxels(view.extent, *run.voxel_centers, run.voxel_m)});
  for (const FlightRun& flight : run.flights) {
    if (flight.errors)
      view.images.push_back({flight.key, draw_points(view.extent, flight.errors->positions, color_of(flight))});
  }
  if (view.images.empty()) return {};
  std::string caption = "From above: ground truth in green (light is high)";
  for (const FlightRun& flight : run.flights) {
    if (flight.errors)
      caption += ", " + lower_case(flight.label) + " map in " + (flight.key == "simulated" ? "blue" : "red");
  }
  return figure("maps", switches(run) + draw(view), caption + ".");
}

Html paths_figure(const RunFolder& run) {
  TopView view{"Paths from above", "Estimated, true and receiver's positions of each flight", {}, {}, {}};
  std::vector<LegendEntry> entries;
  for (const FlightRun& flight : run.flights) add_tracks(flight, view.tracks, entries);
  if (view.tracks.empty()) return {};
  view.extent = extent_of(view.tracks.front().points, 0.08);
  for (const TrackLayer& track : view.tracks) view.extent = united(view.extent, extent_of(track.points, 0.08));
  view.extent = roomy(view.extent);
  if (run.voxel_centers) view.images.push_back({"backdrop", draw_voxels(view.extent, *run.voxel_centers, run.voxel_m)});
  return figure("paths", draw(view) + legend(entries),
                "Flights from above, after the maps were aligned; a ring marks the start.");
}

Html error_maps_figure(const RunFolder& run) {
  const double highest = color_limit(run);
  const GroundExtent extent = extent_of_run(run);
  Html maps;
  bool to_surface = true;
  for (const FlightRun& flight : run.flights) {
    if (best_distances(flight) == nullptr) continue;
    to_surface = to_surface && scalar(flight, "surface_distance") != nullptr;
    maps += error_map(flight, extent, highest);
  }
  if (maps.empty()) return {};
  const std::string what = to_surface ? "distance to the exact surface, m" : "distance to the nearest voxel centre, m";
  return figure("error-maps", element("div", {{"class", "columns"}}, maps) + color_bar(highest, what),
                "Map points from above, coloured by their error; the highest point lies on top.");
}

}  // namespace tileflight::report
