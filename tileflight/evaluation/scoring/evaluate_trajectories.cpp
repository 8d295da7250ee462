#include "tileflight/evaluation/scoring/evaluate_trajectories.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <system_error>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/order_statistics.h"
#include "tileflight/core/base/warning.h"
#include "tileflight/core/geometry/json_numbers.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/evaluation/scoring/map_inputs.h"
#include "tileflight/evaluation/scoring/warnings.h"

namespace tileflight::scoring {
namespace fs = std::filesystem;
namespace {

using geometry::TrajectoryFile;
using metrics::PairedTrajectories;
using metrics::TrajectoryAlignment;
using metrics::TrajectoryMetrics;
using metrics::TrajectoryOptions;
using nlohmann::json;

/// Names by which the estimates are told apart.
std::vector<std::string> names_of(const std::vector<fs::path>& estimates) {
  std::vector<std::string> names;
  for (const fs::path& file : estimates) names.push_back(file.stem().string());
  if (std::set<std::string>(names.begin(), names.end()).size() == names.size()) return names;
  for (std::size_t i = 0; i < estimates.size(); ++i) {
    names[i] = estimates[i].string();
    for (std::size_t k = 0; k < i; ++k)
      if (names[k] == names[i]) throw InputError(names[i], "is given twice; give each estimate once");
  }
  return names;
}

TrajectoryFile shifted(TrajectoryFile file, double offset_s) {
  for (geometry::StampedPose& pose : file.trajectory.poses) pose.time_s += offset_s;
  return file;
}

/// A file of poses, or those of a dataset.
TrajectoryFile read_true_trajectory(const fs::path& file_or_dataset) {
  if (!fs::is_directory(file_or_dataset)) return geometry::read_trajectory(file_or_dataset);
  return {.trajectory = read_true_poses(file_or_dataset)};
}

/// An estimate and its score.
struct ScoredTrajectory {
  std::string name;
  PairedTrajectories poses;
  TrajectoryMetrics metrics;
  std::optional<double> best_scale;  ///< of the Sim(3) alignment, where another one was asked for
  std::string misread;               ///< of find_misread_rotations()
  Warnings warnings;                 ///< of score_by_receiver()
};

/// The poses as they are if the file has the quaternion's w at the other end than where it was read.
geometry::Trajectory with_other_order(geometry::Trajectory trajectory, bool has_w_first) {
  for (geometry::StampedPose& pose : trajectory.poses) {
    const Eigen::Quaterniond q = pose.T_local_camera.rotation;
    pose.T_local_camera.rotation = has_w_first ? Eigen::Quaterniond(q.x(), q.y(), q.z(), q.w())   // was read as x first
                                               : Eigen::Quaterniond(q.z(), q.w(), q.x(), q.y());  // was read as w first
  }
  return trajectory;
}

/// Returns whose rotations agree far better with the other's if its quaternions are read in another order: "estimate
/// with w first", "truth with w last" and so on; empty if none do. The files themselves cannot tell: both orders are in
/// use.
std::string find_misread_rotations(const geometry::Trajectory& estimate, const geometry::Trajectory& truth,
                                   const PairedTrajectories& poses, const TrajectoryOptions& options) {
  constexpr double kLarge_deg = 1.0, kFarBetter = 0.2;
  const auto typical_deg = [](const PairedTrajectories& pairs) {
    std::vector<double> errors = metrics::compute_step_errors(pairs).rotation_deg;
    return base::upper_median(std::move(errors));
  };
  if (poses.truth.size() < 2) return "";
  const double as_read_deg = typical_deg(poses);
  if (as_read_deg < kLarge_deg) return "";
  const auto agrees = [&](const geometry::Trajectory& a, const geometry::Trajectory& b) {
    return typical_deg(metrics::pair_and_align(a, b, options)) < kFarBetter * as_read_deg;
  };
  for (const bool has_w_first : {true, false}) {
    const std::string order = has_w_first ? " with w first" : " with w last";
    if (agrees(with_other_order(estimate, has_w_first), truth)) return "estimate" + order;
    if (agrees(estimate, with_other_order(truth, has_w_first))) return "truth" + order;
  }
  return "";
}

std::optional<double> scale_by_sim3(const TrajectoryFile& estimate, const TrajectoryFile& truth,
                                    TrajectoryOptions options) {
  if (options.alignment == TrajectoryAlignment::kSim3) return std::nullopt;
  options.alignment = TrajectoryAlignment::kSim3;
  try {
    return metrics::pair_and_align(estimate.trajectory, truth.trajectory, options).T_truth_estimate.scale;
  } catch (const InputError&) {
    return std::nullopt;  // an estimate that stands still has an error, but no scale
  }
}

ScoredTrajectory score_file(const fs::path& file, const std::string& name, const TrajectoryFile& truth,
                            const TrajectoryScoring& scoring) {
  TrajectoryFile estimate = geometry::read_trajectory(file);
  TrajectoryOptions options = scoring.options;
  if (!scoring.time_offset_s)
    throw InputError("--time-offset", "auto needs a receiver's positions as truth; give the offset in seconds");
  if (!estimate.has_times() || !truth.has_times()) {
    options.pairing = metrics::TrajectoryPairing::kByIndex;
    if (scoring.time_offset_s != 0.0)
      throw InputError((truth.has_times() ? file : scoring.truth).string(),
                       "KITTI poses have no times, so there is no time offset");
  }
  estimate = shifted(std::move(estimate), *scoring.time_offset_s);
  try {
    ScoredTrajectory scored{.name = name,
                            .poses = metrics::pair_and_align(estimate.trajectory, truth.trajectory, options),
                            .metrics = {},
                            .best_scale = scale_by_sim3(estimate, truth, options),
                            .misread = {},
                            .warnings = {}};
    scored.metrics = metrics::score_trajectory(scored.poses, options);
    scored.misread = find_misread_rotations(estimate.trajectory, truth.trajectory, scored.poses, options);
    return scored;
  } catch (const InputError& error) {
    throw InputError(file.string(), error.what());
  }
}

ScoredTrajectory score_by_positions(const fs::path& file, const std::string& name, const ReceiverTruth& truth,
                                    const TrajectoryScoring& scoring) {
  const TrajectoryFile estimate = geometry::read_trajectory(file);
  if (!estimate.has_times())
    throw InputError(file.string(), "KITTI poses have no times, by which a receiver's positions are compared");
  const ReceiverScoring by{.time_offset_s = scoring.time_offset_s, .lever_arm_m = scoring.lever_arm_m};
  ReceiverScore score = score_by_receiver(estimate.trajectory, truth, scoring.options.alignment, by, name);
  return {.name = name,
          .poses = score.poses,
          .metrics = score_trajectory(score, scoring.options),
          .best_scale = std::nullopt,
          .misread = {},
          .warnings = std::move(score.warnings)};
}

std::string percent(double share) { return std::to_string(static_cast<int>(std::floor(100.0 * share))) + " %"; }

/// Returns the warnings about the scores of a trajectory.
Warnings warnings_about(const ScoredTrajectory& scored) {
  constexpr double kFewPaired = 0.5, kPartOfTime = 0.9, kScaleOff = 0.1;
  const TrajectoryMetrics& m = scored.metrics;
  Warnings warnings = scored.warnings;
  const double paired = static_cast<double>(m.poses) / static_cast<double>(std::min(m.estimated_poses, m.true_poses));
  if (paired < kFewPaired && !m.receiver) {
    warnings.push_back({std::to_string(m.poses) + " pairs of " + std::to_string(m.estimated_poses) + " estimated and " +
                            std::to_string(m.true_poses) + " true poses: most have none of the other at their time",
                        scored.name, Severity::kWarning, "check the clocks (--time-offset, --max-time-difference)"});
  }
  if (m.time_covered < kPartOfTime) {
    warnings.push_back(
        {"the estimate covers " + percent(m.time_covered) + " of the truth's time: errors of the rest are in no number",
         scored.name, Severity::kNote,
         "compare with systems that covered as much, unless the truth was recorded for longer than the images"});
  }
  for (Warning& warning :
       gap_warnings(scored.poses.truth, scored.poses.true_duration_s, scored.poses.unrecorded, scored.name))
    warnings.push_back(std::move(warning));
  if (scored.best_scale && std::abs(*scored.best_scale - 1.0) > kScaleOff) {
    warnings.push_back({"the scale that fits best is " + std::to_string(*scored.best_scale).substr(0, 5) +
                            ", and the alignment has none",
                        scored.name, Severity::kNote, "--alignment sim3 for a trajectory of unknown scale"});
  }
  if (!scored.misread.empty()) {
    warnings.push_back({"the rotations agree far better if the quaternions are read otherwise: the " + scored.misread +
                            "; the rotation errors are likely wrong",
                        scored.name, Severity::kWarning,
                        "give the file a heading that names its columns: `# timestamp tx ty tz qw qx qy qz`"});
  }
  return warnings;
}

/// Aligned poses and their errors, pair by pair.
json series_of(const ScoredTrajectory& scored) {
  const metrics::StepErrors steps = metrics::compute_step_errors(scored.poses);
  json time = json::array(), distance = time, truth = time, estimate = time, error = time;
  double flown_m = 0.0;
  for (std::size_t i = 0; i < scored.poses.truth.size(); ++i) {
    const geometry::Vec3& t = scored.poses.truth.poses[i].T_local_camera.translation;
    const geometry::Vec3& e = scored.poses.estimate.poses[i].T_local_camera.translation;
    if (i > 0) flown_m += (t - scored.poses.truth.poses[i - 1].T_local_camera.translation).norm();
    time.push_back(scored.poses.truth.poses[i].time_s);
    distance.push_back(flown_m);
    truth.push_back(geometry::json_numbers(t));
    estimate.push_back(geometry::json_numbers(e));
    error.push_back((t - e).norm());
  }
  return {{"name", scored.name},
          {"time", time},
          {"distance", distance},
          {"truth", truth},
          {"estimate", estimate},
          {"error", error},
          {"step_translation", steps.translation_m},
          {"step_rotation_deg", scored.metrics.receiver ? json::array() : json(steps.rotation_deg)}};
}

json metrics_json(const std::vector<ScoredTrajectory>& all, Warnings warnings) {
  json list = json::array();
  for (const ScoredTrajectory& scored : all) {
    json one = metrics::to_json(scored.metrics);
    one["name"] = scored.name;
    list.push_back(std::move(one));
    for (Warning& warning : warnings_about(scored)) warnings.push_back(std::move(warning));
  }
  json result;
  if (all.size() == 1) {
    list[0].erase("name");  // the keys of a map's metrics.json
    result["trajectory"] = list[0];
  } else {
    result["trajectories"] = list;
  }
  result["warnings"] = to_json(warnings);
  return result;
}

}  // namespace

fs::path trajectory_errors_file(const fs::path& metrics_json) {
  return metrics_json.parent_path() / "trajectory-errors.json";
}

json evaluate_trajectories(const TrajectoryScoring& scoring, const fs::path& out) {
  const std::vector<std::string> names = names_of(scoring.estimates);
  const std::optional<ReceiverTruth> receiver = read_receiver_truth(scoring.truth);
  const TrajectoryFile truth = receiver ? TrajectoryFile() : read_true_trajectory(scoring.truth);
  if (!receiver && !scoring.lever_arm_m.isZero())
    throw InputError("--lever-arm", "is for a receiver's positions; true poses are those of the camera");
  std::vector<ScoredTrajectory> all;
  for (std::size_t i = 0; i < names.size(); ++i) {
    all.push_back(receiver ? score_by_positions(scoring.estimates[i], names[i], *receiver, scoring)
                           : score_file(scoring.estimates[i], names[i], truth, scoring));
  }
  Warnings of_truth;
  if (receiver) {
    for (const std::string& text : receiver->warnings)
      of_truth.push_back({text, scoring.truth.filename().string(), Severity::kNote, ""});
  }
  const json metrics = metrics_json(all, std::move(of_truth));
  json series = json::array();
  for (const ScoredTrajectory& scored : all) series.push_back(series_of(scored));
  const json errors = {{"alignment", metrics::name_of(scoring.options.alignment)},
                       {"has_times", truth.has_times()},
                       {"metrics", out.filename().string()},
                       {"trajectories", series}};
  const auto dumped = [](const json& object, int indent) {
    return object.dump(indent, ' ', false, json::error_handler_t::replace) + "\n";
  };
  std::error_code error;  // ignored: writing the file reports it
  if (out.has_parent_path()) fs::create_directories(out.parent_path(), error);
  base::write_file(trajectory_errors_file(out), dumped(errors, -1));
  base::write_file(out, dumped(metrics, 2));
  return metrics;
}

void score_flight_without_place(const fs::path& odometry, const fs::path& dataset, const fs::path& out) {
  json metrics{{"trajectory", nullptr}};
  Warnings warnings = odometry_warnings(find_map_inputs(odometry, dataset));
  append_distinct(warnings, dataset_warnings(dataset));
  const bool has_truth = fs::exists(dataset / "groundtruth.txt") || fs::exists(dataset / "gps.csv");
  if (!has_truth) {
    warnings.push_back({"the flight has no recorded positions, so the error and the scale of its path are not known",
                        "trajectory", Severity::kNote, "give its flight log (telemetry)"});
  } else {
    try {
      metrics =
          evaluate_trajectories({.estimates = {odometry / "trajectory.txt"}, .truth = dataset, .options = {}}, out);
      append_distinct(warnings, read_warnings(out));
    } catch (const InputError& fault) {
      warnings.push_back({std::string("the path is not compared with the recorded positions: ") + fault.what(),
                          "trajectory", Severity::kWarning, ""});
    }
  }
  metrics["warnings"] = to_json(warnings);
  base::write_file(out, metrics.dump(2, ' ', false, json::error_handler_t::replace) + "\n");
}

}  // namespace tileflight::scoring
