// The page of trajectories that were scored alone: metrics.json and trajectory-errors.json of a folder.
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/warning.h"
#include "tileflight/core/drawing/number_format.h"
#include "tileflight/core/drawing/top_view.h"
#include "tileflight/experiments/report/chart_figure.h"
#include "tileflight/experiments/report/report.h"
#include "tileflight/experiments/report/tables.h"
#include "tileflight/experiments/report/view_data.h"
#include "tileflight/experiments/report/warnings_panel.h"

namespace tileflight::report {
using drawing::Chart;
using drawing::element;
using drawing::Figure;
using drawing::format_count;
using drawing::format_fixed;
using drawing::GroundExtent;
using drawing::Html;
using drawing::number_at;
using drawing::text;
using drawing::text_at;
using drawing::TopView;
using drawing::TrackLayer;
using drawing::write_figures;

namespace {

using geometry::Vec2;
using geometry::Vec3;
using nlohmann::json;

constexpr const char* kErrorsFile = "trajectory-errors.json";

/// An estimated trajectory, pose by pose: aligned to the truth, with its errors.
struct ComparedPath {
  std::string name;
  std::string style;  ///< class of the style sheet
  std::vector<double> time_s, distance_m, error_m;
  std::vector<double> step_m, step_deg;  ///< error of the motion to each pose but the first
  std::vector<Vec3> truth, estimate;
};

/// The contents of the folder.
struct ScoredPaths {
  std::string metrics_file;  ///< name in the folder, metrics.json as a rule
  json metrics;
  json scores;  ///< list of `trajectory`, one for each path
  std::string alignment;
  bool has_times = true;  ///< else time_s are indices
  std::vector<ComparedPath> paths;
};

// --------------------------------------------------------------------------------------------------- reading the files

std::vector<double> numbers_of(const json& object, const char* key, std::size_t count, const std::string& file) {
  const auto found = object.find(key);
  const bool is_list = found != object.end() && found->is_array() && found->size() == count &&
                       std::all_of(found->begin(), found->end(), [](const json& v) { return v.is_number(); });
  if (!is_list)
    throw InputError(file, "'" + std::string(key) + "' must be a list of " + std::to_string(count) + " numbers");
  return found->get<std::vector<double>>();
}

std::vector<Vec3> positions_of_key(const json& object, const char* key, std::size_t count, const std::string& file) {
  const json list = object.value(key, json());
  if (!list.is_array() || list.size() != count)
    throw InputError(file, "'" + std::string(key) + "' must be a list of " + std::to_string(count) + " positions");
  std::vector<Vec3> result;
  for (std::size_t i = 0; i < count; ++i) {
    const std::vector<double> p = numbers_of(json{{key, list[i]}}, key, 3, file);
    result.emplace_back(p[0], p[1], p[2]);
  }
  return result;
}

/// Colours repeat after eight paths, dashed.
std::string style_of_path(std::size_t index) {
  return "series-" + std::to_string(index % 8 + 1) + (index < 8 ? "" : " later-round");
}

ComparedPath read_path(const json& object, std::size_t index, const std::string& file) {
  const std::size_t poses = object.is_object() ? object.value("time", json::array()).size() : 0;
  if (poses < 2) throw InputError(file, "'time' must be a list of at least 2 numbers");
  ComparedPath path{.name = text_at(object, "/name").value_or("trajectory"), .style = style_of_path(index)};
  path.time_s = numbers_of(object, "time", poses, file);
  path.distance_m = numbers_of(object, "distance", poses, file);
  path.error_m = numbers_of(object, "error", poses, file);
  path.step_m = numbers_of(object, "step_translation", poses - 1, file);
  const bool has_rotations = !object.value("step_rotation_deg", json()).empty();  // a receiver measures none
  path.step_deg = numbers_of(object, "step_rotation_deg", has_rotations ? poses - 1 : 0, file);
  path.truth = positions_of_key(object, "truth", poses, file);
  path.estimate = positions_of_key(object, "estimate", poses, file);
  return path;
}

ScoredPaths read_scored_paths(const std::filesystem::path& folder) {
  const std::filesystem::path file = folder / kErrorsFile;
  const json errors = base::read_json(file);
  ScoredPaths result;
  result.metrics_file = std::filesystem::path(text_at(errors, "/metrics").value_or("metrics.json")).filename().string();
  result.metrics = base::read_json(folder / result.metrics_file);
  refuse_earlier_key(result.metrics, folder / result.metrics_file);
  const json list = errors.is_object() ? errors.value("trajectories", json()) : json();
  if (!list.is_array() || list.empty()) throw InputError(file.string(), "'trajectories' must be a list");
  result.alignment = text_at(errors, "/alignment").value_or("");
  result.has_times = errors.value("has_times", json(true)) != json(false);
  for (const json& object : list) result.paths.push_back(read_path(object, result.paths.size(), file.string()));
  result.scores = result.metrics.contains("trajectory") ? json::array({result.metrics["trajectory"]})
                                                        : result.metrics.value("trajectories", json::array());
  if (result.scores.size() != result.paths.size())
    throw InputError(file.string(), "belongs to another " + result.metrics_file + "; evaluate the trajectories again");
  return result;
}

// ------------------------------------------------------------------------------------------------------------- tables

Table absolute_errors_table(const ScoredPaths& scored) {
  Table table{"Distance of each pose from the true one after alignment (ATE), metres",
              {"trajectory", "poses", "RMSE", "mean", "median", "std", "min", "max"},
              {}};
  for (std::size_t i = 0; i < scored.paths.size(); ++i) {
    const json& m = scored.scores[i];
    std::vector<std::string> row{scored.paths[i].name, format_count(number_at(m, "/poses"))};
    for (const char* key : {"/ate_rmse", "/ate_mean", "/ate_median", "/ate_std", "/ate_min", "/ate_max"})
      row.push_back(format_fixed(number_at(m, key), 4));
    table.rows.push_back(row);
  }
  return table;
}

Table drift_table(const ScoredPaths& scored) {
  Table table{"Drift, scale and extent",
              {"trajectory", "drift, %", "drift, °/m", "scale", "scale drift, rms", "true path, m", "time covered",
               "estimated poses", "true poses"},
              {}};
  for (std::size_t i = 0; i < scored.paths.size(); ++i) {
    const json& m = scored.scores[i];
    table.rows.push_back({scored.paths[i].name, format_fixed(number_at(m, "/drift/translation_percent"), 3),
                          format_fixed(number_at(m, "/drift/rotation_deg_per_m"), 4),
                          format_fixed(number_at(m, "/scale"), 4), format_fixed(number_at(m, "/scale_drift/rms"), 4),
                          format_fixed(number_at(m, "/path_length"), 2),
                          drawing::format_percent(number_at(m, "/time_covered")),
                          format_count(number_at(m, "/poses_estimated")), format_count(number_at(m, "/poses_true"))});
  }
  return table;
}

void add_relative_rows(const std::string& name, const json& list, const char* delta, const std::string& unit,
                       Table& table) {
  for (const json& e : list) {
    std::vector<std::string> row{name, drawing::format_shortest(number_at(e, delta)) + unit,
                                 format_count(number_at(e, "/pairs"))};
    for (const char* key : {"/translation_rmse_m", "/translation_m/mean", "/translation_m/median", "/translation_m/max",
                            "/rotation_rmse_deg", "/rotation_deg/mean", "/rotation_deg/median", "/rotation_deg/max"})
      row.push_back(format_fixed(number_at(e, key), 4));
    table.rows.push_back(row);
  }
}

Table relative_errors_table(const ScoredPaths& scored) {
  Table table{"Error of the motion over a number of frames and over a path length (RPE): metres, then degrees",
              {"trajectory", "over", "pairs", "RMSE, m", "mean", "median", "max", "RMSE, °", "mean", "median", "max"},
              {}};
  for (std::size_t i = 0; i < scored.paths.size(); ++i) {
    const json& m = scored.scores[i];
    add_relative_rows(scored.paths[i].name, m.value("rpe_frames", json::array()), "/delta_frames", " frames", table);
    add_relative_rows(scored.paths[i].name, m.value("rpe", json::array()), "/delta_m", " m", table);
  }
  return table;
}

// ------------------------------------------------------------------------------------------------------------- figures

/// At most some 600 points: of each group of neighbours the one with the largest error, so that no peak is lost.
std::vector<Vec2> thinned(const std::vector<double>& x, const std::vector<double>& y) {
  constexpr std::size_t kMostPoints = 600;
  const std::size_t step = y.size() / kMostPoints + 1;
  std::vector<Vec2> points;
  for (std::size_t from = 0; from < y.size(); from += step) {
    const std::size_t to = std::min(from + step, y.size());
    const auto largest = static_cast<std::size_t>(
        std::max_element(y.begin() + static_cast<std::ptrdiff_t>(from), y.begin() + static_cast<std::ptrdiff_t>(to)) -
        y.begin());
    points.emplace_back(x[largest], y[largest]);
  }
  return points;
}

/// Millimetres for errors below 10 cm, else metres.
struct LengthUnit {
  double per_metre = 1.0;
  std::string name = "m";
};

LengthUnit unit_for(const ScoredPaths& scored, std::vector<double> ComparedPath::*errors_m) {
  double largest_m = 0.0;
  for (const ComparedPath& path : scored.paths) {
    for (const double e : path.*errors_m) largest_m = std::max(largest_m, e);
  }
  return largest_m < 0.1 ? LengthUnit{1000.0, "mm"} : LengthUnit{};
}

std::vector<double> in_unit(std::vector<double> lengths_m, const LengthUnit& unit) {
  for (double& length : lengths_m) length *= unit.per_metre;
  return lengths_m;
}

/// A chart with one line for each path. `x` and `y` give its values.
template <typename X, typename Y>
Figure error_chart(const ScoredPaths& scored, const std::string& id, Chart chart, const std::string& caption, X x,
                   Y y) {
  chart.x.high = chart.y.high = 1e-9;
  for (const ComparedPath& path : scored.paths) {
    drawing::ChartLine line{path.name, path.style, thinned(x(path), y(path)), false};
    for (const Vec2& p : line.points) {
      chart.x.high = std::max(chart.x.high, p.x());
      chart.y.high = std::max(chart.y.high, 1.05 * p.y());
    }
    chart.lines.push_back(std::move(line));
  }
  return chart_figure(id, chart, caption);
}

/// Seconds since the first time of all paths; without times the index.
std::vector<double> elapsed(const ScoredPaths& scored, const ComparedPath& path) {
  double start = path.time_s.front();
  for (const ComparedPath& other : scored.paths) start = std::min(start, other.time_s.front());
  std::vector<double> result = path.time_s;
  for (double& t : result) t -= start;
  return result;
}

/// All but the first.
std::vector<double> rest_of(std::vector<double> values) {
  values.erase(values.begin());
  return values;
}

std::vector<Figure> error_figures(const ScoredPaths& scored) {
  const std::string time = scored.has_times ? "time, s" : "pose";
  const auto by_time = [&](const ComparedPath& path) { return elapsed(scored, path); };
  const auto step_time = [&](const ComparedPath& path) { return rest_of(elapsed(scored, path)); };
  const auto flown = [](const ComparedPath& path) { return path.distance_m; };
  const LengthUnit unit = unit_for(scored, &ComparedPath::error_m), step_unit = unit_for(scored, &ComparedPath::step_m);
  const auto error = [&](const ComparedPath& path) { return in_unit(path.error_m, unit); };
  const auto step_error = [&](const ComparedPath& path) { return in_unit(path.step_m, step_unit); };
  const auto chart = [](const std::string& title, const std::string& x, const std::string& y) {
    return Chart{title, "", {x, 0, 1}, {y, 0, 1}, {}, {}};
  };
  const std::string distance = "distance from the true pose, " + unit.name;
  const std::string peaks = " Of more than 600 poses the largest of each group is drawn.";
  std::vector<Figure> figures{
      error_chart(scored, "error-over-time", chart("Error over time", time, distance),
                  "Distance of each aligned pose from the true one (ATE) over time." + peaks, by_time, error),
      error_chart(scored, "error-over-distance",
                  chart("Error over distance", "distance along the true path, m", distance),
                  "The same over the distance travelled along the true path.", flown, error),
      error_chart(scored, "relative-translation",
                  chart("Relative error, translation", time, "error of one step, " + step_unit.name),
                  "Error of the motion from each pose to the next (RPE over one frame), translation." + peaks,
                  step_time, step_error)};
  if (std::ranges::none_of(scored.paths, [](const ComparedPath& path) { return path.step_deg.empty(); })) {
    figures.push_back(
        error_chart(scored, "relative-rotation", chart("Relative error, rotation", time, "error of one step, °"),
                    "The same, rotation.", step_time, [](const ComparedPath& path) { return path.step_deg; }));
  }
  return figures;
}

/// Extent of the points with a margin, of any size: trajectories may be of a hand's breadth.
GroundExtent extent_of(const std::vector<TrackLayer>& tracks) {
  GroundExtent extent{1e300, -1e300, 1e300, -1e300};
  for (const TrackLayer& track : tracks) {
    for (const Vec3& p : track.points) extent = drawing::merge_extents(extent, {p.x(), p.x(), p.y(), p.y()});
  }
  const double border = std::max(1e-6, 0.06 * std::max(extent.width_m(), extent.height_m()));
  return drawing::limit_aspect_ratio(
      {extent.west - border, extent.east + border, extent.south - border, extent.north + border});
}

/// Every so many positions, along two axes.
std::vector<Vec3> flattened(const std::vector<Vec3>& positions, int across, int up) {
  constexpr std::size_t kMostPoints = 4000;
  const std::size_t step = positions.size() / kMostPoints + 1;
  std::vector<Vec3> result;
  for (std::size_t i = 0; i < positions.size(); i += step)
    result.emplace_back(positions[i][across], positions[i][up], 0);
  return result;
}

/// The paths seen along one axis. The longest of the compared parts of the truth is drawn.
Figure paths_seen(const ScoredPaths& scored, const std::string& id, TopView view, int across, int up,
                  const std::string& caption) {
  const ComparedPath& longest = *std::max_element(
      scored.paths.begin(), scored.paths.end(),
      [](const ComparedPath& a, const ComparedPath& b) { return a.distance_m.back() < b.distance_m.back(); });
  view.tracks.push_back({"reference", flattened(longest.truth, across, up), false});
  view.legend.push_back({"truth", "line reference"});
  for (const ComparedPath& path : scored.paths) {
    view.tracks.push_back({path.style, flattened(path.estimate, across, up), false});
    view.legend.push_back({path.name, "line " + path.style});
  }
  view.extent = extent_of(view.tracks);
  const drawing::Drawing drawing = drawing::to_drawing(view);
  Figure figure{id, "paths", drawing::on_page(drawing), caption};
  figure.files = {{id + ".svg", "image/svg+xml", drawing::svg_file(view.title, {drawing})}};
  return figure;
}

std::vector<Figure> path_figures(const ScoredPaths& scored) {
  TopView above{"Paths from above", "True path and aligned estimates along x and y", {}, {}, {}};
  above.x_label = "x, m";
  above.y_label = "y, m";
  TopView side{"Paths from the side", "True path and aligned estimates along x and z", {}, {}, {}};
  side.x_label = "x, m";
  side.y_label = "z, m";
  return {paths_seen(scored, "paths-above", above, 0, 1,
                     "The true path and the aligned estimates along the truth's x and y; rings mark the starts."),
          paths_seen(scored, "paths-side", side, 0, 2, "The same along x and z.")};
}

// ------------------------------------------------------------------------------------------------------------- page

Html page_section(const std::string& id, const std::string& title, const Html& content) {
  return element("section", {{"id", id}, {"aria-labelledby", id + "-title"}},
                 element("h2", {{"id", id + "-title"}}, text(title)) + content);
}

Html side_by_side(const std::vector<Figure>& figures) {
  Html content;
  for (const Figure& figure : figures) content += to_html(figure);
  return element("div", {{"class", "columns"}}, content);
}

std::string words_for(const std::string& alignment) {
  if (alignment == "sim3") return "rotation, translation and scale (Sim(3))";
  if (alignment == "se3") return "rotation and translation (SE(3))";
  return "nothing";
}

}  // namespace

bool holds_trajectories_alone(const std::filesystem::path& folder) {
  return std::filesystem::exists(folder / kErrorsFile) && !std::filesystem::exists(folder / "results.json");
}

void write_trajectory_report(const std::filesystem::path& folder) {
  const ScoredPaths scored = read_scored_paths(folder);
  const std::vector<Figure> paths = path_figures(scored), errors = error_figures(scored);
  const std::string name = scored.paths.size() == 1
                               ? "Trajectory " + scored.paths.front().name
                               : std::to_string(scored.paths.size()) + " trajectories against the truth";
  const std::string subtitle = "Compared with the true trajectory after alignment of " + words_for(scored.alignment) +
                               ". Numbers in full precision are in " + scored.metrics_file + ".";
  const Html header =
      element("header", element("h1", text(name)) + element("p", {{"class", "subtitle"}}, text(subtitle)) +
                            warnings_panel(scored.metrics));
  const Html main = element("main", {{"id", "main"}},
                            page_section("absolute", "Absolute error",
                                         to_html(absolute_errors_table(scored)) + to_html(drift_table(scored))) +
                                page_section("paths", "Paths", side_by_side(paths)) +
                                page_section("errors", "Error along the path", side_by_side(errors)) +
                                page_section("relative", "Relative error", to_html(relative_errors_table(scored))));
  const Html skip = element("a", {{"class", "skip"}, {"href", "#main"}}, text("Skip to the results"));
  const Html footer = element("footer", text("Made by tileflight."));
  const Html page = element("html", {{"lang", "en"}}, page_head(name) + element("body", skip + header + main + footer));
  base::write_file(folder / "report.html", "<!DOCTYPE html>\n" + page.str() + "\n");
  write_figures(folder / "figures", paths);
  write_figures(folder / "figures", errors);
}

}  // namespace tileflight::report
