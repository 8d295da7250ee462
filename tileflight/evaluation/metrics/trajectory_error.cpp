#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <span>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/order_statistics.h"
#include "tileflight/evaluation/metrics/metrics.h"
#include "tileflight/evaluation/metrics/trajectory_drift.h"

namespace tileflight::metrics {

using geometry::SE3;
using geometry::Sim3;
using geometry::Trajectory;

namespace {

constexpr double kRadian_deg = 57.295779513082320877;

PairedTrajectories paired_by_index(const Trajectory& estimate, const Trajectory& truth) {
  if (estimate.size() != truth.size()) {
    throw InputError("trajectory", "has " + std::to_string(estimate.size()) + " poses and the truth " +
                                       std::to_string(truth.size()) +
                                       "; poses without times are paired line by line, so both need as many lines");
  }
  if (estimate.size() < 3) throw InputError("trajectory", "has fewer than 3 poses");
  return {.estimate = estimate, .truth = truth};
}

/// "10 ms" for 0.01.
std::string milliseconds(double time_s) {
  std::string text = std::to_string(1000.0 * time_s);
  text.erase(text.find_last_not_of('0') + 1);
  if (text.ends_with('.')) text.pop_back();
  return text + " ms";
}

PairedTrajectories paired_by_time(const Trajectory& estimate, const Trajectory& truth, double max_difference_s) {
  PairedTrajectories result;
  for (const auto& [e, t] : geometry::associate(estimate, truth, max_difference_s)) {
    result.estimate.poses.push_back(estimate.poses[e]);
    result.truth.poses.push_back(truth.poses[t]);
  }
  if (result.estimate.size() < 3) {
    throw InputError("trajectory", "only " + std::to_string(result.estimate.size()) +
                                       " of its poses share a time with the truth (" + milliseconds(max_difference_s) +
                                       "); check that both use one clock");
  }
  return result;
}

void check_finite(const Trajectory& trajectory, const char* name) {
  for (const geometry::StampedPose& pose : trajectory.poses) {
    if (!pose.T_local_camera.translation.allFinite()) throw InputError(name, "a position is not finite");
  }
}

Eigen::Matrix3Xd positions(const Trajectory& trajectory) {
  Eigen::Matrix3Xd result(3, static_cast<Eigen::Index>(trajectory.size()));
  for (std::size_t i = 0; i < trajectory.size(); ++i) {
    result.col(static_cast<Eigen::Index>(i)) = trajectory.poses[i].T_local_camera.translation;
  }
  return result;
}

/// Umeyama 1991, by Eigen.
Sim3 align_umeyama(const PairedTrajectories& poses, TrajectoryAlignment kind) {
  if (kind == TrajectoryAlignment::kNone) return {};
  const Eigen::Matrix4d T =
      Eigen::umeyama(positions(poses.estimate), positions(poses.truth), kind == TrajectoryAlignment::kSim3);
  const double scale = T.topLeftCorner<3, 3>().col(0).norm();
  if (!T.allFinite() || !(scale > 0.0))
    throw InputError("trajectory", "does not move, so it cannot be aligned to the truth");
  const geometry::Mat3 rotation = T.topLeftCorner<3, 3>() / scale;
  return {scale, Eigen::Quaterniond(rotation), T.topRightCorner<3, 1>()};
}

double distance_m(const geometry::StampedPose& a, const geometry::StampedPose& b) {
  return (a.T_local_camera.translation - b.T_local_camera.translation).norm();
}

double root_mean_square(std::span<const double> errors) {
  double squares = 0.0;
  for (const double e : errors) squares += e * e;
  return std::sqrt(squares / static_cast<double>(errors.size()));  // NaN without errors
}

PoseErrorSpread spread_of(std::vector<double> errors) {
  if (errors.empty()) return {};
  PoseErrorSpread spread;
  const auto n = static_cast<double>(errors.size());
  double sum = 0.0, squares = 0.0;
  for (const double e : errors) sum += e;
  spread.mean = sum / n;
  for (const double e : errors) squares += (e - spread.mean) * (e - spread.mean);
  spread.std = std::sqrt(squares / n);
  const auto [least, most] = std::minmax_element(errors.begin(), errors.end());
  spread.min = *least;
  spread.max = *most;
  spread.median = base::median(errors);
  return spread;
}

/// Indices of poses at which the path since the previous milestone (or the start) has reached the length.
std::vector<std::size_t> milestones(const Trajectory& trajectory, double length_m) {
  std::vector<std::size_t> result;
  double path_m = 0.0;
  for (std::size_t i = 1; i < trajectory.size(); ++i) {
    path_m += distance_m(trajectory.poses[i - 1], trajectory.poses[i]);
    if (path_m < length_m) continue;
    result.push_back(i);
    path_m = 0.0;
  }
  return result;
}

/// Errors of the motions from each of the poses to the next of them: Sturm et al. 2012, (1).
StepErrors motion_errors(const PairedTrajectories& poses, const std::vector<std::size_t>& stones) {
  StepErrors errors;
  for (std::size_t k = 1; k < stones.size(); ++k) {
    const SE3 error = relative_motion(poses.truth, stones[k - 1], stones[k]).inverse() *
                      relative_motion(poses.estimate, stones[k - 1], stones[k]);
    errors.translation_m.push_back(error.translation.norm());
    errors.rotation_deg.push_back(geometry::so3_log(error.rotation).norm() * kRadian_deg);
  }
  return errors;
}

RelativePoseError relative_error(const PairedTrajectories& poses, const std::vector<std::size_t>& stones) {
  const StepErrors errors = motion_errors(poses, stones);
  RelativePoseError result;
  result.pairs = errors.translation_m.size();
  result.translation_rmse_m = root_mean_square(errors.translation_m);
  result.rotation_rmse_deg = root_mean_square(errors.rotation_deg);
  result.translation_m = spread_of(errors.translation_m);
  result.rotation_deg = spread_of(errors.rotation_deg);
  return result;
}

RelativePoseError error_over_length(const PairedTrajectories& poses, double delta_m) {
  if (!(delta_m > 0.0)) throw InputError("RPE", "the path length must be above zero, in metres");
  RelativePoseError result = relative_error(poses, milestones(poses.estimate, delta_m));
  result.delta_m = delta_m;
  return result;
}

/// Indices 0, step, 2 step …
std::vector<std::size_t> every_nth(std::size_t count, std::size_t step) {
  std::vector<std::size_t> result;
  for (std::size_t i = 0; i < count; i += step) result.push_back(i);
  return result;
}

RelativePoseError error_over_frames(const PairedTrajectories& poses, std::size_t delta_frames) {
  if (delta_frames < 1) throw InputError("RPE", "the number of frames must be above zero");
  RelativePoseError result = relative_error(poses, every_nth(poses.truth.size(), delta_frames));
  result.delta_frames = delta_frames;
  return result;
}

double duration_s(const Trajectory& trajectory) {
  return trajectory.empty() ? 0.0 : trajectory.poses.back().time_s - trajectory.poses.front().time_s;
}

/// Returns how much of the gaps lies within a time.
double seconds_within(const std::vector<TimeGap>& gaps, double from_s, double to_s) {
  double within_s = 0.0;
  for (const TimeGap& gap : gaps) within_s += std::max(0.0, std::min(to_s, gap.to_s) - std::max(from_s, gap.from_s));
  return within_s;
}

double share_of_time_covered(const PairedTrajectories& poses) {
  const double from_s = poses.truth.poses.front().time_s, to_s = poses.truth.poses.back().time_s;
  double covered_s = to_s - from_s - seconds_within(poses.unrecorded, from_s, to_s);
  for (const TimeGap& gap : find_time_gaps(poses.truth, poses.true_duration_s, poses.unrecorded))
    covered_s -= gap.missing_s;
  double recorded_s = poses.true_duration_s;
  for (const TimeGap& gap : poses.unrecorded) recorded_s -= gap.to_s - gap.from_s;
  return covered_s / recorded_s;
}

void add_absolute_error(const PairedTrajectories& poses, TrajectoryMetrics& result) {
  std::vector<double> errors_m;
  for (std::size_t i = 0; i < poses.truth.size(); ++i)
    errors_m.push_back(distance_m(poses.estimate.poses[i], poses.truth.poses[i]));
  const PoseErrorSpread spread = spread_of(errors_m);
  result.ate_rmse_m = root_mean_square(errors_m);
  result.ate_mean_m = spread.mean;
  result.ate_median_m = spread.median;
  result.ate_std_m = spread.std;
  result.ate_min_m = spread.min;
  result.ate_max_m = spread.max;
}

}  // namespace

const char* name_of(TrajectoryAlignment alignment) {
  if (alignment == TrajectoryAlignment::kSim3) return "sim3";
  return alignment == TrajectoryAlignment::kSE3 ? "se3" : "none";
}

PairedTrajectories pair_and_align(const Trajectory& estimate, const Trajectory& truth,
                                  const TrajectoryOptions& options) {
  PairedTrajectories poses = options.pairing == TrajectoryPairing::kByIndex
                                 ? paired_by_index(estimate, truth)
                                 : paired_by_time(estimate, truth, options.max_time_difference_s);
  check_finite(poses.estimate, "estimated trajectory");
  check_finite(poses.truth, "true trajectory");
  poses.estimated_poses = estimate.size();
  poses.true_poses = truth.size();
  poses.true_duration_s = duration_s(truth);
  poses.unrecorded = find_time_gaps(truth, poses.true_duration_s);
  poses.T_truth_estimate = align_umeyama(poses, options.alignment);
  poses.estimate = geometry::transformed(poses.T_truth_estimate, poses.estimate);
  return poses;
}

std::vector<TimeGap> find_time_gaps(const Trajectory& trajectory, double duration_s,
                                    const std::vector<TimeGap>& unrecorded) {
  // Chosen by hand.
  constexpr double kTimesUsual = 5.0, kShare = 0.05;
  std::vector<TimeGap> intervals;
  std::vector<double> lengths_s;
  for (std::size_t i = 1; i < trajectory.size(); ++i) {
    const double from_s = trajectory.poses[i - 1].time_s, to_s = trajectory.poses[i].time_s;
    intervals.push_back({from_s, to_s, to_s - from_s - seconds_within(unrecorded, from_s, to_s)});
    lengths_s.push_back(to_s - from_s);
  }
  if (intervals.empty()) return {};
  const double least_s = std::max(kTimesUsual * base::median(lengths_s), kShare * duration_s);
  std::erase_if(intervals, [&](const TimeGap& interval) { return interval.missing_s <= least_s; });
  return intervals;
}

TrajectoryMetrics score_trajectory(const PairedTrajectories& poses, const TrajectoryOptions& options) {
  TrajectoryMetrics result;
  result.alignment = options.alignment;
  result.poses = poses.truth.size();
  result.estimated_poses = poses.estimated_poses;
  result.true_poses = poses.true_poses;
  if (poses.true_duration_s > 0.0) result.time_covered = share_of_time_covered(poses);
  result.scale = poses.T_truth_estimate.scale;
  result.path_length_m = geometry::path_length_m(poses.truth);
  add_absolute_error(poses, result);
  for (const double delta_m : options.rpe_deltas_m) result.rpe.push_back(error_over_length(poses, delta_m));
  for (const std::size_t frames : options.rpe_deltas_frames)
    result.rpe_frames.push_back(error_over_frames(poses, frames));
  result.drift = compute_path_drift(poses.estimate, poses.truth);
  result.scale_drift = compute_scale_drift(poses.estimate, poses.truth);
  return result;
}

TrajectoryMetrics evaluate_trajectory(const Trajectory& estimate, const Trajectory& truth,
                                      const TrajectoryOptions& options) {
  return score_trajectory(pair_and_align(estimate, truth, options), options);
}

StepErrors compute_step_errors(const PairedTrajectories& poses) {
  return motion_errors(poses, every_nth(poses.truth.size(), 1));
}

}  // namespace tileflight::metrics
