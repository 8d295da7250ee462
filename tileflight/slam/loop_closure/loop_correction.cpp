#include "tileflight/slam/loop_closure/loop_correction.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tileflight/core/base/order_statistics.h"
#include "tileflight/slam/loop_closure/pose_graph.h"
#include "tileflight/slam/mapping/host_target_pairs.h"

namespace tileflight::loop_closure {
namespace {

using geometry::Mat6;
using geometry::Mat7;
using geometry::SE3;
using geometry::Sim3;
using geometry::Vec7;

/// The loop with the most features to each keyframe.
std::vector<Loop> best_to_each(const std::vector<Loop>& loops) {
  std::map<int, Loop> best;
  for (const Loop& loop : loops) {
    const auto [found, is_new] = best.try_emplace(loop.to, loop);
    if (!is_new && loop.inliers > found->second.inliers) found->second = loop;
  }
  std::vector<Loop> out;
  for (const auto& [to, loop] : best) out.push_back(loop);
  return out;
}

/// Difference between path and loop, and what it may be by the path's and by the loop's errors alone.
struct Contradiction {
  Eigen::VectorXd off;
  Eigen::MatrixXd path_covariance, loop_covariance;

  double squared_sigmas(double path_factor) const {
    return off.dot(geometry::solve_symmetric(path_factor * path_covariance + loop_covariance, off));
  }
};

/// Median of a chi-squared distribution (Wilson and Hilferty 1931).
double chi_squared_median(double degrees) { return degrees * std::pow(1.0 - 2.0 / (9.0 * degrees), 3); }

/// Squared contradictions over their variance if the path's covariances are multiplied by a factor, of the median
/// contradiction: 1 if that is the right factor.
double median_ratio(const std::vector<Contradiction>& contradictions, double path_factor) {
  std::vector<double> ratios;
  for (const Contradiction& one : contradictions)
    ratios.push_back(one.squared_sigmas(path_factor) / chi_squared_median(static_cast<double>(one.off.size())));
  return base::upper_median(std::move(ratios));
}

/// median_ratio() of the loops' own errors alone, over what it is by chance at most, two standard deviations above 1: a
/// median of n values with density p there has the deviation 1 / (2 p sqrt(n)), here as of a normal distribution.
double significance(const std::vector<Contradiction>& contradictions) {
  const auto degrees = static_cast<double>(contradictions.front().off.size());
  const double spread = std::sqrt(0.5 * std::numbers::pi) * std::sqrt(2.0 * degrees) / chi_squared_median(degrees) /
                        std::sqrt(static_cast<double>(contradictions.size()));
  return median_ratio(contradictions, 0.0) / (1.0 + 2.0 * spread);
}

/// The factor with which median_ratio() is 1, at least 1.
double explaining_factor(const std::vector<Contradiction>& contradictions) {
  constexpr double kLargest = 1e8;
  constexpr int kHalvings = 40;
  double low = 1.0, high = kLargest;
  if (median_ratio(contradictions, low) <= 1.0) return low;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = std::sqrt(low * high);
    (median_ratio(contradictions, middle) > 1.0 ? low : high) = middle;
  }
  return high;
}

std::vector<PoseGraphEdge> make_edges(const std::vector<LoopKeyframe>& keyframes,
                                      const std::vector<MeasuredLoop>& loops, const LoopConsistency& consistency) {
  std::vector<PoseGraphEdge> edges;
  for (int k = 1; k < static_cast<int>(keyframes.size()); ++k) {
    const SE3 step = keyframes[k - 1].T_map_camera.inverse() * keyframes[k].T_map_camera;
    const Mat7 root = root_information(consistency.path_variance_factor * keyframes[k].step_covariance,
                                       consistency.scale_variance_factor * keyframes[k].step_log_scale_variance);
    edges.push_back({k - 1, k, Sim3(step), root, false});
  }
  const double factor = consistency.loop_variance_factor;
  for (const auto& [loop, measured] : loops) {
    const AlignedPose &a_b = measured.a_b, &b_a = measured.b_a;
    edges.push_back({loop.from, loop.to, Sim3(std::exp(measured.log_scale), a_b.T_a_b.rotation, a_b.T_a_b.translation),
                     root_information(factor * a_b.covariance, factor * measured.log_scale_variance), true});
    edges.push_back({loop.to, loop.from, Sim3(b_a.T_a_b), root_information(factor * b_a.covariance, HUGE_VAL), true});
  }
  return edges;
}

}  // namespace

