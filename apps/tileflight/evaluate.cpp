#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>

#include "command.h"
#include "input_options.h"
#include "number_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/evaluation/scoring/evaluate_trajectories.h"
#include "tileflight/experiments/experiment/stage_options.h"
#include "tileflight/experiments/report/report.h"
#include "warnings_text.h"

namespace tileflight::app {
namespace {

using nlohmann::json;

struct EvaluateOptions {
  std::string map, dataset, truth, transform, truth_trajectory, out;
  std::vector<std::string> trajectories;
  scoring::EvaluationSettings settings;
  std::string settings_file;  ///< replaces `settings`; empty: none
  std::string alignment = "sim3";
  metrics::TrajectoryOptions trajectory;
  std::string time_offset = "0";
  std::vector<double> lever_arm{0.0, 0.0, 0.0};
  bool report = false;
};

/// Throws InputError if metrics.json or a file written beside it is an input; makes their folder.
void prepare_output_files(const std::vector<std::filesystem::path>& written,
                          const std::vector<std::filesystem::path>& inputs) {
  for (const std::filesystem::path& file : written) base::prepare_output_file(file, inputs);
}

// ------------------------------------------------------------------------------------------------------------- a map

MapOptions map_options(const EvaluateOptions& options) {
  return {options.map, options.dataset, options.trajectories.empty() ? "" : options.trajectories.front(),
          options.truth_trajectory};
}

std::string wasserstein_text(const json& w) {
  if (!w.is_object() || w["awd"].is_null()) return "";
  return "AWD " + rounded(w["awd"]) + " m (up to " + rounded(w["chance"]) + " by chance), SCS " + rounded(w["scs"]) +
         ", of " + percent_text(w["share_of_map"]) + " of the map's points and " + percent_text(w["share_of_truth"]) +
         " of the surface seen\n";
}

std::string moving_text(const json& moving) {
  return "on moving objects: " + moving["points"].dump() + " points (" + percent_text(moving["share"]) +
         "), left out of all scores\n";
}

Output evaluate_map(const EvaluateOptions& options, const Progress& progress) {
  const MapOptions map = map_options(options);
  std::vector<std::filesystem::path> inputs = files_named(map);
  inputs.insert(inputs.end(), {options.truth, options.transform, options.settings_file});
  const scoring::EvaluationSettings settings =
      options.settings_file.empty() ? options.settings : experiment::read_evaluation_file(options.settings_file);
  const std::filesystem::path out = options.out;
  prepare_output_files(
      {out, out.parent_path() / "errors.ply", scoring::seen_surface_file(out), scoring::moving_points_file(out)},
      inputs);
  const json m =
      to_json(scoring::evaluate(map_inputs(map), options.truth, options.transform, settings, options.out, progress));
  std::ostringstream text;
  text << options.out << ": " << m["map"]["correspondences"] << " of " << m["map"]["points"] << " points within "
       << rounded(m["map"]["cutoff"]) << " m of a voxel centre, mean " << rounded(m["map"]["mean"]) << " m, std "
       << rounded(m["map"]["std"]) << " m (floor " << rounded(m["map"]["quantization_floor"]["mean"]) << "); ";
  if (m["surface"].is_null()) {
    text << "the ground truth holds points only, so there are no distances to the surface\n";
  } else {
    text << "to the surface: median " << rounded(m["surface"]["median"]) << " m\n";
  }
  text << wasserstein_text(m["wasserstein"]);
  if (m.contains("moving_objects")) text << moving_text(m["moving_objects"]);
  if (!m["trajectory"].is_null())
    text << "ATE RMSE " << rounded(m["trajectory"]["ate_rmse"]) << " m over " << rounded(m["trajectory"]["path_length"])
         << " m\n";
  return {m, text.str()};
}

// ------------------------------------------------------------------------------------------------ trajectories alone

/// The first entry of a list of relative errors; null if it is empty.
json first_of(const json& list) { return list.empty() ? json({{"pairs", 0}}) : list.front(); }

/// One line of the table: name, then numbers.
std::vector<std::string> row_of(const std::string& name, const json& m) {
  const json frame = first_of(m["rpe_frames"]);
  std::vector<std::string> row{name};
  for (const char* key : {"poses", "ate_rmse", "ate_mean", "ate_median", "ate_std", "ate_max"})
    row.push_back(rounded(m[key]));
  row.push_back(rounded(frame.value("translation_rmse_m", json())));
  row.push_back(rounded(frame.value("rotation_rmse_deg", json())));
  row.push_back(rounded(m["drift"]["translation_percent"]));
  row.push_back(rounded(m["scale"]));
  return row;
}

/// Columns as wide as their widest cell; the first to the left, numbers to the right.
std::string aligned_rows(const std::vector<std::vector<std::string>>& rows) {
  std::vector<std::size_t> widths(rows.front().size(), 0);
  for (const auto& row : rows) {
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  }
  std::string text;
  for (const auto& row : rows) {
    text += row[0] + std::string(widths[0] - row[0].size(), ' ');
    for (std::size_t i = 1; i < row.size(); ++i) text += "  " + std::string(widths[i] - row[i].size(), ' ') + row[i];
    text += "\n";
  }
  return text;
}

std::string trajectories_text(const EvaluateOptions& options, const json& metrics) {
  std::vector<std::vector<std::string>> rows{{"trajectory", "poses", "ATE rmse m", "mean", "median", "std", "max",
                                              "RPE m/frame", "deg/frame", "drift %", "scale"}};
  if (metrics.contains("trajectory")) {
    rows.push_back(row_of(std::filesystem::path(options.trajectories.front()).stem().string(), metrics["trajectory"]));
  } else {
    for (const json& m : metrics["trajectories"]) rows.push_back(row_of(m["name"], m));
  }
  return options.out + ": aligned by " + options.alignment + "\n" + aligned_rows(rows) + warnings_text(metrics);
}

Output evaluate_paths(const EvaluateOptions& options) {
  scoring::TrajectoryScoring scoring{.estimates = {},
                                     .truth = options.truth_trajectory,
                                     .options = options.trajectory,
                                     .time_offset_s = std::nullopt,
                                     .lever_arm_m = Eigen::Map<const geometry::Vec3>(options.lever_arm.data())};
  if (options.time_offset != "auto") {
    const std::optional<double> offset_s = base::parse_number<double>(options.time_offset);
    if (!offset_s || !std::isfinite(*offset_s))
      throw InputError("--time-offset", "is a number of seconds, or auto, not " + options.time_offset);
    scoring.time_offset_s = *offset_s;
  }
  for (const std::string& file : options.trajectories) scoring.estimates.emplace_back(file);
  using Alignment = metrics::TrajectoryAlignment;
  scoring.options.alignment = options.alignment == "sim3"  ? Alignment::kSim3
                              : options.alignment == "se3" ? Alignment::kSE3
                                                           : Alignment::kNone;
  std::vector<std::filesystem::path> inputs = scoring.estimates;
  inputs.push_back(scoring.truth);
  const std::filesystem::path out = options.out;
  prepare_output_files({out, scoring::trajectory_errors_file(out)}, inputs);
  const json metrics = scoring::evaluate_trajectories(scoring, out);
  std::string text = trajectories_text(options, metrics);
  if (options.report) {
    const std::filesystem::path folder = std::filesystem::absolute(out).lexically_normal().parent_path();
    report::write_trajectory_report(folder);
    text += "report: " + (folder / "report.html").string() + "\n";
  }
  return {metrics, text};
}

// ------------------------------------------------------------------------------------------------------------- usage

/// Which of the options were given.
struct GivenOptions {
  CLI::App* command;
  bool operator()(const char* name) const { return command->count(name) > 0; }
  std::optional<std::string> first_of(const std::vector<const char*>& names) const {
    for (const char* name : names)
      if ((*this)(name)) return name;
    return std::nullopt;
  }
};

void check_map_usage(const GivenOptions& given, const EvaluateOptions& options) {
  for (const char* name : {"--truth", "--transform"})
    if (!given(name)) throw CLI::ValidationError(name, "is required with MAP");
  if (options.trajectories.size() > 1)
    throw CLI::ValidationError("--trajectory", "a map has one; several are scored without MAP");
  if (const auto name = given.first_of({"--alignment", "--max-time-difference", "--time-offset", "--lever-arm",
                                        "--rpe-metres", "--rpe-frames", "--report"}))
    throw CLI::ValidationError(*name, "is for trajectories alone, without MAP");
}

void check_paths_usage(const GivenOptions& given, const EvaluateOptions& options) {
  if (const auto name = given.first_of({"--truth", "--transform", "--dataset", "--cutoff", "--wasserstein-voxel",
                                        "--wasserstein-min-points", "--settings"}))
    throw CLI::ValidationError(*name, "scores a map, and MAP is missing (write it before --trajectory)");
  if (options.trajectories.empty() || options.truth_trajectory.empty())
    throw CLI::ValidationError("MAP", "is missing; without a map, give both --trajectory and --truth-trajectory");
}

void add_map_part(CLI::App& command, EvaluateOptions& options) {
  command.add_option("MAP", options.map, "odometry folder (map.ply with trajectory.txt), or a PLY, PCD or XYZ cloud");
  command.add_option("--truth", options.truth, "folder written by `extract` (required with MAP)");
  command.add_option("--transform", options.transform, "transform.json of `align` (required with MAP)");
  command.add_option("--dataset", options.dataset, "dataset folder of the flight: camera, positions, true poses");
  command.add_option("--cutoff", options.settings.cutoff_m, "maximum distance of a correspondence, metres (default 1)")
      ->check(CLI::PositiveNumber);
  command
      .add_option("--wasserstein-voxel", options.settings.wasserstein_voxel_m,
                  "edge of the voxels of AWD and SCS, metres (default 3)")
      ->check(CLI::PositiveNumber);
  command
      .add_option("--wasserstein-min-points", options.settings.wasserstein_min_points,
                  "least points of map and truth in a voxel for AWD and SCS (default 10)")
      ->check(CLI::Range(2, 1'000'000));
  CLI::Option* file =
      command.add_option("--settings", options.settings_file,
                         "experiment or study file whose section `evaluation:` is used instead of options");
  file->check(CLI::ExistingFile);
  for (const char* other : {"--cutoff", "--wasserstein-voxel", "--wasserstein-min-points"})
    file->excludes(command.get_option(other));
}

void add_trajectory_part(CLI::App& command, EvaluateOptions& options) {
  command.add_option("--trajectory", options.trajectories,
                     "estimated poses: with MAP those in the map's frame (TUM; default: the odometry folder's), "
                     "without MAP one or more files (TUM, EuRoC, KITTI)");
  command.add_option("--truth-trajectory", options.truth_trajectory,
                     "true poses: a file, or a dataset folder (required without MAP); for a trajectory alone also a "
                     "receiver's positions: a flight log, a video with telemetry, a folder of photos, a dataset");
  command.add_option("--alignment", options.alignment, "of each trajectory to the truth (default sim3)")
      ->check(CLI::IsMember({"sim3", "se3", "none"}));
  command
      .add_option("--max-time-difference", options.trajectory.max_time_difference_s,
                  "between an estimated and a true pose that are compared, seconds (default 0.01)")
      ->check(CLI::PositiveNumber);
  command.add_option("--time-offset", options.time_offset,
                     "added to the times of the estimates, seconds; auto: estimated, for a receiver's positions");
  command
      .add_option("--lever-arm", options.lever_arm,
                  "of the receiver's antenna in the camera, metres right,down,forward (default 0,0,0)")
      ->delimiter(',')
      ->expected(3);
  command.add_option("--rpe-metres", options.trajectory.rpe_deltas_m, "path lengths of the RPE (default 1,10,50)")
      ->delimiter(',')
      ->check(CLI::PositiveNumber);
  command
      .add_option("--rpe-frames", options.trajectory.rpe_deltas_frames, "numbers of frames of the RPE (default 1,10)")
      ->delimiter(',')
      ->check(CLI::PositiveNumber);
  command.add_flag("--report", options.report, "also write report.html beside metrics.json, for trajectories alone");
}

}  // namespace

void add_evaluate(CLI::App& app, CommonOptions& common, Selection& selection) {
  auto options = std::make_shared<EvaluateOptions>();
  CLI::App* command =
      app.add_subcommand("evaluate", "map and trajectory error of an aligned map, or of trajectories alone");
  command->footer(
      "Example:\n  tileflight evaluate out/odometry --truth out/truth --transform transform.json --out metrics.json\n"
      "  tileflight evaluate --trajectory orb.txt dso.txt --truth-trajectory groundtruth.csv --out metrics.json "
      "--report");
  add_map_part(*command, *options);
  add_trajectory_part(*command, *options);
  command->add_option("--out", options->out, "metrics.json to write; the errors are written beside it")->required();
  add_common_options(*command, common);
  command->callback([options, command, &selection] {
    const GivenOptions given{command};
    const bool has_map = given("MAP");
    if (has_map) {
      check_map_usage(given, *options);
    } else {
      check_paths_usage(given, *options);
    }
    selection.run = [options, has_map](const CommonOptions&, const Progress& progress) -> Output {
      return has_map ? evaluate_map(*options, progress) : evaluate_paths(*options);
    };
  });
}

}  // namespace tileflight::app
