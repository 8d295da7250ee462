#include "tileflight/core/alignment/umeyama.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>

#include "tileflight/core/alignment/point_moments.h"
#include "tileflight/core/alignment/similarity_chart.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::alignment {

using geometry::Sim3;
using geometry::Vec3;

namespace {

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
