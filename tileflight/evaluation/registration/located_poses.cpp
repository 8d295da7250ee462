#include "tileflight/evaluation/registration/located_poses.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include "tileflight/core/alignment/umeyama.h"
#include "tileflight/core/alignment/uncertainty.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/order_statistics.h"
#include "tileflight/core/geometry/decompositions.h"

namespace tileflight::registration {

using geometry::SE3;
using geometry::Sim3;

Sim3 similarity_of(const std::vector<LocatedPose>& poses) {
  std::vector<SE3> in_map, found;
  for (const LocatedPose& pose : poses) {
    in_map.push_back(pose.T_map_camera);
    found.push_back(pose.T_local_camera);
  }
  return alignment::fit_poses(in_map, found);
}

namespace {

/// Returns the motions about `center` from the similarity of all poses to that without each of `groups` intervals of
/// the path.
std::vector<geometry::Vec7> leave_out_intervals(const std::vector<LocatedPose>& poses, std::size_t groups,
                                                const geometry::Vec3& center) {
  const Sim3 whole = similarity_of(poses);
  std::vector<geometry::Vec7> without;
  for (std::size_t group = 0; group < groups; ++group) {
    std::vector<LocatedPose> rest;
    for (std::size_t i = 0; i < poses.size(); ++i)
      if (i * groups / poses.size() != group) rest.push_back(poses[i]);
    without.push_back(motion_between(whole, similarity_of(rest), center));
  }
  return without;
}

/// Returns the covariance by the delete-a-group jackknife.
Mat7 jackknife_covariance(const std::vector<geometry::Vec7>& without) {
  Mat7 squares = Mat7::Zero();
  for (const geometry::Vec7& motion : without) squares += motion * motion.transpose();
  const auto n = static_cast<double>(without.size());
  return (n - 1.0) / n * squares;
}

/// Returns the covariance by the second differences of `without`, of which there are three or more.
Mat7 contrast_covariance(const std::vector<geometry::Vec7>& without) {
  Mat7 squares = Mat7::Zero();
  for (std::size_t g = 2; g < without.size(); ++g) {
    const geometry::Vec7 contrast = without[g - 2] - 2.0 * without[g - 1] + without[g];
    squares += contrast * contrast.transpose();
  }
  const auto n = static_cast<double>(without.size());
  return (n - 1.0) * (n - 1.0) / (6.0 * n * (n - 2.0)) * squares;
}

geometry::Vec3 mean_position(const std::vector<LocatedPose>& poses) {
  geometry::Vec3 mean = geometry::Vec3::Zero();
  for (const LocatedPose& pose : poses) mean += pose.T_local_camera.translation / static_cast<double>(poses.size());
  return mean;
}

using Block = std::array<long, 3>;

/// Returns the side of the blocks of ground: the median size of what a part shows. 0: no pose has parts.
double block_side_m(const std::vector<LocatedPose>& poses) {
  std::vector<double> sizes;
  for (const LocatedPose& pose : poses)
    for (const PosePart& part : pose.parts) sizes.push_back(part.size_m);
  return sizes.empty() ? 0.0 : base::upper_median(std::move(sizes));
}

Block block_of(const geometry::Vec3& point, double side_m) {
  return {std::lround(point.x() / side_m), std::lround(point.y() / side_m), std::lround(point.z() / side_m)};
}

}  // namespace

std::optional<Mat7> interval_covariance(const std::vector<LocatedPose>& poses, const geometry::Vec3& center,
                                        const alignment::PointSpread& points, PathCoverage coverage) {
  constexpr std::size_t kMostGroups = 8, kMostContrasts = 10, kFewestContrasts = 4;  // ten: of twenty poses two each
  constexpr double kShared = 2.0;  // errors that are shared for longer than an interval; from the proving ground
  const std::size_t groups = std::min(kMostGroups, poses.size() / 2);
  if (groups < 2) return std::nullopt;
  const Mat7 jackknife = jackknife_covariance(leave_out_intervals(poses, groups, center));
  const std::size_t contrasts = std::min(kMostContrasts, poses.size() / 2);
  if (coverage == PathCoverage::kParts || contrasts < kFewestContrasts) return jackknife;
  const Mat7 contrast = kShared * kShared * contrast_covariance(leave_out_intervals(poses, contrasts, center));
  const Sim3 T = similarity_of(poses);
  return motion_sigma_m(contrast, T, center, points) < motion_sigma_m(jackknife, T, center, points) ? contrast
                                                                                                    : jackknife;
}

Mat7 ground_covariance(const std::vector<LocatedPose>& poses, const geometry::Vec3& center) {
  const double side_m = block_side_m(poses);
  if (!(side_m > 0.0)) return Mat7::Zero();
  const auto n = static_cast<double>(poses.size());
  const geometry::Vec3 mean = mean_position(poses);
  double spread = 0.0;  // of the positions, which determines the scale
  for (const LocatedPose& pose : poses) spread += (pose.T_local_camera.translation - mean).squaredNorm();
  std::map<Block, geometry::Vec7> motions;  // of the similarity about `center`, by the parts that show a block
  for (const LocatedPose& pose : poses) {
    const geometry::Vec3 arm = pose.T_local_camera.translation - mean;
    for (const PosePart& part : pose.parts) {
      const geometry::Vec3 moved = pose.T_local_camera.rotation * part.motion.head<3>();
      const geometry::Vec3 turned = pose.T_local_camera.rotation * part.motion.tail<3>() / n;
      const double grown = spread > 0.0 ? arm.dot(moved) / spread : 0.0;
      geometry::Vec7 motion;
      motion << moved / n + turned.cross(center - mean) + grown * (center - mean), turned, grown;
      motions.try_emplace(block_of(part.point_local, side_m), geometry::Vec7::Zero()).first->second += motion;
    }
  }
  Mat7 covariance = Mat7::Zero();
  for (const auto& [block, motion] : motions) covariance += motion * motion.transpose();
  return covariance;
}

std::optional<SimilarityEstimate> estimate_similarity(const std::vector<LocatedPose>& poses,
                                                      const alignment::PointSpread& points, PathCoverage coverage) {
  const geometry::Vec3 center = mean_position(poses);
  const auto by_intervals = interval_covariance(poses, center, points, coverage);
  if (!by_intervals) return std::nullopt;
  const Mat7 covariance = *by_intervals + ground_covariance(poses, center);
  const geometry::Vec7 scale = (covariance.diagonal().array() + 1e-30).sqrt().inverse();
  Mat7 scaled = scale.asDiagonal() * covariance * scale.asDiagonal();
  scaled.diagonal().array() += 1e-9;
  return SimilarityEstimate{similarity_of(poses), center, scale.asDiagonal() * scaled.inverse() * scale.asDiagonal()};
}

using geometry::Mat3;
using geometry::SE3;
using geometry::Sim3;
using geometry::Vec3;
using geometry::Vec6;
using geometry::Vec7;
using Mat6 = Eigen::Matrix<double, 6, 6>;
using Mat67 = Eigen::Matrix<double, 6, 7>;

namespace {

/// log(T_found^-1 T path pose), in the located camera's axes.
Vec6 pose_residual(const LocatedPose& pose, const Sim3& T) {
  const SE3 carried = T * pose.T_map_camera;
  const SE3 apart = pose.T_local_camera.inverse() * carried;
  Vec6 residual;
  residual << apart.translation, geometry::so3_log(apart.rotation);
  return residual;
}

/// Derivative of the residual by a motion about `center` (similarity_estimate.h).
Mat67 pose_jacobian(const LocatedPose& pose, const Sim3& T, const Vec3& center) {
  const Mat3 to_camera = pose.T_local_camera.rotation.conjugate().toRotationMatrix();
  const Vec3 arm = T * pose.T_map_camera.translation - center;
  Mat67 jacobian = Mat67::Zero();
  jacobian.block<3, 3>(0, 0) = to_camera;
  jacobian.block<3, 3>(0, 3) = -to_camera * geometry::skew(arm);
  jacobian.block<3, 1>(0, 6) = to_camera * arm;
  jacobian.block<3, 3>(3, 3) = to_camera;
  return jacobian;
}

/// Residual in sigmas, root mean square over its six degrees of freedom.
double normalized_residual(const LocatedPose& pose, const Sim3& T) {
  const Vec6 residual = pose_residual(pose, T);
  return std::sqrt(std::max(0.0, residual.dot(pose.information * residual)) / 6.0);
}

/// Median of the normalised residuals over the poses.
double median_cost(const std::vector<LocatedPose>& poses, const Sim3& T) {
  std::vector<double> all;
  for (const LocatedPose& pose : poses) all.push_back(normalized_residual(pose, T));
  return base::upper_median(std::move(all));
}

/// Similarity with the rotation of one pose, and scale and translation of two.
Sim3 similarity_from_two_poses(const LocatedPose& a, const LocatedPose& b, double fallback_scale) {
  const Vec3 in_map = b.T_map_camera.translation - a.T_map_camera.translation;
  const Vec3 found = b.T_local_camera.translation - a.T_local_camera.translation;
  const Eigen::Quaterniond rotation = a.T_local_camera.rotation * a.T_map_camera.rotation.conjugate();
  const double scale = in_map.norm() > 0.0 && found.norm() > 0.0 ? found.norm() / in_map.norm() : fallback_scale;
  return {scale, rotation, a.T_local_camera.translation - scale * (rotation * a.T_map_camera.translation)};
}

Sim3 find_best_start(const std::vector<LocatedPose>& poses, const Sim3& start) {
  constexpr std::size_t kMost = 20;  // poses of which each pair is tried, spread over the path
  const std::size_t step = (poses.size() + kMost - 1) / kMost;
  Sim3 best = start;
  double least = median_cost(poses, start);
  for (std::size_t i = 0; i < poses.size(); i += step) {
    for (std::size_t j = 0; j < poses.size(); j += step) {
      if (i == j) continue;
      const Sim3 T = similarity_from_two_poses(poses[i], poses[j], start.scale);
      const double cost = median_cost(poses, T);
      if (cost < least) least = cost, best = T;
    }
  }
  return best;
}

constexpr double kKernel = 3.0;

struct SimilarityNormalEquations {
  Mat7 hessian = Mat7::Zero(), gradient_scatter = Mat7::Zero();
  Vec7 gradient = Vec7::Zero();
};

SimilarityNormalEquations normal_equations(const std::vector<LocatedPose>& poses, const Sim3& T, const Vec3& center,
                                           double noise) {
  SimilarityNormalEquations normal;
  for (const LocatedPose& pose : poses) {
    const double ratio = std::pow(normalized_residual(pose, T) / (kKernel * noise), 2);
    const double weight = 1.0 / ((1.0 + ratio) * (1.0 + ratio)) / (noise * noise);
    const Mat67 jacobian = pose_jacobian(pose, T, center);
    const Mat6 information = weight * pose.information;
    const Vec7 gradient = jacobian.transpose() * (information * pose_residual(pose, T));
    normal.hessian += jacobian.transpose() * information * jacobian;
    normal.gradient += gradient;
    normal.gradient_scatter += gradient * gradient.transpose();
  }
  return normal;
}

Vec7 solve_scaled(const Mat7& hessian, const Vec7& right) {
  const Vec7 scale = (hessian.diagonal().array() + 1e-30).sqrt().inverse();
  Mat7 scaled = scale.asDiagonal() * hessian * scale.asDiagonal();
  scaled.diagonal().array() += 1e-9;
  return scale.asDiagonal() * geometry::solve_symmetric(scaled, scale.asDiagonal() * right);
}

/// Information from the sum of two covariances: the one stated by the poses and the one shown by their spread.
Mat7 robust_information(const SimilarityNormalEquations& normal) {
  const Vec7 scale = (normal.hessian.diagonal().array() + 1e-30).sqrt().inverse();
  Mat7 hessian = scale.asDiagonal() * normal.hessian * scale.asDiagonal();
  hessian.diagonal().array() += 1e-9;
  const Mat7 inverse = hessian.inverse();
  const Mat7 covariance =
      inverse + inverse * (scale.asDiagonal() * normal.gradient_scatter * scale.asDiagonal()) * inverse;
  return scale.cwiseInverse().asDiagonal() * covariance.inverse() * scale.cwiseInverse().asDiagonal();
}

}  // namespace

LocatedPosesFit fit_located_poses(const std::vector<LocatedPose>& poses, const Sim3& start, double at_least_m) {
  if (poses.size() < 2) throw InputError("located poses", "at least two are needed to fit a transform");
  LocatedPosesFit fit;
  Vec3 center = Vec3::Zero();
  for (const LocatedPose& pose : poses) center += pose.T_local_camera.translation / static_cast<double>(poses.size());
  Sim3 T = find_best_start(poses, start);
  constexpr int kIterations = 50;
  constexpr double kHalf = 0.9446;  // median of the root of a chi-square of six degrees over six
  for (int k = 0; k < kIterations; ++k) {
    fit.noise = std::max(1.0, median_cost(poses, T) / kHalf);
    const SimilarityNormalEquations normal = normal_equations(poses, T, center, fit.noise);
    const Vec7 step = solve_scaled(normal.hessian, -normal.gradient);
    if (!step.allFinite()) break;
    T = apply_motion(T, step, center);
    constexpr double kStill = 1e-10;
    if (step.norm() < kStill) break;
  }
  fit.noise = std::max(1.0, median_cost(poses, T) / kHalf);
  for (const LocatedPose& pose : poses) {
    fit.deviations.push_back(normalized_residual(pose, T) / fit.noise);
    fit.distances_m.push_back((T * pose.T_map_camera.translation - pose.T_local_camera.translation).norm());
    fit.is_inlier.push_back(fit.deviations.back() < kKernel || fit.distances_m.back() < at_least_m);
    if (fit.is_inlier.back()) ++fit.inliers;
  }
  fit.estimate = {T, center, robust_information(normal_equations(poses, T, center, fit.noise))};
  return fit;
}

}  // namespace tileflight::registration
