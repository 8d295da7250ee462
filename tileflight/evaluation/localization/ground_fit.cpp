#include "tileflight/evaluation/localization/ground_fit.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/geometry/decompositions.h"
#include "tileflight/evaluation/registration/similarity_estimate.h"

namespace tileflight::localization {

using geometry::Sim3;
using geometry::Vec3;
using geometry::Vec7;
using Mat7 = Eigen::Matrix<double, 7, 7>;
using Rows = Eigen::Matrix<double, 3, 7>;

namespace {

/// Derivative of a transformed point by a motion about the centre (registration::apply_motion()).
Rows position_jacobian(const Vec3& arm) {
  Rows J;
  J << geometry::Mat3::Identity(), -geometry::skew(arm), arm;
  return J;
}

struct SimilarityNormalEquations {
  Mat7 H = Mat7::Zero();
  Vec7 b = Vec7::Zero();

  void add(const Eigen::Matrix<double, 1, 7>& row, double residual, double weight) {
    H += weight * row.transpose() * row;
    b -= weight * row.transpose() * residual;
  }
};

double geman_mcclure(double squared, double scale) {
  const double w = 1.0 / (1.0 + squared / (scale * scale));
  return w * w;
}

}  // namespace

Sim3 fit_to_ground(const Sim3& start, const std::vector<GroundPair>& pairs, const std::vector<Vec3>& surface,
                   const GroundImage& ground) {
  Sim3 T = start;
  if (surface.empty() || pairs.empty()) return T;
  Vec3 middle = Vec3::Zero();
  for (const Vec3& p : surface) middle += p / static_cast<double>(surface.size());
  double spread = 0.0;
  for (const Vec3& p : surface) spread += (p - middle).squaredNorm() / static_cast<double>(surface.size());
  double weights = 0.0;
  for (const GroundPair& pair : pairs) weights += pair.weight;
  const double of_a_place = weights / static_cast<double>(surface.size());
  constexpr int kRounds = 12;
  constexpr double kFirst = 0.2,
                   kLast = 0.02;  // kernel scale in the first and in the last round, as a share of the mosaic's size
  for (int round = 0; round < kRounds; ++round) {
    const double part = std::min(1.0, round / (0.7 * kRounds));
    const double scale = T.scale * std::sqrt(spread) * kFirst * std::pow(kLast / kFirst, part);
    const Vec3 center = T * middle;
    SimilarityNormalEquations normal;
    for (const GroundPair& pair : pairs) {
      const Vec3 here = T * pair.source, residual = here - pair.target;
      const double weight = pair.weight * geman_mcclure(residual.squaredNorm(), scale);
      const Rows J = position_jacobian(here - center);
      for (int k = 0; k < 3; ++k) normal.add(J.row(k), residual[k], weight);
    }
    for (const Vec3& p : surface) {
      const Vec3 here = T * p;
      const auto height = ground.height_at(here.head<2>());
      if (!height) continue;
      const double residual = here.z() - *height;
      normal.add(position_jacobian(here - center).row(2), residual,
                 of_a_place * geman_mcclure(residual * residual, scale));
    }
    normal.H.diagonal() *= 1.0 + 1e-6;
    const Vec7 motion = geometry::solve_symmetric(normal.H, normal.b);
    if (!motion.allFinite()) return start;
    T = registration::apply_motion(T, motion, center);
  }
  return T;
}

std::vector<Vec3> sample_heights(const GroundImage& mosaic, std::size_t most) {
  std::vector<Vec3> all;
  for (int j = 0; j < mosaic.height.height; ++j) {
    for (int i = 0; i < mosaic.height.width; ++i) {
      const float z = mosaic.height(i, j);
      if (!std::isfinite(z)) continue;
      const geometry::Vec2 at = mosaic.position(i * GroundImage::kHeightStep, j * GroundImage::kHeightStep);
      all.emplace_back(at.x(), at.y(), z);
    }
  }
  const std::size_t stride = std::max<std::size_t>(1, all.size() / std::max<std::size_t>(1, most));
  std::vector<Vec3> some;
  for (std::size_t k = 0; k < all.size(); k += stride) some.push_back(all[k]);
  return some;
}

}  // namespace tileflight::localization