std::vector<MeasuredLoop> measure_loops(const keyframes::LensPyramid& lens,
                                        const std::vector<mapping::MapPoint>& points,
                                        const std::vector<LoopKeyframe>& keyframes, const std::vector<Loop>& loops) {
  std::map<int, std::vector<const mapping::MapPoint*>> hosted;
  for (const mapping::MapPoint& point : points) hosted[point.keyframe].push_back(&point);
  const std::vector<Loop> chosen = best_to_each(loops);
  std::vector<std::optional<LoopAlignment>> found(chosen.size());
  tbb::parallel_for(std::size_t{0}, chosen.size(), [&](std::size_t i) {
    const auto side = [&](int k) {
      const auto of_keyframe = hosted.find(keyframes[k].id);
      return AlignedKeyframe{&keyframes[k].image, of_keyframe == hosted.end() ? std::vector<const mapping::MapPoint*>()
                                                                              : of_keyframe->second};
    };
    found[i] = align_loop(lens, side(chosen[i].from), side(chosen[i].to), chosen[i].T_from_to);
  });
  std::vector<MeasuredLoop> out;
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    if (found[i]) out.push_back({chosen[i], *found[i]});
  }
  return out;
}

Mat7 path_covariance(const std::vector<LoopKeyframe>& keyframes, int from, int to) {
  Mat7 sum = Mat7::Zero();
  const SE3 T_to_map = keyframes[to].T_map_camera.inverse();
  for (int k = from + 1; k <= to; ++k) {
    const SE3 T_to_k = T_to_map * keyframes[k].T_map_camera;
    const Mat6 carried = mapping::adjoint(T_to_k);
    sum.topLeftCorner<6, 6>() += carried * keyframes[k].step_covariance * carried.transpose();
    // Another scale from here on stretches the rest of the way.
    Vec7 stretch = Vec7::Zero();
    stretch.head<3>() = -T_to_k.translation;
    stretch[6] = 1.0;
    sum += keyframes[k].step_log_scale_variance * stretch * stretch.transpose();
  }
  return sum;
}

LoopConsistency measure_consistency(const std::vector<LoopKeyframe>& keyframes,
                                    const std::vector<MeasuredLoop>& loops) {
  LoopConsistency out;
  if (loops.empty()) return out;
  std::vector<double> disagreements;
  for (const MeasuredLoop& loop : loops) disagreements.push_back(6.0 * disagreement(loop.alignment));
  out.loop_variance_factor = std::max(1.0, base::upper_median(std::move(disagreements)) / chi_squared_median(6.0));
  std::vector<Contradiction> poses, scales;
  for (const auto& [loop, measured] : loops) {
    const Mat7 by_path = path_covariance(keyframes, loop.from, loop.to);
    const SE3 path = keyframes[loop.from].T_map_camera.inverse() * keyframes[loop.to].T_map_camera;
    const double factor = out.loop_variance_factor;
    poses.push_back(
        {(measured.a_b.T_a_b.inverse() * path).log(), by_path.topLeftCorner<6, 6>(), factor * measured.a_b.covariance});
    scales.push_back({Eigen::VectorXd::Constant(1, measured.log_scale), by_path.bottomRightCorner<1, 1>(),
                      Eigen::MatrixXd::Constant(1, 1, factor * measured.log_scale_variance)});
  }
  out.contradiction = std::max(significance(poses), significance(scales));
  out.path_variance_factor = explaining_factor(poses);
  out.scale_variance_factor = explaining_factor(scales);
  return out;
}

std::optional<std::vector<Sim3>> correct_poses(const std::vector<LoopKeyframe>& keyframes,
                                               const std::vector<MeasuredLoop>& loops) {
  // Twice the variance, since the loops' own is known to about that. Chosen by hand.
  constexpr double kMostConsistent = 2.0;
  const LoopConsistency consistency = measure_consistency(keyframes, loops);
  if (consistency.contradiction < kMostConsistent) return std::nullopt;
  std::vector<Sim3> poses;
  for (const LoopKeyframe& keyframe : keyframes) poses.emplace_back(keyframe.T_map_camera);
  return optimize_pose_graph(poses, make_edges(keyframes, loops, consistency)).T_map_node;
}

void rescale_points(const std::map<int, double>& scale, std::vector<mapping::MapPoint>& points) {
  for (mapping::MapPoint& point : points) {
    const auto found = scale.find(point.keyframe);
    if (found == scale.end()) continue;
    const auto factor = static_cast<float>(1.0 / found->second);
    point.rho *= factor;
    point.rho_variance *= factor * factor;
  }
}

}  // namespace tileflight::loop_closure
