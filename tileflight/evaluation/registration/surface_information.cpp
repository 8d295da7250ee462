#include "tileflight/evaluation/registration/surface_information.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <utility>

#include "tileflight/core/alignment/plane_system.h"
#include "tileflight/core/geometry/decompositions.h"

namespace tileflight::registration {

using geometry::Vec3;
using geometry::Vec7;

namespace {

/// Sums of g g^T over clusters of matches, g being a cluster's sum of gradients; with the small-sample correction for
/// the number of clusters.
template <class Key>
Mat7 clustered_scatter(const std::vector<Vec7>& gradients, const std::vector<Key>& keys) {
  std::map<Key, Vec7> sums;
  for (std::size_t i = 0; i < gradients.size(); ++i) {
    auto [at, is_new] = sums.try_emplace(keys[i], Vec7::Zero());
    at->second += gradients[i];
  }
  Mat7 middle = Mat7::Zero();
  for (const auto& [key, g] : sums) middle += g * g.transpose();
  const auto clusters = static_cast<double>(sums.size());
  return clusters > 1.0 ? Mat7(middle * clusters / (clusters - 1.0)) : middle;
}

using Cube = std::array<std::int64_t, 3>;

Cube cube_key(const Vec3& y, double edge_m) {
  const Vec3 cell = (y / edge_m).array().floor();
  return {static_cast<std::int64_t>(cell.x()), static_cast<std::int64_t>(cell.y()),
          static_cast<std::int64_t>(cell.z())};
}

}  // namespace

ShapeInformation shape_information(const SurfaceMatches& matches, double length_m) {
  constexpr double kBlocksAcross = 10.0;  // number of cubes along the RMS extent of the map
  const double edge_m = std::max(1.0, 2.0 * length_m / kBlocksAcross);
  ShapeInformation information;
  std::vector<Vec7> gradients;
  std::vector<Cube> cubes;
  std::vector<std::size_t> keyframes;
  std::vector<std::pair<Cube, std::size_t>> both;
  for (std::size_t k = 0; k < matches.residuals.size(); ++k) {
    const SurfaceResidual& r = matches.residuals[k];
    const double z2 = r.residual_m * r.residual_m / (r.sigma_m * r.sigma_m);
    const double weight = kernel_weight(z2) / (r.sigma_m * r.sigma_m);
    const Vec7 jacobian = alignment::plane_jacobian(r.y, r.normal, length_m);
    information.hessian += weight * jacobian * jacobian.transpose();
    gradients.push_back(weight * r.residual_m * jacobian);
    cubes.push_back(cube_key(r.y, edge_m));
    if (matches.keyframes.empty()) continue;
    keyframes.push_back(matches.keyframes[k]);
    both.emplace_back(cubes.back(), keyframes.back());
  }
  information.gradient_scatter = clustered_scatter(gradients, cubes);
  if (!keyframes.empty())
    information.gradient_scatter += clustered_scatter(gradients, keyframes) - clustered_scatter(gradients, both);
  return information;
}

Mat7 sandwich_information(const ShapeInformation& information, double length_m) {
  const Vec7 scale = (information.hessian.diagonal().array() + 1e-30).sqrt().inverse();
  const Mat7 H = scale.asDiagonal() * information.hessian * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Mat7> eigen(H);
  constexpr double kOpen = 1e-6;
  Mat7 result = Mat7::Zero();
  const Mat7 middle = eigen.eigenvectors().transpose() *
                      (scale.asDiagonal() * information.gradient_scatter * scale.asDiagonal()) * eigen.eigenvectors();
  // In the directions that the surface constrains: covariance = D^-1 M D^-1 with D the eigenvalues.
  std::vector<int> held;
  for (int k = 0; k < 7; ++k)
    if (eigen.eigenvalues()[k] > kOpen) held.push_back(k);
  const auto n = static_cast<Eigen::Index>(held.size());
  Eigen::MatrixXd covariance(n, n), basis(7, n);
  for (Eigen::Index a = 0; a < n; ++a) {
    basis.col(a) = eigen.eigenvectors().col(held[static_cast<std::size_t>(a)]);
    for (Eigen::Index b = 0; b < n; ++b) {
      const int i = held[static_cast<std::size_t>(a)], j = held[static_cast<std::size_t>(b)];
      covariance(a, b) = middle(i, j) / (eigen.eigenvalues()[i] * eigen.eigenvalues()[j]);
      if (a == b) covariance(a, b) += 1.0 / eigen.eigenvalues()[i];  // the points' own noise
    }
  }
  if (n > 0) {
    const geometry::SymmetricEigen own = geometry::symmetric_eigen(covariance);
    const Eigen::VectorXd inverse = own.values.cwiseMax(1e-12).cwiseInverse();
    result = basis * (own.vectors * inverse.asDiagonal() * own.vectors.transpose()) * basis.transpose();
  }
  Vec7 units;
  units << Vec3::Ones(), Vec3::Constant(length_m), length_m;  // from metres to radians and logarithm
  const Vec7 back = units.cwiseQuotient(scale);
  return back.asDiagonal() * result * back.asDiagonal();
}

double information_discount(const ShapeInformation& information) {
  const Vec7 scale = (information.hessian.diagonal().array() + 1e-30).sqrt().inverse();
  const Mat7 ratio = scale.asDiagonal() * information.gradient_scatter * scale.asDiagonal();
  return std::max(1.0, ratio.trace() / 7.0);
}

}  // namespace tileflight::registration
