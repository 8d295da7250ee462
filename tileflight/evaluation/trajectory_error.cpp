#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "tileflight/base/input_error.h"
#include "tileflight/evaluation/metrics.h"
#include "tileflight/evaluation/trajectory_drift.h"

namespace tileflight::evaluation {

using geometry::SE3;
using geometry::Sim3;
using geometry::Trajectory;

namespace {

constexpr double kSameTime_s = 0.01;
constexpr double kRadian_deg = 57.295779513082320877;

/// Poses of estimate and truth at common times.
struct PairedPoses {
  Trajectory estimate, truth;
};

PairedPoses paired(const Trajectory& estimate, const Trajectory& truth) {
  PairedPoses result;
  for (const auto& [e, t] : geometry::associate(estimate, truth, kSameTime_s)) {
    result.estimate.poses.push_back(estimate.poses[e]);
    result.truth.poses.push_back(truth.poses[t]);
  }
  if (result.estimate.size() < 3) {
    throw InputError("trajectory",
                     "only " + std::to_string(result.estimate.size()) +
                         " of its poses share a time with the truth (10 ms); check that both use one clock");
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
Sim3 align_umeyama(const PairedPoses& poses, TrajectoryAlignment kind) {
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

SE3 relative_motion(const Trajectory& trajectory, std::size_t from, std::size_t to) {
  return trajectory.poses[from].T_local_camera.inverse() * trajectory.poses[to].T_local_camera;
}

RelativePoseError relative_error(const PairedPoses& poses, double delta_m) {
  if (!(delta_m > 0.0)) throw InputError("RPE", "the path length must be above zero, in metres");
  RelativePoseError result;
  result.delta_m = delta_m;
  const std::vector<std::size_t> stones = milestones(poses.estimate, delta_m);
  double translation = 0.0, rotation = 0.0;
  for (std::size_t k = 1; k < stones.size(); ++k) {
    const SE3 error =
        relative_motion(poses.truth, stones[k - 1], stones[k]).inverse() * relative_motion(poses.estimate, stones[k - 1], stones[k]);
    const double angle_deg = geometry::so3_log(error.rotation).norm() * kRadian_deg;
    translation += error.translation.squaredNorm();
    rotation += angle_deg * angle_deg;
    ++result.pairs;
  }
  if (result.pairs == 0) return result;
  result.translation_rmse_m = std::sqrt(translation / static_cast<double>(result.pairs));
  result.rotation_rmse_deg = std::sqrt(rotation / static_cast<double>(result.pairs));
  return result;
}

}  // namespace

TrajectoryMetrics evaluate_trajectory(const Trajectory& estimate, const Trajectory& truth,
                                      TrajectoryAlignment alignment, const std::vector<double>& rpe_deltas_m) {
  PairedPoses poses = paired(estimate, truth);
  check_finite(poses.estimate, "estimated trajectory");
  check_finite(poses.truth, "true trajectory");
  const Sim3 T_truth_estimate = align_umeyama(poses, alignment);
  poses.estimate = geometry::transformed(T_truth_estimate, poses.estimate);

  TrajectoryMetrics result;
  result.poses = poses.truth.size();
  result.scale = T_truth_estimate.scale;
  result.path_length_m = geometry::path_length_m(poses.truth);
  double squares = 0.0, sum = 0.0;
  for (std::size_t i = 0; i < result.poses; ++i) {
    const double error_m = distance_m(poses.estimate.poses[i], poses.truth.poses[i]);
    squares += error_m * error_m;
    sum += error_m;
    result.ate_max_m = std::max(result.ate_max_m, error_m);
  }
  result.ate_rmse_m = std::sqrt(squares / static_cast<double>(result.poses));
  result.ate_mean_m = sum / static_cast<double>(result.poses);
  for (const double delta_m : rpe_deltas_m) result.rpe.push_back(relative_error(poses, delta_m));
  result.drift = compute_path_drift(poses.estimate, poses.truth);
  result.scale_drift = compute_scale_drift(poses.estimate, poses.truth);
  return result;
}

}  // namespace tileflight::evaluation
