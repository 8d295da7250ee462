#include "tileflight/evaluation/localization/path_fusion.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/order_statistics.h"

namespace tileflight::localization {
namespace {

using geometry::Mat3;
using geometry::SE3;
using geometry::Vec3;
using geometry::Vec6;
using geometry::Vec7;
using Mat6 = Eigen::Matrix<double, 6, 6>;
using Mat7 = Eigen::Matrix<double, 7, 7>;
using Mat67 = Eigen::Matrix<double, 6, 7>;

/// Unknowns of an image: its pose, and the logarithm of the scale from there on.
struct Node {
  SE3 T_local_camera;
  double log_scale = 0.0;
};

/// Normal equations of a chain: a block for each image, and one for each pair of neighbours.
struct ChainEquations {
  std::vector<Mat7> diagonal, upper;
  std::vector<Vec7> gradient;

  explicit ChainEquations(std::size_t images)
      : diagonal(images, Mat7::Zero()), upper(images - 1, Mat7::Zero()), gradient(images, Vec7::Zero()) {}

  /// Solves for the step by block elimination.
  std::vector<Vec7> solve() const {
    const std::size_t n = diagonal.size();
    std::vector<Eigen::LDLT<Mat7>> pivots;
    std::vector<Vec7> right;
    pivots.reserve(n);
    for (std::size_t i = 0; i < n; ++i) {
      Mat7 block = diagonal[i];
      Vec7 b = -gradient[i];
      if (i > 0) {
        block -= upper[i - 1].transpose() * pivots[i - 1].solve(upper[i - 1]);
        b -= upper[i - 1].transpose() * pivots[i - 1].solve(right[i - 1]);
      }
      pivots.emplace_back(block);
      right.push_back(b);
    }
    std::vector<Vec7> step(n);
    for (std::size_t i = n; i-- > 0;) {
      Vec7 b = right[i];
      if (i + 1 < n) b -= upper[i] * step[i + 1];
      step[i] = pivots[i].solve(b);
    }
    return step;
  }

  /// Returns the covariance of each image's unknowns: the diagonal blocks of the inverse.
  std::vector<Mat7> marginals() const {
    const std::size_t n = diagonal.size();
    std::vector<Mat7> forward(n), backward(n), covariances(n);
    for (std::size_t i = 0; i < n; ++i) {
      forward[i] = diagonal[i];
      if (i > 0) forward[i] -= upper[i - 1].transpose() * forward[i - 1].ldlt().solve(upper[i - 1]);
    }
    for (std::size_t i = n; i-- > 0;) {
      backward[i] = diagonal[i];
      if (i + 1 < n) backward[i] -= upper[i] * backward[i + 1].ldlt().solve(Mat7(upper[i].transpose()));
      covariances[i] = Mat7(forward[i] + backward[i] - diagonal[i]).ldlt().solve(Mat7::Identity());
    }
    return covariances;
  }
};

/// Motion of the camera from the measured pose to the estimated one, in the measured camera's axes.
Vec6 measurement_residual(const PoseMeasurement& measurement, const SE3& T_local_camera) {
  const SE3 apart = measurement.T_local_camera.inverse() * T_local_camera;
  Vec6 residual;
  residual << apart.translation, geometry::so3_log(apart.rotation);
  return residual;
}

/// Residual in sigmas, root mean square over its six parts.
double measurement_deviation(const PoseMeasurement& measurement, const Mat6& information, const SE3& T_local_camera) {
  const Vec6 residual = measurement_residual(measurement, T_local_camera);
  return std::sqrt(std::max(0.0, residual.dot(information * residual)) / 6.0);
}

class PathFusion {
 public:
  PathFusion(const std::vector<SE3>& start, const std::vector<std::optional<PathStep>>& steps,
             const std::vector<std::optional<PoseMeasurement>>& measurements, const FusionOptions& options)
      : steps_(steps), measurements_(measurements), options_(options) {
    for (const SE3& pose : start) nodes_.push_back({pose, std::log(options.scale)});
    for (const auto& measurement : measurements)
      information_.push_back(measurement ? Mat6(measurement->covariance.inverse()) : Mat6::Zero());
  }

