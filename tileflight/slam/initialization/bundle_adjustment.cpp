#include "tileflight/slam/initialization/bundle_adjustment.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "tileflight/core/base/order_statistics.h"
#include "tileflight/core/geometry/decompositions.h"
#include "tileflight/slam/keyframes/residual.h"

namespace tileflight::initialization {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using geometry::SE3;
using geometry::Vec2;
using geometry::Vec3;
using Mat6 = Eigen::Matrix<double, 6, 6>;
using Vec6 = geometry::Vec6;

// Both chosen by hand.
constexpr double kHuber_px = 1.0;
constexpr double kOutside_px = 20.0;  ///< error assigned to a point outside the lens's domain

struct Reprojection {
  Vec2 error = Vec2::Zero();
  Eigen::Matrix<double, 2, 6> d_error_d_pose;
  Vec2 d_error_d_rho = Vec2::Zero();
  double weight = 0.0;
  double cost = 0.0;
};

double huber_cost(double e) { return e < kHuber_px ? e * e : kHuber_px * (2 * e - kHuber_px); }

Reprojection reproject(const keyframes::Lens& lens, const SE3& T, const Vec3& ray, double rho, const Vec2& measured) {
  Reprojection out;
  const Vec3 X = T.rotation * ray + rho * T.translation;
  Vec2 pixel;
  Eigen::Matrix<double, 2, 3> by_X;
  if (!lens.project<double>(X, pixel, by_X)) {
    out.cost = huber_cost(kOutside_px);
    return out;
  }
  out.error = pixel - measured;
  const double e = out.error.norm();
  out.weight = e < kHuber_px ? 1.0 : kHuber_px / e;
  out.cost = huber_cost(e);
  keyframes::pixel_derivatives<double>(by_X, X, T.translation, rho, out.d_error_d_pose, out.d_error_d_rho);
  return out;
}

double total_cost(const keyframes::Lens& lens, const std::vector<CornerTrack>& tracks,
                  const InitializationBundle& bundle) {
  double cost = 0;
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    for (std::size_t k = 0; k < bundle.T_camera_first.size(); ++k) {
      if (!tracks[i].pixels[k]) continue;
      cost += reproject(lens, bundle.T_camera_first[k], tracks[i].ray, bundle.rho[i], *tracks[i].pixels[k]).cost;
    }
  }
  return cost;
}

/// One Levenberg-Marquardt step over poses and points; the points (one unknown each) are eliminated.
InitializationBundle levenberg_marquardt_step(const keyframes::Lens& lens, const std::vector<CornerTrack>& tracks,
                                              const InitializationBundle& bundle, double lambda) {
  const std::size_t n = bundle.T_camera_first.size();
  MatrixXd H = MatrixXd::Zero(6 * n, 6 * n);
  VectorXd b = VectorXd::Zero(6 * n);
  std::vector<Mat6> blocks(n, Mat6::Zero());
  MatrixXd coupling = MatrixXd::Zero(6 * n, tracks.size());
  VectorXd H_rho = VectorXd::Zero(tracks.size()), b_rho = VectorXd::Zero(tracks.size());
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    for (std::size_t k = 0; k < n; ++k) {
      if (!tracks[i].pixels[k]) continue;
      const Reprojection r =
          reproject(lens, bundle.T_camera_first[k], tracks[i].ray, bundle.rho[i], *tracks[i].pixels[k]);
      if (r.weight == 0.0) continue;
      blocks[k] += r.weight * r.d_error_d_pose.transpose() * r.d_error_d_pose;
      b.segment<6>(6 * k) += r.weight * r.d_error_d_pose.transpose() * r.error;
      coupling.block<6, 1>(6 * k, i) += r.weight * r.d_error_d_pose.transpose() * r.d_error_d_rho;
      H_rho[i] += r.weight * r.d_error_d_rho.squaredNorm();
      b_rho[i] += r.weight * r.d_error_d_rho.dot(r.error);
    }
  }
  for (std::size_t k = 0; k < n; ++k) H.block<6, 6>(6 * k, 6 * k) = blocks[k];
  H.diagonal() *= 1.0 + lambda;
  const VectorXd inverse = (H_rho.array() * (1.0 + lambda) + 1e-9).inverse();
  H -= coupling * inverse.asDiagonal() * coupling.transpose();
  const VectorXd reduced = b - coupling * inverse.cwiseProduct(b_rho);
  const VectorXd scale = (H.diagonal().array().abs() + 1e-12).sqrt().inverse();
  const MatrixXd A = scale.asDiagonal() * H * scale.asDiagonal();
  const VectorXd x = -(scale.asDiagonal() * geometry::solve_symmetric(A, scale.asDiagonal() * reduced));
  const VectorXd rho_step = -inverse.cwiseProduct(b_rho + coupling.transpose() * x);
  InitializationBundle next = bundle;
  for (std::size_t k = 0; k < n; ++k) next.T_camera_first[k] = SE3::exp(x.segment<6>(6 * k)) * bundle.T_camera_first[k];
  for (std::size_t i = 0; i < tracks.size(); ++i) next.rho[i] += rho_step[i];
  return next;
}

