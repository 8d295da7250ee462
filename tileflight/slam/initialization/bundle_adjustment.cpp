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
  Eigen::Matrix<double, 2, 7> d_error_d_image;  ///< by the pose, and by the logarithm of the focal length
  Vec2 d_error_d_rho = Vec2::Zero();
  double weight = 0.0;
  double cost = 0.0;
};

double huber_cost(double e) { return e < kHuber_px ? e * e : kHuber_px * (2 * e - kHuber_px); }

/// An image magnified about the principal point: its pixel is `center` + `factor` (pixel - `center`).
struct Zoom {
  Vec2 center = Vec2::Zero();
  double factor = 1.0;
};

Zoom zoom_of(const keyframes::Lens& lens, double log_focal_change) {
  Vec2 principal_point = Vec2::Zero();
  lens.project<double>(Vec3::UnitZ(), principal_point);
  return {principal_point, std::exp(log_focal_change)};
}

Reprojection reproject(const keyframes::Lens& lens, const SE3& T, const Zoom& zoom, const Vec3& ray, double rho,
                       const Vec2& measured) {
  Reprojection out;
  const Vec3 X = T.rotation * ray + rho * T.translation;
  Vec2 pixel;
  Eigen::Matrix<double, 2, 3> by_X;
  if (!lens.project<double>(X, pixel, by_X)) {
    out.cost = huber_cost(kOutside_px);
    return out;
  }
  Vec2 by_log_focal = pixel - zoom.center;
  if (zoom.factor != 1.0) {
    by_log_focal *= zoom.factor;
    by_X *= zoom.factor;
    pixel = zoom.center + by_log_focal;
  }
  out.error = pixel - measured;
  const double e = out.error.norm();
  out.weight = e < kHuber_px ? 1.0 : kHuber_px / e;
  out.cost = huber_cost(e);
  Eigen::Matrix<double, 2, 6> by_pose;
  keyframes::pixel_derivatives<double>(by_X, X, T.translation, rho, by_pose, out.d_error_d_rho);
  out.d_error_d_image << by_pose, by_log_focal;
  return out;
}

/// Calls visit(track, image, reprojection) for each pixel of each track.
template <class Visit>
void for_each_reprojection(const keyframes::Lens& lens, const std::vector<CornerTrack>& tracks,
                           const InitializationBundle& bundle, const Visit& visit) {
  std::vector<Zoom> zooms(bundle.T_camera_first.size());
  for (std::size_t k = 0; k < bundle.log_focal_change.size(); ++k) zooms[k] = zoom_of(lens, bundle.log_focal_change[k]);
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    for (std::size_t k = 0; k < bundle.T_camera_first.size(); ++k) {
      if (!tracks[i].pixels[k]) continue;
      visit(i, k,
            reproject(lens, bundle.T_camera_first[k], zooms[k], tracks[i].ray, bundle.rho[i], *tracks[i].pixels[k]));
    }
  }
}

double total_cost(const keyframes::Lens& lens, const std::vector<CornerTrack>& tracks,
                  const InitializationBundle& bundle) {
  double cost = 0;
  for_each_reprojection(lens, tracks, bundle, [&](std::size_t, std::size_t, const Reprojection& r) { cost += r.cost; });
  return cost;
}

/// Normal equations of the images, `kUnknowns` each (6 of the pose; 7: the logarithm of the focal length as well), and
/// of the points (one unknown each).
struct BundleEquations {
  MatrixXd H;  ///< of the images
  VectorXd b;
  MatrixXd coupling;  ///< of images and points
  VectorXd H_rho, b_rho;
};

template <int kUnknowns>
BundleEquations make_equations(const keyframes::Lens& lens, const std::vector<CornerTrack>& tracks,
                               const InitializationBundle& bundle) {
  const std::size_t n = bundle.T_camera_first.size();
  BundleEquations sum{.H = MatrixXd::Zero(kUnknowns * n, kUnknowns * n),
                      .b = VectorXd::Zero(kUnknowns * n),
                      .coupling = MatrixXd::Zero(kUnknowns * n, tracks.size()),
                      .H_rho = VectorXd::Zero(tracks.size()),
                      .b_rho = VectorXd::Zero(tracks.size())};
  for_each_reprojection(lens, tracks, bundle, [&](std::size_t i, std::size_t k, const Reprojection& r) {
    if (r.weight == 0.0) return;
    const Eigen::Matrix<double, 2, kUnknowns> by_image = r.d_error_d_image.template leftCols<kUnknowns>();
    const std::size_t row = kUnknowns * k;
    sum.H.template block<kUnknowns, kUnknowns>(row, row) += r.weight * by_image.transpose() * by_image;
    sum.b.template segment<kUnknowns>(row) += r.weight * by_image.transpose() * r.error;
    sum.coupling.template block<kUnknowns, 1>(row, i) += r.weight * by_image.transpose() * r.d_error_d_rho;
    sum.H_rho[i] += r.weight * r.d_error_d_rho.squaredNorm();
    sum.b_rho[i] += r.weight * r.d_error_d_rho.dot(r.error);
  });
  return sum;
}

