#include "tileflight/registration/similarity_estimate.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cassert>
#include <cmath>

namespace tileflight::registration {

using geometry::Sim3;
using geometry::Vec3;
using geometry::Vec7;

Vec7 motion_between(const Sim3& reference, const Sim3& T, const Vec3& center) {
  const Sim3 beyond = T * reference.inverse();
  Vec7 motion;
  motion << beyond * center - center, geometry::so3_log(beyond.rotation), std::log(beyond.scale);
  return motion;
}

Sim3 apply_motion(const Sim3& T, const Vec7& motion, const Vec3& center) {
  const Sim3 about_center(std::exp(motion[6]), geometry::so3_exp(motion.segment<3>(3)), Vec3::Zero());
  const Vec3 translation = center + motion.head<3>() - about_center * center;
  return Sim3(about_center.scale, about_center.rotation, translation) * T;
}

namespace {

/// Change of a motion's centre: x_new = C x_old.
Mat7 change_of_center(const Vec3& from, const Vec3& to) {
  Mat7 change = Mat7::Identity();
  const Vec3 arm = to - from;
  change.block<3, 3>(0, 3) = -geometry::skew(arm);  // w x arm
  change.block<3, 1>(0, 6) = arm;
  return change;
}

}  // namespace

SimilarityEstimate SimilarityEstimate::recentered(const Vec3& new_center) const {
  const Mat7 back = change_of_center(new_center, center);  // x_old = back x_new
  return {T_target_source, new_center, back.transpose() * information * back};
}

SimilarityEstimate fuse(const std::vector<SimilarityEstimate>& estimates) {
  assert(!estimates.empty());
  const SimilarityEstimate& first = estimates.front();
  SimilarityEstimate result{first.T_target_source, first.center, Mat7::Zero()};
  Vec7 pull = Vec7::Zero();
  for (const SimilarityEstimate& estimate : estimates) {
    const Mat7 information = estimate.recentered(first.center).information;
    result.information += information;
    pull += information * motion_between(first.T_target_source, estimate.T_target_source, first.center);
  }
  const Vec7 scale = (result.information.diagonal().array() + 1e-30).sqrt().inverse();
  Mat7 scaled = scale.asDiagonal() * result.information * scale.asDiagonal();
  scaled.diagonal().array() += 1e-9;  // undetermined directions do not move
  const Vec7 motion = scale.asDiagonal() * scaled.ldlt().solve(scale.asDiagonal() * pull);
  result.T_target_source = apply_motion(first.T_target_source, motion, first.center);
  return result;
}

Disagreement compute_disagreement(const SimilarityEstimate& a, const SimilarityEstimate& b) {
  Disagreement result;
  result.motion = motion_between(a.T_target_source, b.T_target_source, a.center);
  // With both informations diagonal in one basis (generalised eigenvectors), the covariance of the difference is a sum
  // of inverses there: l_a l_b / (l_a + l_b) is its information, zero where either has no information.
  const Mat7 A = a.information, B = b.recentered(a.center).information;
  const Mat7 sum = A + B;
  const Vec7 scale = (sum.diagonal().array() + 1e-30).sqrt().inverse();
  const Eigen::SelfAdjointEigenSolver<Mat7> whole(scale.asDiagonal() * sum * scale.asDiagonal());
  constexpr double kOpen = 1e-9;
  for (int k = 0; k < 7; ++k) {
    if (!(whole.eigenvalues()[k] > kOpen * whole.eigenvalues()[6])) return result;
  }
  const Mat7 root = whole.eigenvectors() * whole.eigenvalues().cwiseSqrt().cwiseInverse().asDiagonal();
  const Mat7 basis = scale.asDiagonal() * root;  // basis^T sum basis = 1
  const Eigen::SelfAdjointEigenSolver<Mat7> own(basis.transpose() * A * basis);
  const Vec7 coordinates = (basis * own.eigenvectors()).inverse() * result.motion;
  constexpr double kKnown = 1e-3;  // smaller share of either in the sum below which the direction is skipped
  for (int k = 0; k < 7; ++k) {
    const double share = std::min(own.eigenvalues()[k], 1.0 - own.eigenvalues()[k]);
    if (share < kKnown) continue;
    result.squared_mahalanobis += own.eigenvalues()[k] * (1.0 - own.eigenvalues()[k]) * coordinates[k] * coordinates[k];
    ++result.degrees_of_freedom;
  }
  return result;
}

}  // namespace tileflight::registration