  FusedPath solve() {
    constexpr int kIterations = 40;
    constexpr double kWidest = 64.0, kStill = 1e-9;
    double widening = kWidest;
    for (int k = 0; k < kIterations; ++k) {
      const double noise = observed_noise();
      const std::vector<Vec7> step = equations(noise, widening).solve();
      double largest = 0.0;
      for (std::size_t i = 0; i < nodes_.size(); ++i) largest = std::max(largest, apply(step[i], nodes_[i]));
      if (!std::isfinite(largest)) break;
      if (widening == 1.0 && largest < kStill) break;
      widening = std::max(1.0, 0.5 * widening);
    }
    return result();
  }

 private:
  /// Returns the size of the step.
  static double apply(const Vec7& step, Node& node) {
    if (!step.allFinite()) return std::numeric_limits<double>::infinity();
    const Vec3 rotation = step.segment<3>(3);
    node.T_local_camera = node.T_local_camera * SE3(geometry::so3_exp(rotation), step.head<3>());
    node.log_scale += step[6];
    return step.norm();
  }

  /// Observed over stated sigma of the measurements, by their median deviation.
  double observed_noise() const {
    constexpr double kHalf = 0.9446;  // median of the root of a chi-square of six degrees over six
    std::vector<double> deviations;
    for (std::size_t i = 0; i < nodes_.size(); ++i)
      if (measurements_[i]) deviations.push_back(deviation(i));
    return std::max(1.0, base::upper_median(std::move(deviations)) / kHalf);
  }

  double deviation(std::size_t i) const {
    return measurement_deviation(*measurements_[i], information_[i], nodes_[i].T_local_camera);
  }

  ChainEquations equations(double noise, double widening) const {
    ChainEquations chain(nodes_.size());
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      if (measurements_[i]) add_measurement(i, noise, widening, chain);
      if (i + 1 < nodes_.size()) add_step(i, chain);
      constexpr double kFaint = 1e-9;  // an image that nothing holds stays where it is
      chain.diagonal[i].diagonal().array() += kFaint;
    }
    const double sigma = std::max(1e-6, options_.sigma_log_scale);
    chain.diagonal[0](6, 6) += 1.0 / (sigma * sigma);
    chain.gradient[0][6] += (nodes_[0].log_scale - std::log(options_.scale)) / (sigma * sigma);
    return chain;
  }

  void add_measurement(std::size_t i, double noise, double widening, ChainEquations& chain) const {
    const PoseMeasurement& measurement = *measurements_[i];
    const Vec6 residual = measurement_residual(measurement, nodes_[i].T_local_camera);
    const double ratio = std::pow(deviation(i) / (options_.kernel * noise * widening), 2);
    const double weight = 1.0 / ((1.0 + ratio) * (1.0 + ratio)) / (noise * noise * measurement.shared_by);
    // By the motion in the estimated camera's axes.
    Mat6 jacobian = Mat6::Identity();
    jacobian.topLeftCorner<3, 3>() =
        (measurement.T_local_camera.rotation.conjugate() * nodes_[i].T_local_camera.rotation).toRotationMatrix();
    jacobian.bottomRightCorner<3, 3>() = geometry::so3_right_jacobian_inverse(residual.tail<3>());
    const Mat6 weighted = weight * jacobian.transpose() * information_[i];
    chain.diagonal[i].topLeftCorner<6, 6>() += weighted * jacobian;
    chain.gradient[i].head<6>() += weighted * residual;
  }

