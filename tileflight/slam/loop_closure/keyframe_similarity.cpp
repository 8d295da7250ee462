#include "tileflight/slam/loop_closure/keyframe_similarity.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <random>

#include "tileflight/core/geometry/decompositions.h"

namespace tileflight::loop_closure {
namespace {

using geometry::Mat3;
using geometry::Sim3;
using geometry::Vec3;
using geometry::Vec7;
using Mat7 = Eigen::Matrix<double, 7, 7>;

/// A matched feature with known distance in both keyframes.
struct Pair {
  FeatureMatch match;
  Vec3 ray_a, ray_b;
  Vec3 point_a, point_b;
};

std::vector<Pair> pairs_with_depth(const std::vector<Feature>& a, const std::vector<Feature>& b,
                                   const std::vector<FeatureMatch>& matches) {
  std::vector<Pair> pairs;
  for (const FeatureMatch& match : matches) {
    const Feature &in_a = a[match.a], &in_b = b[match.b];
    if (!(in_a.rho > 0 && in_b.rho > 0)) continue;
    const Vec3 ray_a = in_a.ray.cast<double>(), ray_b = in_b.ray.cast<double>();
    pairs.push_back({match, ray_a, ray_b, ray_a / in_a.rho, ray_b / in_b.rho});
  }
  return pairs;
}

/// S. Umeyama, "Least-squares estimation of transformation parameters between two point patterns", 1991.
std::optional<Sim3> similarity_from_triple(const std::vector<Pair>& pairs, const std::array<std::size_t, 3>& picks) {
  Mat3 a, b;
  for (int k = 0; k < 3; ++k) {
    a.col(k) = pairs[picks[k]].point_a;
    b.col(k) = pairs[picks[k]].point_b;
  }
  const Eigen::Matrix4d T = Eigen::umeyama(b, a, true);
  const double scale = T.topLeftCorner<3, 1>().norm();
  if (!T.allFinite() || !(scale > 1e-6)) return std::nullopt;
  return Sim3(scale, Eigen::Quaterniond(Mat3(T.topLeftCorner<3, 3>() / scale)), T.topRightCorner<3, 1>());
}

bool is_inlier(const Vec3& moved, const Vec3& ray, const Vec3& point, const SimilarityOptions& options) {
  const double distance = moved.norm();
  return moved.dot(ray) > std::cos(options.max_angle_rad) * distance &&
         std::abs(std::log(distance / point.norm())) < options.max_log_distance;
}

std::vector<Pair> find_inliers(const std::vector<Pair>& pairs, const Sim3& T_a_b, const SimilarityOptions& options) {
  const Sim3 T_b_a = T_a_b.inverse();
  std::vector<Pair> out;
  for (const Pair& pair : pairs) {
    if (is_inlier(T_a_b * pair.point_b, pair.ray_a, pair.point_a, options) &&
        is_inlier(T_b_a * pair.point_a, pair.ray_b, pair.point_b, options))
      out.push_back(pair);
  }
  return out;
}

/// Normal equations of transformed points against their matched rays and distances; `point_jacobian` is the derivative
/// of the point (3x7).
struct SimilarityNormalEquations {
  Mat7 H = Mat7::Zero();
  Vec7 b = Vec7::Zero();

