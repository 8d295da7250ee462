#include "tileflight/slam/odometry/rig_turn.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "tileflight/core/base/order_statistics.h"

namespace tileflight::odometry {
namespace {

using geometry::Mat3;
using geometry::Vec3;

/// Two unit vectors across a ray.
Eigen::Matrix<double, 2, 3> across(const Vec3& ray) {
  Eigen::Matrix<double, 2, 3> basis;
  basis.row(0) = ray.unitOrthogonal().transpose();
  basis.row(1) = ray.cross(basis.row(0).transpose()).transpose();
  return basis;
}

/// Residual of a corner, radians, and its derivatives by turn and logarithm of the scale.
struct Residual {
  Eigen::Vector2d value;
  Eigen::Matrix<double, 2, 4> jacobian;
};

Residual residual_of(const RigCorner& corner, const Vec3& centre, const Eigen::Quaterniond& turn, double scale) {
  const Vec3 shift = scale * corner.rho * centre, direction = corner.own + shift;
  const double length = direction.norm();
  const Vec3 predicted = direction / length, turned = turn * corner.other;
  const auto basis = across(predicted);
  Residual residual;
  residual.value = basis * (turned - predicted);
  residual.jacobian.leftCols<3>() = -basis * geometry::skew(turned);
  residual.jacobian.col(3) = -basis * shift / length;
  return residual;
}

/// The median of the scales that the corners' parallaxes give where nothing is turned.
double scale_by_angles(const std::vector<RigCorner>& corners, const Vec3& centre) {
  std::vector<double> scales;
  for (const RigCorner& corner : corners) {
    const double across_m = corner.own.cross(centre).norm();
    scales.push_back(corner.own.cross(corner.other).norm() / std::max(corner.rho * across_m, 1e-12));
  }
  return std::max(base::median(scales), 1e-12);
}

}  // namespace

double RigTurn::along_parallax_sigma_rad() const {
  return std::sqrt(parallax_axis.dot(covariance_rad2 * parallax_axis));
}

std::optional<RigTurnFit> fit_rig_turn(const std::vector<RigCorner>& corners, const Vec3& centre, double pixel_rad) {
  // Chosen by hand.
  constexpr std::size_t kFewest = 40;
  constexpr double kSigma_px = 0.3, kFits_px = 1.5, kLeastShare = 0.5, kPriorSigma_rad = 0.1, kPriorSigmaLogScale = 3.0;
  constexpr int kIterations = 15;
  if (corners.size() < kFewest) return std::nullopt;
  const double sigma_rad = kSigma_px * pixel_rad;
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
  double log_scale = std::log(scale_by_angles(corners, centre));
  const double first_log_scale = log_scale;
  Eigen::Matrix4d H;
  for (int i = 0; i < kIterations; ++i) {
    Eigen::Vector4d x;
    x << geometry::so3_log(turn), log_scale - first_log_scale;
    const Eigen::Vector4d prior(std::pow(kPriorSigma_rad, -2), std::pow(kPriorSigma_rad, -2),
                                std::pow(kPriorSigma_rad, -2), std::pow(kPriorSigmaLogScale, -2));
    H = prior.asDiagonal();
    Eigen::Vector4d g = prior.cwiseProduct(x);
    for (const RigCorner& corner : corners) {
      const Residual r = residual_of(corner, centre, turn, std::exp(log_scale));
      const double weight = 1.0 / (sigma_rad * sigma_rad + r.value.squaredNorm());  // Cauchy
      H += weight * r.jacobian.transpose() * r.jacobian;
      g += weight * r.jacobian.transpose() * r.value;
    }
    const Eigen::Vector4d step = -H.ldlt().solve(g);
    turn = geometry::so3_exp(Vec3(step.head<3>())) * turn;
    log_scale += step[3];
    if (step.norm() < 1e-9) break;
  }
  RigTurnFit fit{.turn_rad = geometry::so3_log(turn), .scale = std::exp(log_scale), .pixel_rad = pixel_rad};
  std::vector<double> parallax_rad;
  std::size_t fitting = 0;
  for (const RigCorner& corner : corners) {
    const Vec3 shift = fit.scale * corner.rho * centre, predicted = (corner.own + shift).normalized();
    const Residual r = residual_of(corner, centre, turn, fit.scale);
    if (r.value.norm() > kFits_px * pixel_rad) continue;
    ++fitting;
    parallax_rad.push_back(std::acos(std::clamp(predicted.dot(corner.own), -1.0, 1.0)));
    fit.parallax_axis += predicted.cross(centre).normalized();
  }
  if (static_cast<double>(fitting) < kLeastShare * static_cast<double>(corners.size())) return std::nullopt;
  fit.parallax_axis.normalize();
  fit.parallax_rad = base::median(parallax_rad);
  // This is left of the turn's information when the scale is unknown.
  fit.information = H.topLeftCorner<3, 3>() - H.topRightCorner<3, 1>() * H.bottomLeftCorner<1, 3>() / H(3, 3);
  return fit;
}

std::optional<RigTurn> join_rig_turns(const std::vector<RigTurnFit>& fits) {
  if (fits.empty()) return std::nullopt;
  Mat3 information = Mat3::Zero();
  Vec3 weighted = Vec3::Zero(), axis = Vec3::Zero();
  std::vector<double> parallax_rad;
  for (const RigTurnFit& fit : fits) {
    information += fit.information;
    weighted += fit.information * fit.turn_rad;
    axis += fit.parallax_axis;
    parallax_rad.push_back(fit.parallax_rad);
  }
  RigTurn joined{.segments = static_cast<int>(fits.size()), .parallax_axis = axis.normalized()};
  joined.turn_rad = information.ldlt().solve(weighted);
  joined.parallax_rad = base::median(parallax_rad);
  joined.pixel_rad = fits.front().pixel_rad;
  double chi_squared = 0.0;
  for (const RigTurnFit& fit : fits) {
    const Vec3 difference = fit.turn_rad - joined.turn_rad;
    chi_squared += difference.dot(fit.information * difference);
  }
  // Corners of one instant share errors (distortion, the path), so that one fit alone is taken for twice as uncertain.
  const double inflation =
      fits.size() == 1 ? 4.0 : std::max(1.0, chi_squared / (3.0 * static_cast<double>(fits.size() - 1)));
  joined.covariance_rad2 = inflation * information.inverse();
  return joined;
}

}  // namespace tileflight::odometry
