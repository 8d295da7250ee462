#include "tileflight/core/alignment/uncertainty.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>

#include "tileflight/core/alignment/plane_system.h"
#include "tileflight/core/geometry/decompositions.h"

namespace tileflight::alignment {

double jackknife_sigma_m(const geometry::Sim3& whole, std::size_t groups, const PointSpread& points,
                         const std::function<geometry::Sim3(std::size_t group)>& without) {
  if (groups < 2) return std::numeric_limits<double>::quiet_NaN();
  double sum = 0.0;
  for (std::size_t g = 0; g < groups; ++g) {
    const double moved_m = rms_motion_m(whole, without(g), points);
    sum += moved_m * moved_m;
  }
  const auto n = static_cast<double>(groups);
  return std::sqrt((n - 1.0) / n * sum);
}

using geometry::Mat3;
using geometry::Vec3;
using geometry::Vec7;

namespace {

/// Sums over the matches of J J^T, of g g^T for each match alone, and of g over each cube.
struct Sums {
  Eigen::MatrixXd hessian, per_match, per_block;
};

Sums accumulate_sums(const std::vector<MatchedPlane>& matches, Eigen::Index unknowns,
                     const UncertaintyOptions& options) {
  Sums sums{Eigen::MatrixXd::Zero(unknowns, unknowns), Eigen::MatrixXd::Zero(unknowns, unknowns),
            Eigen::MatrixXd::Zero(unknowns, unknowns)};
  std::map<std::array<std::int64_t, 3>, Eigen::VectorXd> gradients;
  for (const MatchedPlane& m : matches) {
    const Eigen::VectorXd jacobian = plane_jacobian(m.point, m.normal, options.length_m).head(unknowns);
    const Eigen::VectorXd gradient = jacobian * m.residual_m;
    sums.hessian += jacobian * jacobian.transpose();
    sums.per_match += gradient * gradient.transpose();
    const Vec3 cube = (m.point / options.correlation_length_m).array().floor();
    auto& sum = gradients[{static_cast<std::int64_t>(cube.x()), static_cast<std::int64_t>(cube.y()),
                           static_cast<std::int64_t>(cube.z())}];
    if (sum.size() == 0) sum = Eigen::VectorXd::Zero(unknowns);
    sum += gradient;
  }
  for (const auto& [cube, sum] : gradients) sums.per_block += sum * sum.transpose();
  return sums;
}

/// Positive semidefinite part of a symmetric matrix.
Eigen::MatrixXd project_to_psd(const Eigen::MatrixXd& m) {
  const geometry::SymmetricEigen eigen = geometry::symmetric_eigen(m);
  return eigen.vectors * eigen.values.cwiseMax(0.0).asDiagonal() * eigen.vectors.transpose();
}

/// Mean over the points of |J_p x|^2 for x of the covariance: translation + rotation x p + stretch p, about the centre.
double mean_squared_motion(const Eigen::Matrix<double, 7, 7>& covariance, const Mat3& second_moment) {
  // E |t|^2 + E |w x p|^2 + E s^2 |p|^2; the cross terms with t vanish at the centre, those of w x p with s p always.
  const Mat3 rotation = covariance.block<3, 3>(3, 3);
  return covariance.topLeftCorner<3, 3>().trace() + rotation.trace() * second_moment.trace() -
         (rotation * second_moment).trace() + covariance(6, 6) * second_moment.trace();
}

}  // namespace

std::optional<AlignmentUncertainty> estimate_uncertainty(const std::vector<MatchedPlane>& matches,
                                                         const PointSpread& spread, const UncertaintyOptions& options) {
  const Eigen::Index unknowns = options.with_scale ? 7 : 6;
  if (matches.size() < static_cast<std::size_t>(2 * unknowns)) return std::nullopt;
  const Sums sums = accumulate_sums(matches, unknowns, options);
  constexpr double kOpen = 1e-6;  // eigenvalue share below which a motion is unconstrained
  if (!(geometry::symmetric_eigenvalues(sums.hessian)[0] > kOpen * static_cast<double>(matches.size())))
    return std::nullopt;

  // The fit used 1 / sampled_share times as many matches: the independent part of the scatter shrinks by that factor,
  // the part common to neighbours does not.
  const Eigen::MatrixXd middle =
      options.sampled_share * sums.per_match + project_to_psd(sums.per_block - sums.per_match);
  const Eigen::MatrixXd inverse = geometry::symmetric_inverse(sums.hessian);
  Eigen::Matrix<double, 7, 7> scaled = Eigen::Matrix<double, 7, 7>::Zero();
  scaled.topLeftCorner(unknowns, unknowns) = inverse * middle * inverse;
  Vec7 units;
  units << Vec3::Ones(), Vec3::Constant(1.0 / options.length_m), 1.0 / options.length_m;

  AlignmentUncertainty u;
  u.covariance = units.asDiagonal() * scaled * units.asDiagonal();
  const Vec7 sigma = u.covariance.diagonal().cwiseSqrt();
  u.translation_sigma_m = sigma.head<3>();
  u.rotation_sigma_rad = sigma.segment<3>(3);
  u.scale_sigma = sigma[6];
  u.rms_motion_sigma_m = std::sqrt(mean_squared_motion(u.covariance, spread.second_moment));
  return u;
}

}  // namespace tileflight::alignment