  void add(const Vec3& moved, const Eigen::Matrix<double, 3, 7>& by_step, const Vec3& ray, double distance) {
    constexpr double kAngle_rad = 0.002, kLogDistance = 0.05, kHuber = 2.0;
    const double norm = moved.norm();
    const Vec3 direction = moved / norm;
    // Ray error in the tangent plane (three components) and log-distance error, over their standard deviations (chosen
    // by hand).
    const Vec3 angle = (direction - ray) / kAngle_rad;
    const double length = std::log(norm / distance) / kLogDistance;
    const Eigen::Matrix<double, 3, 7> angle_by =
        (Mat3::Identity() - direction * direction.transpose()) * by_step / (norm * kAngle_rad);
    const Eigen::Matrix<double, 1, 7> length_by = direction.transpose() * by_step / (norm * kLogDistance);
    const double size = std::sqrt(angle.squaredNorm() + length * length), weight = size < kHuber ? 1.0 : kHuber / size;
    H += weight * (angle_by.transpose() * angle_by + length_by.transpose() * length_by);
    b += weight * (angle_by.transpose() * angle + length_by.transpose() * length);
  }
};

/// Derivative of exp(step) p at step = 0: translation, rotation, logarithm of the scale.
Eigen::Matrix<double, 3, 7> point_jacobian(const Vec3& p) {
  Eigen::Matrix<double, 3, 7> out;
  out << Mat3::Identity(), -geometry::skew(p), p;
  return out;
}

Sim3 refine_similarity(const std::vector<Pair>& pairs, Sim3 T_a_b) {
  constexpr int kIterations = 6;
  for (int i = 0; i < kIterations; ++i) {
    const Sim3 T_b_a = T_a_b.inverse();
    const Mat3 turn = T_b_a.scale * T_b_a.rotation.toRotationMatrix();
    SimilarityNormalEquations normal;
    for (const Pair& pair : pairs) {
      const Vec3 in_a = T_a_b * pair.point_b;
      normal.add(in_a, point_jacobian(in_a), pair.ray_a, pair.point_a.norm());
      // The step moves a's points in the opposite direction before they are transformed to b.
      normal.add(T_b_a * pair.point_a, -turn * point_jacobian(pair.point_a), pair.ray_b, pair.point_b.norm());
    }
    normal.H.diagonal() *= 1.0 + 1e-6;
    const Vec7 step = -geometry::solve_symmetric(normal.H, normal.b);
    if (!step.allFinite()) break;
    T_a_b = Sim3(std::exp(step[6]), geometry::so3_exp(step.segment<3>(3)), step.head<3>()) * T_a_b;
    if (step.norm() < 1e-9) break;
  }
  return T_a_b;
}

std::optional<Sim3> best_of_triples(const std::vector<Pair>& pairs, const SimilarityOptions& options) {
  std::mt19937 random(1);
  std::optional<Sim3> best;
  std::size_t most = 3;
  for (int trial = 0; trial < options.trials; ++trial) {
    std::array<std::size_t, 3> picks;
    for (std::size_t& pick : picks) pick = random() % pairs.size();
    if (picks[0] == picks[1] || picks[0] == picks[2] || picks[1] == picks[2]) continue;
    const auto similarity = similarity_from_triple(pairs, picks);
    if (!similarity) continue;
    const std::size_t count = find_inliers(pairs, *similarity, options).size();
    if (count <= most) continue;
    most = count;
    best = similarity;
  }
  return best;
}

}  // namespace

std::optional<KeyframeSimilarity> find_similarity(const std::vector<Feature>& a, const std::vector<Feature>& b,
                                                  const std::vector<FeatureMatch>& matches,
                                                  const SimilarityOptions& options) {
  constexpr std::size_t kFewest = 4;
  constexpr int kRounds = 3;
  const std::vector<Pair> pairs = pairs_with_depth(a, b, matches);
  if (pairs.size() < kFewest) return std::nullopt;
  std::optional<Sim3> T_a_b = best_of_triples(pairs, options);
  if (!T_a_b) return std::nullopt;
  std::vector<Pair> inliers = find_inliers(pairs, *T_a_b, options);
  for (int round = 0; round < kRounds && inliers.size() >= kFewest; ++round) {
    T_a_b = refine_similarity(inliers, *T_a_b);
    inliers = find_inliers(pairs, *T_a_b, options);
  }
  if (inliers.size() < kFewest) return std::nullopt;
  KeyframeSimilarity out;
  out.T_a_b = *T_a_b;
  Vec3 mean = Vec3::Zero();
  for (const Pair& pair : inliers) mean += pair.ray_a;
  mean.normalize();
  double spread = 0, angles = 0;
  for (const Pair& pair : inliers) {
    out.inliers.push_back(pair.match);
    spread += (pair.ray_a - mean).squaredNorm();
    angles += ((*T_a_b * pair.point_b).normalized() - pair.ray_a).squaredNorm();
  }
  out.spread_rad = std::sqrt(spread / static_cast<double>(inliers.size()));
  out.angle_rms_rad = std::sqrt(angles / static_cast<double>(inliers.size()));
  return out;
}

}  // namespace tileflight::loop_closure