double median(std::vector<double> values) { return values.empty() ? 0.0 : base::upper_median(std::move(values)); }

void compute_diagnostics(const keyframes::Lens& lens, const std::vector<CornerTrack>& tracks, double cost,
                         InitializationBundle& bundle) {
  std::vector<double> residuals;
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    for (std::size_t k = 0; k < bundle.T_camera_first.size(); ++k) {
      if (!tracks[i].pixels[k]) continue;
      residuals.push_back(
          reproject(lens, bundle.T_camera_first[k], tracks[i].ray, bundle.rho[i], *tracks[i].pixels[k]).error.norm());
    }
  }
  bundle.cost = cost / std::max<std::size_t>(1, residuals.size());
  bundle.median_residual_px = median(residuals);
  const auto behind = std::count_if(bundle.rho.begin(), bundle.rho.end(), [](double rho) { return rho < 0; });
  bundle.behind_share = static_cast<double>(behind) / std::max<std::size_t>(1, tracks.size());
  const double scale = median(bundle.rho);
  if (!(scale > 0)) return;
  for (double& rho : bundle.rho) rho /= scale;
  for (SE3& T : bundle.T_camera_first) T.translation *= scale;
}

}  // namespace

SE3 resect(const keyframes::Lens& lens, const std::vector<CornerTrack>& tracks, const std::vector<double>& rho,
           std::size_t picture, const SE3& start) {
  constexpr int kIterations = 25;
  SE3 T = start;
  // Damping schedule, chosen by hand.
  double best_cost = std::numeric_limits<double>::infinity(), lambda = 1e-4;
  SE3 best = start;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    Mat6 H = Mat6::Zero();
    Vec6 b = Vec6::Zero();
    double cost = 0;
    for (std::size_t i = 0; i < tracks.size(); ++i) {
      if (!tracks[i].pixels[picture]) continue;
      const Reprojection r = reproject(lens, T, tracks[i].ray, rho[i], *tracks[i].pixels[picture]);
      cost += r.cost;
      if (r.weight == 0.0) continue;
      H += r.weight * r.d_error_d_pose.transpose() * r.d_error_d_pose;
      b += r.weight * r.d_error_d_pose.transpose() * r.error;
    }
    const bool better = cost < best_cost;
    if (better) {
      best = T;
      best_cost = cost;
      lambda *= 0.3;
    } else {
      lambda *= 10.0;
      if (lambda > 1e6) break;
      T = best;
    }
    H.diagonal() *= 1.0 + lambda;
    const Vec6 step = -geometry::solve_symmetric(H, b);
    if (!step.allFinite()) break;
    if (better && step.norm() * lens.focal_px() < 1e-3) break;
    T = SE3::exp(step) * T;
  }
  return best;
}

InitializationBundle bundle_adjust(const keyframes::Lens& lens, const std::vector<CornerTrack>& tracks,
                                   std::size_t pictures, const SE3& T_last_first, int iterations) {
  constexpr double kMinRho = 1e-3, kMaxRho = 1e3;  // for a unit baseline
  InitializationBundle bundle;
  bundle.T_camera_first.resize(pictures);
  const std::size_t last = pictures - 1;
  for (const CornerTrack& track : tracks) {
    const auto ray = track.pixels[last] ? lens.unproject(*track.pixels[last]) : std::nullopt;
    const double rho = ray ? triangulate_inverse_distance(T_last_first, {track.ray, *ray}) : kMinRho;
    bundle.rho.push_back(std::clamp(rho, kMinRho, kMaxRho));
  }
  // Backwards from the last image: each resection starts from its neighbour's pose, scaled towards the first.
  bundle.T_camera_first[last] = T_last_first;
  for (std::size_t k = last; k-- > 0;) {
    const double part = static_cast<double>(k + 1) / static_cast<double>(k + 2);
    const SE3& next = bundle.T_camera_first[k + 1];
    const SE3 guess(Eigen::Quaterniond::Identity().slerp(part, next.rotation), part * next.translation);
    bundle.T_camera_first[k] = resect(lens, tracks, bundle.rho, k, guess);
  }
  // Damping schedule, chosen by hand.
  double cost = total_cost(lens, tracks, bundle), lambda = 1e-3;
  for (int i = 0; i < iterations && lambda < 1e8; ++i) {
    const InitializationBundle next = levenberg_marquardt_step(lens, tracks, bundle, lambda);
    const double next_cost = total_cost(lens, tracks, next);
    if (!(next_cost < cost)) {
      lambda *= 8.0;
      continue;
    }
    const bool settled = cost - next_cost < 1e-5 * cost;
    bundle = next;
    cost = next_cost;
    lambda *= 0.3;
    if (settled) break;
  }
  compute_diagnostics(lens, tracks, cost, bundle);
  return bundle;
}

}  // namespace tileflight::initialization
