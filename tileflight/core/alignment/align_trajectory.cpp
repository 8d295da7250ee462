#include "tileflight/core/alignment/align_trajectory.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "tileflight/core/base/input_error.h"

namespace tileflight::alignment {
using geometry::Mat3;
using geometry::Trajectory;
using geometry::Vec3;

namespace {

struct Pairs {
  std::vector<Vec3> map, local;
};

bool has_motion(const Trajectory& trajectory) {
  const Vec3& first = trajectory.poses.front().T_local_camera.translation;
  constexpr double kRounding = 1e-9;
  return std::any_of(trajectory.poses.begin(), trajectory.poses.end(), [&](const geometry::StampedPose& pose) {
    return (pose.T_local_camera.translation - first).norm() > kRounding * (1.0 + first.norm());
  });
}

void check_input(const Trajectory& trajectory, const std::vector<PositionFix>& fixes) {
  if (trajectory.empty()) throw InputError("trajectory", "has no poses; there is nothing to align");
  if (fixes.empty()) throw InputError("telemetry", "has no positions; there is nothing to align to");
  for (const auto& pose : trajectory.poses) {
    if (!pose.T_local_camera.translation.allFinite() || !std::isfinite(pose.time_s)) {
      throw InputError("trajectory", "a pose is not finite");
    }
  }
  if (!has_motion(trajectory))
    throw InputError("trajectory", "the camera does not move, so the scale cannot be determined");
  for (const PositionFix& fix : fixes) {
    if (!fix.position.allFinite() || !std::isfinite(fix.time_s))
      throw InputError("telemetry", "a position is not finite");
  }
}

/// Removes repeated positions: logs repeat a position until the receiver has a new one; only the first is a
/// measurement.
std::vector<PositionFix> remove_repeats(const std::vector<PositionFix>& fixes) {
  std::vector<PositionFix> result;
  for (const PositionFix& fix : fixes) {
    if (result.empty() || fix.position != result.back().position) result.push_back(fix);
  }
  return result;
}

Pairs pair_positions_at(const Trajectory& trajectory, const std::vector<PositionFix>& fixes, double offset_s) {
  Pairs pairs;
  for (const PositionFix& fix : fixes) {
    const auto pose = geometry::interpolate(trajectory, fix.time_s + offset_s);
    if (!pose) continue;
    pairs.map.push_back(pose->translation);
    pairs.local.push_back(fix.position);
  }
  return pairs;
}

/// Fixes within the trajectory's time range for every offset of +-`margin_s`, so that all offsets are evaluated over
/// the same fixes.
std::vector<PositionFix> trim_to_overlap(const Trajectory& trajectory, const std::vector<PositionFix>& fixes,
                                         double margin_s) {
  const double from_s = trajectory.poses.front().time_s + margin_s, to_s = trajectory.poses.back().time_s - margin_s;
  std::vector<PositionFix> result;
  for (const PositionFix& fix : fixes) {
    if (fix.time_s >= from_s && fix.time_s <= to_s) result.push_back(fix);
  }
  return result;
}

/// Effective number of independent residuals, since a receiver's errors are correlated over seconds: count over the
/// integrated autocorrelation time, summed until the autocorrelation fades (Sokal, Monte Carlo methods in statistical
/// mechanics, 1997, section 3).
double effective_sample_count(const std::vector<Vec3>& residuals) {
  const auto n = static_cast<double>(residuals.size());
  Vec3 mean = Vec3::Zero();
  for (const Vec3& r : residuals) mean += r / n;
  const auto covariance = [&](std::size_t lag) {
    double sum = 0.0;
    for (std::size_t i = lag; i < residuals.size(); ++i) sum += (residuals[i] - mean).dot(residuals[i - lag] - mean);
    return sum / n;
  };
  const double variance = covariance(0);
  if (!(variance > 0.0)) return n;
  double time = 1.0;
  constexpr double kFaded = 0.05;
  for (std::size_t lag = 1; lag < residuals.size() / 2; ++lag) {
    const double correlation = covariance(lag) / variance;
    if (correlation < kFaded) break;
    time += 2.0 * correlation;
  }
  return std::max(3.0, n / time);
}

/// Residuals of the inlier pairs, in the order of the fixes.
std::vector<Vec3> inlier_residuals(const Pairs& pairs, const geometry::Sim3& T, double inlier_m) {
  std::vector<Vec3> residuals;
  for (std::size_t i = 0; i < pairs.map.size(); ++i) {
    const Vec3 residual = pairs.local[i] - T * pairs.map[i];
    if (residual.norm() <= inlier_m) residuals.push_back(residual);
  }
  return residuals;
}

/// The robust residual as a function of the offset.
class OffsetCost {
 public:
  OffsetCost(const Trajectory& trajectory, std::vector<PositionFix> fixes, ScaleMode scale, RobustUmeyamaOptions robust)
      : trajectory_(trajectory), fixes_(std::move(fixes)), scale_(scale), robust_(robust) {
    constexpr int kFewTriples = 60;  // per offset; the final fit uses all triples
    robust_.samples = std::min(robust_.samples, kFewTriples);
  }