  void add_step(std::size_t i, ChainEquations& chain) const {
    const Node &from = nodes_[i], &to = nodes_[i + 1];
    const SE3 motion = from.T_local_camera.inverse() * to.T_local_camera;
    const double scale = std::exp(from.log_scale);
    // Where the odometry knows nothing, the camera may be anywhere.
    constexpr double kAnywhere_m = 1e4, kAnyhow_rad = 1e2;
    const PathStep step = steps_[i].value_or(PathStep{motion, kAnywhere_m / scale, kAnyhow_rad});
    const double sigma_m = std::max(1e-4, scale * step.sigma_translation);
    const double sigma_rad = std::max(1e-5, step.sigma_rotation_rad);
    Vec6 residual;
    residual.head<3>() = motion.translation - scale * step.T_this_next.translation;
    residual.tail<3>() = geometry::so3_log(step.T_this_next.rotation.conjugate() * motion.rotation);
    if (!steps_[i]) residual.setZero();
    const Mat3 R = motion.rotation.toRotationMatrix();
    const Mat3 by_turn = geometry::so3_right_jacobian_inverse(residual.tail<3>());
    Mat67 by_from = Mat67::Zero(), by_to = Mat67::Zero();
    by_from.block<3, 3>(0, 0) = -Mat3::Identity();
    by_from.block<3, 3>(0, 3) = geometry::skew(motion.translation);
    if (steps_[i]) by_from.block<3, 1>(0, 6) = -scale * step.T_this_next.translation;
    by_from.block<3, 3>(3, 3) = -by_turn * R.transpose();
    by_to.block<3, 3>(0, 0) = R;
    by_to.block<3, 3>(3, 3) = by_turn;
    Vec6 weights;
    weights << Vec3::Constant(1.0 / (sigma_m * sigma_m)), Vec3::Constant(1.0 / (sigma_rad * sigma_rad));
    chain.diagonal[i] += by_from.transpose() * weights.asDiagonal() * by_from;
    chain.diagonal[i + 1] += by_to.transpose() * weights.asDiagonal() * by_to;
    chain.upper[i] += by_from.transpose() * weights.asDiagonal() * by_to;
    chain.gradient[i] += by_from.transpose() * weights.asDiagonal() * residual;
    chain.gradient[i + 1] += by_to.transpose() * weights.asDiagonal() * residual;
    add_scale_walk(i, motion.translation.norm(), chain);
  }

  void add_scale_walk(std::size_t i, double metres, ChainEquations& chain) const {
    constexpr double kLeast = 1e-6;
    const double sigma =
        std::max(kLeast, options_.sigma_log_scale > 0.0 ? options_.scale_walk * std::sqrt(metres) : 0.0);
    const double weight = 1.0 / (sigma * sigma), change = nodes_[i + 1].log_scale - nodes_[i].log_scale;
    chain.diagonal[i](6, 6) += weight;
    chain.diagonal[i + 1](6, 6) += weight;
    chain.upper[i](6, 6) -= weight;
    chain.gradient[i][6] -= weight * change;
    chain.gradient[i + 1][6] += weight * change;
  }

  FusedPath result() const {
    FusedPath path{.poses = {}, .noise = observed_noise()};
    const std::vector<Mat7> covariances = equations(path.noise, 1.0).marginals();
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      FusedPose pose{.T_local_camera = nodes_[i].T_local_camera,
                     .covariance = covariances[i].topLeftCorner<6, 6>(),
                     .scale = std::exp(nodes_[i].log_scale)};
      if (measurements_[i]) {
        pose.deviation = deviation(i);
        pose.is_outlier = pose.deviation > options_.kernel * path.noise;
      }
      path.poses.push_back(pose);
    }
    return path;
  }

  const std::vector<std::optional<PathStep>>& steps_;
  const std::vector<std::optional<PoseMeasurement>>& measurements_;
  FusionOptions options_;
  std::vector<Mat6> information_;
  std::vector<Node> nodes_;
};

}  // namespace

FusedPath fuse_path(const std::vector<SE3>& start, const std::vector<std::optional<PathStep>>& steps,
                    const std::vector<std::optional<PoseMeasurement>>& measurements, const FusionOptions& options) {
  if (start.empty() || steps.size() + 1 != start.size() || measurements.size() != start.size())
    throw InputError("path", "the numbers of poses, steps and located images do not fit together");
  if (std::ranges::none_of(measurements, [](const auto& m) { return m.has_value(); }))
    throw InputError("path", "no image was located in the place");
  return PathFusion(start, steps, measurements, options).solve();
}

}  // namespace tileflight::localization
