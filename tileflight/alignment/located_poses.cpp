#include "tileflight/alignment/located_poses.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "tileflight/geometry/input_error.h"

namespace tileflight::alignment {

using geometry::Mat3;
using geometry::SE3;
using geometry::Sim3;
using geometry::Vec3;
using geometry::Vec6;
using geometry::Vec7;
using Mat6 = Eigen::Matrix<double, 6, 6>;
using Mat67 = Eigen::Matrix<double, 6, 7>;

namespace {

/// log(T_found^-1 T path pose), in the found camera's axes.
Vec6 residual_of(const LocatedPose& pose, const Sim3& T) {
  const SE3 carried = T * pose.T_map_camera;
  const SE3 apart = pose.T_local_camera.inverse() * carried;
  Vec6 residual;
  residual << apart.translation, geometry::so3_log(apart.rotation);
  return residual;
}

/// Change of the residual with a motion about `center` (similarity_estimate.h), to first order.
Mat67 jacobian_of(const LocatedPose& pose, const Sim3& T, const Vec3& center) {
  const Mat3 to_camera = pose.T_local_camera.rotation.conjugate().toRotationMatrix();
  const Vec3 arm = T * pose.T_map_camera.translation - center;
  Mat67 jacobian = Mat67::Zero();
  jacobian.block<3, 3>(0, 0) = to_camera;
  jacobian.block<3, 3>(0, 3) = -to_camera * geometry::skew(arm);
  jacobian.block<3, 1>(0, 6) = to_camera * arm;
  jacobian.block<3, 3>(3, 3) = to_camera;
  return jacobian;
}

double median(std::vector<double> values) {
  const auto half = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), half, values.end());
  return *half;
}

/// Root of the residual's square in sigmas over its six degrees of freedom.
double normalized(const LocatedPose& pose, const Sim3& T) {
  const Vec6 residual = residual_of(pose, T);
  return std::sqrt(std::max(0.0, residual.dot(pose.information * residual)) / 6.0);
}

/// Median over the poses: what half of them agree on.
double cost_of(const std::vector<LocatedPose>& poses, const Sim3& T) {
  std::vector<double> all;
  for (const LocatedPose& pose : poses) all.push_back(normalized(pose, T));
  return median(std::move(all));
}

/// Rotation of one pose, scale and place of two.
Sim3 through_two(const LocatedPose& a, const LocatedPose& b, double fallback_scale) {
  const Vec3 in_map = b.T_map_camera.translation - a.T_map_camera.translation;
  const Vec3 found = b.T_local_camera.translation - a.T_local_camera.translation;
  const Eigen::Quaterniond rotation = a.T_local_camera.rotation * a.T_map_camera.rotation.conjugate();
  const double scale = in_map.norm() > 0.0 && found.norm() > 0.0 ? found.norm() / in_map.norm() : fallback_scale;
  return {scale, rotation, a.T_local_camera.translation - scale * (rotation * a.T_map_camera.translation)};
}

Sim3 best_start(const std::vector<LocatedPose>& poses, const Sim3& start) {
  Sim3 best = start;
  double least = cost_of(poses, start);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    for (std::size_t j = 0; j < poses.size(); ++j) {
      if (i == j) continue;
      const Sim3 T = through_two(poses[i], poses[j], start.scale);
      const double cost = cost_of(poses, T);
      if (cost < least) least = cost, best = T;
    }
  }
  return best;
}

constexpr double kKernel = 3.0;

struct Normal {
  Mat7 hessian = Mat7::Zero(), middle = Mat7::Zero();
  Vec7 gradient = Vec7::Zero();
};

Normal normal_equations(const std::vector<LocatedPose>& poses, const Sim3& T, const Vec3& center, double noise) {
  Normal normal;
  for (const LocatedPose& pose : poses) {
    const double ratio = std::pow(normalized(pose, T) / (kKernel * noise), 2);
    const double weight = 1.0 / ((1.0 + ratio) * (1.0 + ratio)) / (noise * noise);
    const Mat67 jacobian = jacobian_of(pose, T, center);
    const Mat6 information = weight * pose.information;
    const Vec7 gradient = jacobian.transpose() * (information * residual_of(pose, T));
    normal.hessian += jacobian.transpose() * information * jacobian;
    normal.gradient += gradient;
    normal.middle += gradient * gradient.transpose();
  }
  return normal;
}

Vec7 solved(const Mat7& hessian, const Vec7& right) {
  const Vec7 scale = (hessian.diagonal().array() + 1e-30).sqrt().inverse();
  Mat7 scaled = scale.asDiagonal() * hessian * scale.asDiagonal();
  scaled.diagonal().array() += 1e-9;
  return scale.asDiagonal() * scaled.ldlt().solve(scale.asDiagonal() * right);
}

/// The larger of what the poses' own information says and what their spread shows, direction by direction: as a sum of
/// covariances.
Mat7 information_of(const Normal& normal) {
  const Vec7 scale = (normal.hessian.diagonal().array() + 1e-30).sqrt().inverse();
  Mat7 hessian = scale.asDiagonal() * normal.hessian * scale.asDiagonal();
  hessian.diagonal().array() += 1e-9;
  const Mat7 inverse = hessian.inverse();
  const Mat7 covariance = inverse + inverse * (scale.asDiagonal() * normal.middle * scale.asDiagonal()) * inverse;
  return scale.cwiseInverse().asDiagonal() * covariance.inverse() * scale.cwiseInverse().asDiagonal();
}

}  // namespace

LocatedPosesFit fit_located_poses(const std::vector<LocatedPose>& poses, const Sim3& start, double at_least_m) {
  if (poses.size() < 2) throw InputError("located poses", "are fewer than two; there is nothing to fit");
  LocatedPosesFit fit;
  Vec3 center = Vec3::Zero();
  for (const LocatedPose& pose : poses) center += pose.T_local_camera.translation / static_cast<double>(poses.size());
  Sim3 T = best_start(poses, start);
  constexpr int kIterations = 50;
  constexpr double kHalf = 0.9446;  // median of the root of a chi-square of six degrees over six
  for (int k = 0; k < kIterations; ++k) {
    fit.noise = std::max(1.0, cost_of(poses, T) / kHalf);
    const Normal normal = normal_equations(poses, T, center, fit.noise);
    const Vec7 step = solved(normal.hessian, -normal.gradient);
    if (!step.allFinite()) break;
    T = moved_by(T, step, center);
    constexpr double kStill = 1e-10;
    if (step.norm() < kStill) break;
  }
  fit.noise = std::max(1.0, cost_of(poses, T) / kHalf);
  for (const LocatedPose& pose : poses) {
    fit.deviations.push_back(normalized(pose, T) / fit.noise);
    fit.distances_m.push_back((T * pose.T_map_camera.translation - pose.T_local_camera.translation).norm());
    fit.agrees.push_back(fit.deviations.back() < kKernel || fit.distances_m.back() < at_least_m);
    if (fit.agrees.back()) ++fit.agreeing;
  }
  fit.estimate = {T, center, information_of(normal_equations(poses, T, center, fit.noise))};
  return fit;
}

}  // namespace tileflight::alignment
