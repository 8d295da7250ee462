#include "tileflight/core/alignment/umeyama.h"

#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>

#include "tileflight/core/alignment/similarity_chart.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/decompositions.h"

namespace tileflight::alignment {
using geometry::Mat3;
using geometry::SE3;
using geometry::Sim3;
using geometry::Vec3;

namespace {

Mat3 chordal_mean(const std::vector<SE3>& source, const std::vector<SE3>& target) {
  Mat3 sum = Mat3::Zero();
  for (std::size_t i = 0; i < source.size(); ++i)
    sum += (target[i].rotation * source[i].rotation.conjugate()).toRotationMatrix();
  const Eigen::JacobiSVD<Mat3> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = svd.matrixU().determinant() * svd.matrixV().determinant() < 0.0 ? -1.0 : 1.0;
  return svd.matrixU() * Vec3(1.0, 1.0, sign).asDiagonal() * svd.matrixV().transpose();
}

Vec3 mean_position(const std::vector<SE3>& poses) {
  Vec3 mean = Vec3::Zero();
  for (const SE3& pose : poses) mean += pose.translation / static_cast<double>(poses.size());
  return mean;
}

struct RotationFit {
  Mat3 rotation;
  double trace_ds;  ///< tr(D S) of Umeyama's equation (42)
  bool well_conditioned;
};

/// Umeyama's equations (38) to (43). A covariance of rank below two leaves the rotation about a line open.
RotationFit fit_rotation(const Mat3& covariance) {
  const Eigen::JacobiSVD<Mat3> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Vec3 d = svd.singularValues();
  const bool reflected = svd.matrixU().determinant() * svd.matrixV().determinant() < 0.0;
  const Vec3 s(1.0, 1.0, reflected ? -1.0 : 1.0);
  constexpr double kRankTolerance = 1e-10;
  const bool two_directions = d[0] > 0.0 && d[1] > kRankTolerance * d[0];
  return {svd.matrixU() * s.asDiagonal() * svd.matrixV().transpose(), d.dot(s), two_directions};
}

/// Smallest rotation that maps the single direction of a rank-one covariance.
Mat3 rotation_of_line(const Mat3& covariance) {
  const Eigen::JacobiSVD<Mat3> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  if (!(svd.singularValues()[0] > 0.0)) return Mat3::Identity();
  return geometry::rotation_between(svd.matrixV().col(0), svd.matrixU().col(0)).toRotationMatrix();
}

void check_pairs(const std::vector<Vec3>& source, const std::vector<Vec3>& target) {
  if (source.size() != target.size()) {
    throw InputError("paired points", std::to_string(source.size()) + " in the source, " +
                                          std::to_string(target.size()) +
                                          " in the target; give the same number of each");
  }
  if (source.size() < 3) {
    throw InputError("paired points",
                     "a similarity needs at least 3 pairs, there are " + std::to_string(source.size()));
  }
  for (std::size_t i = 0; i < source.size(); ++i) {
    if (!source[i].allFinite() || !target[i].allFinite()) {
      throw InputError("paired points", "pair " + std::to_string(i) + " is not finite");
    }
  }
}

Vec3 mean(const std::vector<Vec3>& points) {
  Vec3 sum = Vec3::Zero();
  for (const Vec3& p : points) sum += p;
  return sum / static_cast<double>(points.size());
}

ScaleRange any_scale(ScaleMode scale) {
  if (scale == ScaleMode::kFixed) return {1.0, 1.0};
  return {0.0, std::numeric_limits<double>::infinity()};
}

double squared_residual(const Sim3& T, const Vec3& p, const Vec3& q) { return (q - T * p).squaredNorm(); }

/// Weights of Geman and McClure's kernel, (1 + r^2 / c^2)^-2.
std::vector<double> kernel_weights(const Sim3& T, const std::vector<Vec3>& source, const std::vector<Vec3>& target,
                                   double inlier_m) {
  std::vector<double> weights(source.size());
  for (std::size_t i = 0; i < source.size(); ++i) {
    const double ratio = 1.0 + squared_residual(T, source[i], target[i]) / (inlier_m * inlier_m);
    weights[i] = 1.0 / (ratio * ratio);
  }
  return weights;
}

/// Three different indices below n. Modulo is used because std distributions differ between standard libraries.
std::array<std::size_t, 3> draw_triple(std::mt19937_64& random, std::size_t n) {
  const std::size_t a = random() % n;
  const std::size_t b = (a + 1 + random() % (n - 1)) % n;
  std::size_t c = random() % n;
  while (c == a || c == b) c = (c + 1) % n;
  return {a, b, c};
}

/// Similarity with the smallest robust cost among the sampled triples and the plain least-squares fit.
Sim3 best_of_triples(const std::vector<Vec3>& source, const std::vector<Vec3>& target, ScaleMode scale,
                     const RobustUmeyamaOptions& options) {
  std::mt19937_64 random(options.seed);
  Sim3 best = umeyama(source, target, scale).T_target_source;
  double best_cost = robust_cost_m2(best, source, target, options.inlier_m);
  for (int k = 0; k < options.samples; ++k) {
    const auto [a, b, c] = draw_triple(random, source.size());
    const UmeyamaResult fit = umeyama({source[a], source[b], source[c]}, {target[a], target[b], target[c]}, scale);
    if (!fit.well_conditioned) continue;
    const double cost = robust_cost_m2(fit.T_target_source, source, target, options.inlier_m);
    if (cost < best_cost) {
      best_cost = cost;
      best = fit.T_target_source;
    }
  }
  return best;
}

}  // namespace

Sim3 fit_poses(const std::vector<SE3>& source, const std::vector<SE3>& target) {
  if (source.empty() || source.size() != target.size())
    throw InputError("poses", "both lists must hold the same number of poses, at least one");
  const Mat3 rotation = chordal_mean(source, target);
  const Vec3 source_mean = mean_position(source), target_mean = mean_position(target);
  double product = 0.0, square = 0.0;
  for (std::size_t i = 0; i < source.size(); ++i) {
    const Vec3 p = rotation * (source[i].translation - source_mean);
    product += p.dot(target[i].translation - target_mean);
    square += p.squaredNorm();
  }
  const double scale = square > 0.0 && product > 0.0 ? product / square : 1.0;
  return {scale, Eigen::Quaterniond(rotation), target_mean - scale * (rotation * source_mean)};
}

void PointMoments::add(const Vec3& p, const Vec3& q, double w) {
  weight += w;
  source += w * p;
  target += w * q;
  target_source += (w * q) * p.transpose();
  source_squared += w * p.squaredNorm();
}

PointMoments& PointMoments::operator+=(const PointMoments& other) {
  weight += other.weight;
  source += other.source;
  target += other.target;
  target_source += other.target_source;
  source_squared += other.source_squared;
  return *this;
}

ScaleRange scale_range(ScaleMode mode, double scale, double center, double max_change) {
  if (mode == ScaleMode::kFixed) return {scale, scale};
  if (!(center > 0.0)) center = scale;
  return {center / max_change, center * max_change};
}

SimilarityFit fit_similarity(const PointMoments& m, const ScaleRange& range) {
  const Vec3 mean_source = m.source / m.weight;
  const Vec3 mean_target = m.target / m.weight;
  const Mat3 covariance = m.target_source / m.weight - mean_target * mean_source.transpose();
  const double source_variance = std::max(0.0, m.source_squared / m.weight - mean_source.squaredNorm());

  RotationFit fit = fit_rotation(covariance);
  if (!fit.well_conditioned) fit.rotation = rotation_of_line(covariance);

  const double free_scale = source_variance > 0.0 ? fit.trace_ds / source_variance : 1.0;
  const double scale = std::clamp(free_scale, range.min, range.max);
  const Vec3 translation = mean_target - scale * (fit.rotation * mean_source);
  return {{scale, Eigen::Quaterniond(fit.rotation), translation}, fit.well_conditioned};
}

UmeyamaResult umeyama(const std::vector<Vec3>& source, const std::vector<Vec3>& target, ScaleMode scale) {
  return weighted_umeyama(source, target, std::vector<double>(source.size(), 1.0), scale);
}

UmeyamaResult weighted_umeyama(const std::vector<Vec3>& source, const std::vector<Vec3>& target,
                               const std::vector<double>& weights, ScaleMode scale) {
  check_pairs(source, target);
  const Vec3 source_center = mean(source);
  const Vec3 target_center = mean(target);
  PointMoments moments;
  std::size_t inliers = 0;
  for (std::size_t i = 0; i < source.size(); ++i) {
    moments.add(source[i] - source_center, target[i] - target_center, weights[i]);
    inliers += weights[i] > 0.0;
  }
  if (!(moments.weight > 0.0)) throw InputError("paired points", "all weights are zero");

  const SimilarityFit fit = fit_similarity(moments, any_scale(scale));
  UmeyamaResult result;
  result.T_target_source = uncentered(fit.T_target_source, source_center, target_center);
  result.inliers = inliers;
  result.well_conditioned = fit.well_conditioned;
  double squares = 0.0;
  for (std::size_t i = 0; i < source.size(); ++i) {
    squares += weights[i] * squared_residual(result.T_target_source, source[i], target[i]);
  }
  result.rmse_m = std::sqrt(squares / moments.weight);
  return result;
}

double robust_cost_m2(const Sim3& T_target_source, const std::vector<Vec3>& source, const std::vector<Vec3>& target,
                      double inlier_m) {
  double sum = 0.0;
  for (std::size_t i = 0; i < source.size(); ++i) {
    const double squared = squared_residual(T_target_source, source[i], target[i]);
    sum += squared / (1.0 + squared / (inlier_m * inlier_m));
  }
  return sum / static_cast<double>(source.size());
}

UmeyamaResult robust_umeyama(const std::vector<Vec3>& source, const std::vector<Vec3>& target, ScaleMode scale,
                             const RobustUmeyamaOptions& options) {
  check_pairs(source, target);
  if (!(options.inlier_m > 0.0)) throw InputError("inlier_m", "must be above zero");

  Sim3 T = best_of_triples(source, target, scale, options);
  UmeyamaResult result;
  for (int k = 0; k < std::max(1, options.max_iterations); ++k) {
    result = weighted_umeyama(source, target, kernel_weights(T, source, target, options.inlier_m), scale);
    const double change = (result.T_target_source.matrix() - T.matrix()).norm() / (1.0 + T.matrix().norm());
    T = result.T_target_source;
    if (change < 1e-12) break;
  }

  double squares = 0.0;
  result.inliers = 0;
  for (std::size_t i = 0; i < source.size(); ++i) {
    const double squared = squared_residual(T, source[i], target[i]);
    if (squared > options.inlier_m * options.inlier_m) continue;
    squares += squared;
    ++result.inliers;
  }
  result.rmse_m = result.inliers > 0 ? std::sqrt(squares / static_cast<double>(result.inliers)) : 0.0;
  return result;
}

}  // namespace tileflight::alignment
