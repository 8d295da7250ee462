#include <algorithm>
#include <cmath>
#include <sstream>

#include "tileflight/core/drawing/number_format.h"
#include "tileflight/core/drawing/top_view.h"
#include "tileflight/experiments/report/chart_figure.h"
#include "tileflight/experiments/report/figures.h"

namespace tileflight::report {
using drawing::Chart;
using drawing::ChartLine;
using drawing::Figure;
using drawing::fit_extent;
using drawing::format_fixed;
using drawing::TrackLayer;

namespace {

/// Approximate maximum number of points of a chart's line.
constexpr std::size_t kMaxPoints = 600;

std::vector<geometry::Vec3> positions_of(const geometry::Trajectory& trajectory) {
  std::vector<geometry::Vec3> positions;
  for (const geometry::StampedPose& pose : trajectory.poses) positions.push_back(pose.T_local_camera.translation);
  return positions;
}

/// Adds a flight's lines and their names; the estimate is drawn on top.
void add_tracks(const FlightRun& flight, std::vector<TrackLayer>& tracks, std::vector<drawing::LegendEntry>& entries) {
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

/// Rows with the positions of all poses and of the receiver.
std::vector<std::vector<std::string>> poses_of(const RunFolder& run) {
  std::vector<std::vector<std::string>> lines{{"flight", "path", "time, s", "east, m", "north, m", "up, m"}};
  const auto add = [&](const FlightRun& flight, const char* path, const std::string& time, const geometry::Vec3& p) {
    lines.push_back({flight.label, path, time, format_fixed(p.x(), 3), format_fixed(p.y(), 3), format_fixed(p.z(), 3)});
  };
  for (const FlightRun& flight : run.flights) {
    for (const auto& [name, path] : {std::pair("estimated", &flight.estimate), std::pair("true", &flight.truth)}) {
      if (!*path) continue;
      for (const geometry::StampedPose& pose : (*path)->poses)
        add(flight, name, format_fixed(pose.time_s, 3), pose.T_local_camera.translation);
    }
    for (const geometry::Vec3& p : flight.telemetry) add(flight, "receiver", "", p);
  }
  return lines;
}

/// Distance between estimate and truth against the distance flown.
std::vector<geometry::Vec2> error_along(const FlightRun& flight) {
  std::vector<geometry::Vec2> points;
  if (!flight.estimate || !flight.truth) return points;
  double flown_m = 0;
  std::optional<geometry::Vec3> last;
  for (const geometry::StampedPose& pose : flight.estimate->poses) {
    const std::optional<geometry::SE3> truth = geometry::interpolate(*flight.truth, pose.time_s);
    if (!truth) continue;
    if (last) flown_m += (truth->translation - *last).norm();
    last = truth->translation;
    points.emplace_back(flown_m, (pose.T_local_camera.translation - truth->translation).norm());
  }
  return points;
}

/// Evenly subsampled points, including the last one.
std::vector<geometry::Vec2> subsample(const std::vector<geometry::Vec2>& points) {
  const std::size_t step = points.size() / kMaxPoints + 1;
  std::vector<geometry::Vec2> result;
  for (std::size_t i = 0; i < points.size(); i += step) result.push_back(points[i]);
  if (!points.empty() && (points.size() - 1) % step != 0) result.push_back(points.back());
  return result;
}

/// Extends the axes to the lines' largest values.
void fit_axes(Chart& chart) {
  for (const ChartLine& line : chart.lines) {
    for (const geometry::Vec2& p : line.points) {
      chart.x.high = std::max(chart.x.high, p.x());
      chart.y.high = std::max(chart.y.high, 1.05 * p.y());
    }
  }
}

}  // namespace

Figure paths_figure(const RunFolder& run) {
  drawing::TopView view{"Paths from above", "Estimated, true and receiver's positions of each flight", {}, {}, {}};
  for (const FlightRun& flight : run.flights) add_tracks(flight, view.tracks, view.legend);
  if (view.tracks.empty()) return {};
  view.extent = fit_extent(view.tracks.front().points, 0.08);
  for (const TrackLayer& track : view.tracks)
    view.extent = drawing::merge_extents(view.extent, fit_extent(track.points, 0.08));
  view.extent = drawing::limit_aspect_ratio(view.extent);
  if (run.voxel_centers)
    view.images.push_back({"backdrop", drawing::draw_voxels(view.extent, *run.voxel_centers, run.voxel_m)});
  const drawing::Drawing drawing = drawing::to_drawing(view);
  Figure figure{"paths", "paths", drawing::on_page(drawing),
                "Flights from above, after the maps were aligned; a ring marks the start."};
  figure.files = {{"paths.svg", "image/svg+xml", drawing::svg_file(view.title, {drawing})},
                  {"paths.csv", "text/csv", drawing::to_csv(poses_of(run))}};
  return figure;
}

Figure path_error_figure(const RunFolder& run) {
  Chart chart{
      "Error along the path", "", {"distance flown, m", 0, 1}, {"distance from the true path, m", 0, 1e-3}, {}, {}};
  for (const FlightRun& flight : run.flights) {
    const std::vector<geometry::Vec2> points = error_along(flight);
    if (points.size() < 2) continue;
    double largest = 0;
    for (const geometry::Vec2& p : points) largest = std::max(largest, p.y());
    chart.description += flight.label + ": at most " + format_fixed(largest, 3) + " m. ";
    chart.lines.push_back({flight.label, flight.key, subsample(points), false});
  }
  if (chart.lines.empty()) return {};
  fit_axes(chart);
  return chart_figure("path-error", chart,
                      "Distance between the estimated and the true path after the maps were aligned. The errors in the "
                      "table are after aligning the paths themselves.");
}

Figure overlap_figure(const RunFolder& run) {
  Chart chart{"Similarity of both flights' views", "", {"time, s", 0, 1e-3}, {"from 0 to 1", 0, 1}, {}, {}};
  const std::vector<std::pair<std::string, std::string>> kinds{{"Overlap of views", "overlap"},
                                                               {"Correlation of images", "correlation"},
                                                               {"Structural similarity", "structure"}};
  for (std::size_t kind = 0; kind < kinds.size(); ++kind) {
    ChartLine line{kinds[kind].first, kinds[kind].second, {}};
    for (const ViewPair& pair : run.view_pairs) {
      const double value = std::array{pair.overlap, pair.ncc, pair.ssim}[kind];
      if (std::isfinite(value)) line.points.emplace_back(pair.time_s, std::max(0.0, value));
    }
    if (line.points.size() > 1) chart.lines.push_back(std::move(line));
  }
  if (chart.lines.empty()) return {};
  fit_axes(chart);
  chart.y.high = 1.0;
  return chart_figure(
      "view-overlap", chart,
      "How much of the same surface both flights see at the same time, and how similar their images are.");
}

}  // namespace tileflight::report