  double operator()(double offset_s) const {
    const Pairs pairs = pair_positions_at(trajectory_, fixes_, offset_s);
    const auto fit = robust_umeyama(pairs.map, pairs.local, scale_, robust_);
    return robust_cost_m2(fit.T_target_source, pairs.map, pairs.local, robust_.inlier_m);
  }

  /// Effective number of independent residuals at an offset.
  double effective_samples(double offset_s) const {
    const Pairs pairs = pair_positions_at(trajectory_, fixes_, offset_s);
    const auto fit = robust_umeyama(pairs.map, pairs.local, scale_, robust_);
    return effective_sample_count(inlier_residuals(pairs, fit.T_target_source, robust_.inlier_m));
  }

 private:
  const Trajectory& trajectory_;
  std::vector<PositionFix> fixes_;
  ScaleMode scale_;
  RobustUmeyamaOptions robust_;
};

struct Minimum {
  double at = 0.0;
  double value = 0.0;
  double curvature = 0.0;  ///< second derivative
  bool inside = false;     ///< a minimum inside the range, not at its end
};

/// Minimum of `cost` on the grid of +-`reach` around `center`, refined by a parabola through it and its neighbours.
Minimum grid_minimum(const OffsetCost& cost, double center, double reach, double step) {
  const int half = static_cast<int>(std::lround(reach / step));
  std::vector<double> values;
  for (int k = -half; k <= half; ++k) values.push_back(cost(center + k * step));
  const auto best = std::min_element(values.begin(), values.end()) - values.begin();
  Minimum minimum{center + (static_cast<double>(best) - half) * step, values[static_cast<std::size_t>(best)], 0.0,
                  false};
  if (best == 0 || best + 1 == static_cast<std::ptrdiff_t>(values.size())) return minimum;
  const double left = values[static_cast<std::size_t>(best - 1)], right = values[static_cast<std::size_t>(best + 1)];
  const double second = left - 2.0 * minimum.value + right;
  if (!(second > 0.0)) return minimum;
  minimum.inside = true;
  minimum.curvature = second / (step * step);
  minimum.at += 0.5 * step * (left - right) / second;
  return minimum;
}

void add_note(TrajectoryAlignment& result, const std::string& text) {
  result.note += (result.note.empty() ? "" : "; ") + text;
}

/// Standard deviation of the offset: for c(o) = c0 + k/2 (o - best)^2, with c0 the mean squared residual of n
/// measurements: sigma^2 = 2 c0 / (k n).
double offset_sigma_s(const Minimum& minimum, double measurements) {
  return std::sqrt(2.0 * minimum.value / (minimum.curvature * measurements));
}

void estimate_offset(const Trajectory& trajectory, const std::vector<PositionFix>& fixes,
                     const RobustUmeyamaOptions& robust, const AlignTrajectoryOptions& options,
                     TrajectoryAlignment& result) {
  const double span_s = trajectory.poses.back().time_s - trajectory.poses.front().time_s;
  const double reach_s = std::min(options.max_time_offset_s, 0.2 * span_s);
  const auto within = trim_to_overlap(trajectory, fixes, reach_s);
  constexpr std::size_t kEnough = 10;
  if (within.size() < kEnough) return add_note(result, "too few positions to estimate the time offset; 0 s is used");

  const OffsetCost cost(trajectory, within, options.scale, robust);
  const double coarse_s = reach_s / 20.0;
  const Minimum coarse = grid_minimum(cost, 0.0, reach_s, coarse_s);
  constexpr double kTooUncertain_s = 0.3;
  const double sigma_s = coarse.inside ? offset_sigma_s(coarse, cost.effective_samples(coarse.at)) : reach_s;
  if (!(sigma_s < kTooUncertain_s)) {
    return add_note(result, "the path does not determine the telemetry's time offset; 0 s is used");
  }
  const Minimum fine = grid_minimum(cost, coarse.at, coarse_s, coarse_s / 4.0);
  result.time_offset_s = fine.inside ? fine.at : coarse.at;
  result.time_offset_sigma_s = sigma_s;
}

RobustUmeyamaOptions widen_inlier_threshold(RobustUmeyamaOptions robust, const std::vector<PositionFix>& fixes) {
  double largest_m = 0.0;
  for (const PositionFix& fix : fixes) largest_m = std::max({largest_m, fix.horizontal_sigma_m, fix.vertical_sigma_m});
  robust.inlier_m = std::max(robust.inlier_m, 3.0 * largest_m);
  return robust;
}

/// RMS distance of the path from its best-fitting line, metres.
double spread_across_m(const std::vector<Vec3>& points) {
  Vec3 mean = Vec3::Zero();
  for (const Vec3& p : points) mean += p / static_cast<double>(points.size());
  geometry::Mat3 covariance = geometry::Mat3::Zero();
  for (const Vec3& p : points) covariance += (p - mean) * (p - mean).transpose() / static_cast<double>(points.size());
  return std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<geometry::Mat3>(covariance).eigenvalues()[1]));
}

