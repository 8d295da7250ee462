#include "tileflight/evaluation/metrics/trajectory_drift.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <optional>

namespace tileflight::metrics {

using geometry::SE3;
using geometry::Trajectory;

namespace {

constexpr double kDegreesPerRadian = 57.295779513082320877;
/// Factor on a length, so that rounded sums of equal steps reach it.
constexpr double kReached = 1.0 - 1e-9;

/// Path length from the first pose to each.
std::vector<double> cumulative_length_m(const Trajectory& trajectory) {
  std::vector<double> result(trajectory.size(), 0.0);
  for (std::size_t i = 1; i < trajectory.size(); ++i) {
    const auto &from = trajectory.poses[i - 1].T_local_camera, &to = trajectory.poses[i].T_local_camera;
    result[i] = result[i - 1] + (to.translation - from.translation).norm();
  }
  return result;
}

/// First pose where the path has grown by the length since `from`.
std::optional<std::size_t> first_pose_beyond(const std::vector<double>& path_m, std::size_t from, double length_m) {
  const auto end = std::lower_bound(path_m.begin() + static_cast<std::ptrdiff_t>(from), path_m.end(),
                                    path_m[from] + kReached * length_m);
  if (end == path_m.end()) return std::nullopt;
  return static_cast<std::size_t>(end - path_m.begin());
}

}  // namespace

SE3 relative_motion(const Trajectory& trajectory, std::size_t from, std::size_t to) {
  return trajectory.poses[from].T_local_camera.inverse() * trajectory.poses[to].T_local_camera;
}

double choose_segment_length_m(double path_length_m) {
  if (!(path_length_m > 0.0) || !std::isfinite(path_length_m)) return 0.0;
  const double most = std::min(100.0, path_length_m / 10.0);
  const double decade = std::pow(10.0, std::floor(std::log10(most)));
  for (const double factor : {5.0, 2.0}) {
    if (factor * decade <= most) return factor * decade;
  }
  return decade;
}

PathDrift compute_path_drift(const Trajectory& estimate, const Trajectory& truth) {
  assert(estimate.size() == truth.size());
  PathDrift drift;
  const std::vector<double> path_m = cumulative_length_m(truth);
  drift.segment_length_m = path_m.empty() ? 0.0 : choose_segment_length_m(path_m.back());
  if (drift.segment_length_m == 0.0) return drift;
  double translation = 0.0, rotation_rad_m = 0.0;
  for (int stretches = 1; stretches <= 8; ++stretches) {
    for (std::size_t from = 0; from < truth.size(); ++from) {
      const auto to = first_pose_beyond(path_m, from, stretches * drift.segment_length_m);
      if (!to) break;
      const SE3 error = relative_motion(truth, from, *to).inverse() * relative_motion(estimate, from, *to);
      const double grown_m = path_m[*to] - path_m[from];
      translation += error.translation.norm() / grown_m;
      rotation_rad_m += geometry::so3_log(error.rotation).norm() / grown_m;
      ++drift.subpaths;
    }
  }
  if (drift.subpaths == 0) return drift;
  drift.translation_percent = 100.0 * translation / static_cast<double>(drift.subpaths);
  drift.rotation_deg_per_m = kDegreesPerRadian * rotation_rad_m / static_cast<double>(drift.subpaths);
  return drift;
}

ScaleDrift compute_scale_drift(const Trajectory& estimate, const Trajectory& truth) {
  assert(estimate.size() == truth.size());
  ScaleDrift drift;
  const std::vector<double> true_m = cumulative_length_m(truth), estimated_m = cumulative_length_m(estimate);
  drift.segment_length_m = true_m.empty() ? 0.0 : choose_segment_length_m(true_m.back());
  if (drift.segment_length_m == 0.0) return drift;
  double largest = 0.0, squares = 0.0;
  std::size_t from = 0;
  while (const auto to = first_pose_beyond(true_m, from, drift.segment_length_m)) {
    const double deviation = (true_m[*to] - true_m[from]) / (estimated_m[*to] - estimated_m[from]) - 1.0;
    largest = std::max(largest, std::abs(deviation));
    squares += deviation * deviation;
    ++drift.segments;
    from = *to;
  }
  if (drift.segments == 0) return drift;
  drift.max_deviation = largest;
  drift.rms = std::sqrt(squares / static_cast<double>(drift.segments));
  return drift;
}

}  // namespace tileflight::metrics