/// One Levenberg-Marquardt step over images and points; the points are eliminated.
template <int kUnknowns>
InitializationBundle levenberg_marquardt_step(const keyframes::Lens& lens, const std::vector<CornerTrack>& tracks,
                                              const InitializationBundle& bundle, double lambda) {
  auto [H, b, coupling, H_rho, b_rho] = make_equations<kUnknowns>(lens, tracks, bundle);
  H.diagonal() *= 1.0 + lambda;
  const VectorXd inverse = (H_rho.array() * (1.0 + lambda) + 1e-9).inverse();
  H -= coupling * inverse.asDiagonal() * coupling.transpose();
  const VectorXd reduced = b - coupling * inverse.cwiseProduct(b_rho);
  const VectorXd scale = (H.diagonal().array().abs() + 1e-12).sqrt().inverse();
  const MatrixXd A = scale.asDiagonal() * H * scale.asDiagonal();
  const VectorXd x = -(scale.asDiagonal() * geometry::solve_symmetric(A, scale.asDiagonal() * reduced));
  const VectorXd rho_step = -inverse.cwiseProduct(b_rho + coupling.transpose() * x);
  InitializationBundle next = bundle;
  for (std::size_t k = 0; k < bundle.T_camera_first.size(); ++k) {
    next.T_camera_first[k] = SE3::exp(x.segment<6>(kUnknowns * k)) * bundle.T_camera_first[k];
    if constexpr (kUnknowns == 7) next.log_focal_change[k] += x[7 * k + 6];
  }
  for (std::size_t i = 0; i < tracks.size(); ++i) next.rho[i] += rho_step[i];
  return next;
}

/// Iterates from `bundle` until the cost settles, and returns the cost.
template <int kUnknowns>
double minimize(const keyframes::Lens& lens, const std::vector<CornerTrack>& tracks, int iterations,
                InitializationBundle& bundle) {
  // Damping schedule, chosen by hand.
  double cost = total_cost(lens, tracks, bundle), lambda = 1e-3;
  for (int i = 0; i < iterations && lambda < 1e8; ++i) {
    const InitializationBundle next = levenberg_marquardt_step<kUnknowns>(lens, tracks, bundle, lambda);
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
  return cost;
}

double median(std::vector<double> values) { return values.empty() ? 0.0 : base::upper_median(std::move(values)); }

std::vector<double> residuals_px(const keyframes::Lens& lens, const std::vector<CornerTrack>& tracks,
                                 const InitializationBundle& bundle) {
  std::vector<double> residuals;
  for_each_reprojection(lens, tracks, bundle,
                        [&](std::size_t, std::size_t, const Reprojection& r) { residuals.push_back(r.error.norm()); });
  return residuals;
}

void compute_diagnostics(const keyframes::Lens& lens, const std::vector<CornerTrack>& tracks, double cost,
                         InitializationBundle& bundle) {
  const std::vector<double> residuals = residuals_px(lens, tracks, bundle);
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
      const Reprojection r = reproject(lens, T, {}, tracks[i].ray, rho[i], *tracks[i].pixels[picture]);
      cost += r.cost;
      if (r.weight == 0.0) continue;
      const Eigen::Matrix<double, 2, 6> by_pose = r.d_error_d_image.leftCols<6>();
      H += r.weight * by_pose.transpose() * by_pose;
      b += r.weight * by_pose.transpose() * r.error;
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
  const double cost = minimize<6>(lens, tracks, iterations, bundle);
  compute_diagnostics(lens, tracks, cost, bundle);
  return bundle;
}

std::optional<FocalChangeFit> fit_focal_change(const keyframes::Lens& lens, const std::vector<CornerTrack>& tracks,
                                               InitializationBundle bundle, int iterations) {
  const std::size_t n = bundle.T_camera_first.size();
  bundle.log_focal_change.assign(n, 0.0);
  minimize<7>(lens, tracks, iterations, bundle);
  auto [H, b, coupling, H_rho, b_rho] = make_equations<7>(lens, tracks, bundle);
  const VectorXd inverse = (H_rho.array() + 1e-9).inverse();
  H -= coupling * inverse.asDiagonal() * coupling.transpose();
  // Nothing decides on the scale of positions: the length of the last one is held.
  const std::size_t last = 7 * (n - 1);
  const Vec3 direction = bundle.T_camera_first[n - 1].translation.normalized();
  H.block<3, 3>(last, last) += H.diagonal().maxCoeff() * direction * direction.transpose();
  const VectorXd scale = (H.diagonal().array().abs() + 1e-12).sqrt().inverse();
  const MatrixXd A = scale.asDiagonal() * H * scale.asDiagonal();
  FocalChangeFit fit{.log_change = bundle.log_focal_change, .sigma = {}, .median_residual_px = 0.0};
  fit.median_residual_px = median(residuals_px(lens, tracks, bundle));
  constexpr double kMedianOfRayleigh = 1.1774;  // of the length of a 2D normal deviate with unit sigma
  for (std::size_t k = 0; k < n; ++k) {
    const Eigen::Index row = static_cast<Eigen::Index>(7 * k + 6);
    const VectorXd column = geometry::solve_symmetric(A, VectorXd::Unit(A.rows(), row));
    const double variance = column[row] * scale[row] * scale[row];
    if (!(variance > 0.0) || !std::isfinite(fit.log_change[k])) return std::nullopt;
    fit.sigma.push_back(std::sqrt(variance) * fit.median_residual_px / kMedianOfRayleigh);
  }
  return fit;
}

}  // namespace tileflight::initialization