void set_roll_sigma(const Pairs& pairs, double inlier_m, TrajectoryAlignment& result) {
  const double across_m = result.T_local_map.scale * spread_across_m(pairs.map);
  const double measurements = effective_sample_count(inlier_residuals(pairs, result.T_local_map, inlier_m));
  const double error_m = result.rmse_m / std::sqrt(measurements);
  result.roll_sigma_rad = across_m > 0.0 ? std::min(3.14, error_m / across_m) : 3.14;
  constexpr double kTooUncertain_rad = 0.1;
  if (result.roll_sigma_rad > kTooUncertain_rad) {
    add_note(result, "the path is nearly straight, so positions hardly determine the roll about it");
  }
}

}  // namespace

std::optional<Vec3> estimate_up_from_trajectory(const geometry::Trajectory& trajectory) {
  if (trajectory.empty()) return std::nullopt;
  Mat3 sideways = Mat3::Zero();
  Vec3 tops = Vec3::Zero();
  for (const geometry::StampedPose& pose : trajectory.poses) {
    const Vec3 x = pose.T_local_camera.rotation * Vec3::UnitX();
    sideways += x * x.transpose() / static_cast<double>(trajectory.size());
    tops -= pose.T_local_camera.rotation * Vec3::UnitY();
  }
  const Eigen::SelfAdjointEigenSolver<Mat3> eigen(sideways);
  constexpr double kTurned = 0.01;  // smallest mean squared sine of the rotation: about six degrees
  constexpr double kClearer = 4.0;  // smallest ratio of rotation to roll, as mean squares
  const Vec3 spread = eigen.eigenvalues();
  if (spread[1] < kTurned || spread[1] < kClearer * spread[0]) return std::nullopt;
  const Vec3 up = eigen.eigenvectors().col(0);
  return up.dot(tops) >= 0.0 ? up : Vec3(-up);
}

TrajectoryAlignment align_trajectory(const Trajectory& T_map_camera, const std::vector<PositionFix>& fixes,
                                     const AlignTrajectoryOptions& options) {
  check_input(T_map_camera, fixes);
  const auto measured = remove_repeats(fixes);
  const RobustUmeyamaOptions robust = widen_inlier_threshold(options.robust, measured);
  TrajectoryAlignment result;
  if (options.estimate_time_offset) estimate_offset(T_map_camera, measured, robust, options, result);

  const Pairs pairs = pair_positions_at(T_map_camera, measured, result.time_offset_s);
  if (pairs.map.size() < 3) {
    throw InputError("telemetry",
                     "only " + std::to_string(pairs.map.size()) +
                         " of its positions lie within the trajectory's time; check that both use one clock");
  }
  const UmeyamaResult fit = robust_umeyama(pairs.map, pairs.local, options.scale, robust);
  if (!(fit.T_target_source.scale > 0.0))
    throw InputError("telemetry", "its positions do not follow the trajectory's motion");
  result.T_local_map = fit.T_target_source;
  result.pairs = pairs.map.size();
  result.inliers = fit.inliers;
  result.rmse_m = fit.rmse_m;
  if (2 * result.inliers < result.pairs) add_note(result, "more than half of the positions do not fit the path");
  set_roll_sigma(pairs, robust.inlier_m, result);
  return result;
}

}  // namespace tileflight::alignment
