#include "tileflight/slam/mapping/step_uncertainty.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/geometry/decompositions.h"
#include "tileflight/slam/mapping/host_target_pairs.h"

namespace tileflight::mapping {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Estimate of a point's log inverse distance as a linear function of the keyframes' unknowns x: log rho = c^T x / (rho
/// H) + noise.
struct LogDepthEstimate {
  int host = 0;
  double information = 0.0;   ///< of log rho for fixed keyframes
  VectorXd by_unknowns;       ///< d(log rho)/dx
  std::vector<bool> seen_in;  ///< by slot
};

LogDepthEstimate estimate_log_depth(const keyframes::Window& window, const std::vector<HostTargetPair>& pairs,
                                    const PointRef& ref, double residual_variance) {
  const int n = window.size();
  const keyframes::ActivePoint& point = window.keyframes[ref.host].points[ref.index];
  LogDepthEstimate out{ref.host, 0.0, VectorXd::Zero(window.unknowns()), std::vector<bool>(n, false)};
  out.seen_in[ref.host] = true;
  double H = 0.0;
  for (const keyframes::Observation& observation : point.observations) {
    if (observation.state != keyframes::ResidualState::kGood) continue;
    const Eigen::Vector2d by_rho = observation.linearization.d_pixel_d_rho.cast<double>();
    H += by_rho.dot(
        add_coupling(window, ref.host, pairs[ref.host * n + observation.target], observation, by_rho, out.by_unknowns));
    out.seen_in[observation.target] = true;
  }
  for (const keyframes::Observation& observation : point.stereo_observations) {
    if (observation.state != keyframes::ResidualState::kGood) continue;
    const keyframes::Linearization& lin = observation.linearization;
    const Eigen::Vector2d by_rho = lin.d_pixel_d_rho.cast<double>();
    H += by_rho.dot(lin.sums.gg.cast<double>() * by_rho);
    out.by_unknowns.segment<2>(window.stereo_unknown(ref.host) + 2 * observation.target) +=
        lin.sums.gA.cast<double>().transpose() * by_rho;
  }
  out.information = H * point.rho * point.rho / residual_variance;
  out.by_unknowns *= H > 0 ? -1.0 / (H * point.rho) : 0.0;
  return out;
}

/// Mean of log rho over the points that a keyframe sees, weighted by information.
struct LocalScale {
  VectorXd by_unknowns;
  double information = 0.0;
  int known_points = 0, points = 0;
};

LocalScale local_scale(const std::vector<LogDepthEstimate>& all, int slot, int unknowns) {
  constexpr double kKnown = 0.1;  // largest relative standard deviation of a known distance
  LocalScale scale;
  scale.by_unknowns = VectorXd::Zero(unknowns);
  for (const LogDepthEstimate& point : all) {
    if (!point.seen_in[slot]) continue;
    scale.by_unknowns += point.information * point.by_unknowns;
    scale.information += point.information;
    scale.known_points += point.information > 1.0 / (kKnown * kKnown);
    ++scale.points;
  }
  if (scale.information > 0) scale.by_unknowns /= scale.information;
  return scale;
}

/// Information matrix of the keyframes with the points eliminated, prior included. ActivePoint::information is left
/// unchanged.
MatrixXd keyframe_information(keyframes::Window& window, const std::vector<HostTargetPair>& pairs,
                              const std::vector<PointRef>& points) {
  std::vector<float> kept;
  kept.reserve(points.size());
  for (const PointRef& ref : points) kept.push_back(window.keyframes[ref.host].points[ref.index].information);
  MatrixXd H = build_normal_equations(window, pairs, points, 0.0).H + window.H_prior;
  for (std::size_t i = 0; i < points.size(); ++i)
    window.keyframes[points[i].host].points[points[i].index].information = kept[i];
  return H;
}

/// Inverse of the information with the pose of a slot and a linear function of the unknowns fixed: the frame is that of
/// the keyframe, the scale that of the points it sees.
MatrixXd covariance_with_fixed(MatrixXd H, int slot, const VectorXd& fixed_function) {
  // Information added to a fixed direction, in the scaled unknowns. Chosen by hand.
  constexpr double kFixed = 1e6;
  const VectorXd scale = (H.diagonal().array().max(0.0) + 1e-6).sqrt().inverse();
  H = scale.asDiagonal() * H * scale.asDiagonal();
  H.diagonal().array() += 1e-9;
  H.diagonal().segment<6>(8 * slot).array() += kFixed;
  const VectorXd fixed = scale.cwiseProduct(fixed_function);
  if (fixed.norm() > 0) H += kFixed / fixed.squaredNorm() * fixed * fixed.transpose();
  return scale.asDiagonal() * geometry::symmetric_inverse(H) * scale.asDiagonal();
}

}  // namespace

StepUncertainty step_uncertainty(keyframes::Window& window, int slot, double residual_variance) {
  constexpr double kUnknown = 1e2;  // variance of a log scale that is not determined
  StepUncertainty out;
  const std::vector<HostTargetPair> pairs = make_host_target_pairs(window);
  const std::vector<PointRef> points = all_points(window);
  std::vector<LogDepthEstimate> known;
  known.reserve(points.size());
  for (const PointRef& ref : points) known.push_back(estimate_log_depth(window, pairs, ref, residual_variance));
  const LocalScale here = local_scale(known, slot, window.unknowns());
  out.known_points = here.known_points;
  out.points = here.points;
  out.is_metric = window.has_stereo();
  if (slot < 1) return out;
  LocalScale there = local_scale(known, slot - 1, window.unknowns());
  if (out.is_metric) there.by_unknowns.setZero();  // the stereo cameras fix the scale, not the keyframe before
  const MatrixXd covariance = covariance_with_fixed(keyframe_information(window, pairs, points) / residual_variance,
                                                    slot - 1, there.by_unknowns);
  out.pose = covariance.block<6, 6>(8 * slot, 8 * slot);
  out.log_scale = kUnknown;
  if (here.information <= 0 || there.information <= 0) return out;
  double variance = here.by_unknowns.dot(covariance * here.by_unknowns);
  for (const LogDepthEstimate& point : known) {
    const double w_here = point.seen_in[slot] ? point.information / here.information : 0.0;
    const double w_there = point.seen_in[slot - 1] && !out.is_metric ? point.information / there.information : 0.0;
    if (point.information > 0) variance += (w_here - w_there) * (w_here - w_there) / point.information;
  }
  out.log_scale = std::min(variance, kUnknown);
  return out;
}

}  // namespace tileflight::mapping
