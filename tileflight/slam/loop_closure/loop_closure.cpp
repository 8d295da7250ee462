#include "tileflight/slam/loop_closure/loop_closure.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "tileflight/slam/loop_closure/loop_alignment.h"

namespace tileflight::loop_closure {
namespace {

using geometry::SE3;
using geometry::Sim3;
using geometry::Vec3;

// ---- distances ----

/// The median if the values agree, else 0 (a depth discontinuity).
float median_if_consistent(std::vector<float> rho) {
  // Largest ratio of the 80th to the 20th percentile. Chosen by hand.
  constexpr float kMostSpread = 1.2F;
  if (rho.empty()) return 0.0F;
  std::sort(rho.begin(), rho.end());
  const float low = rho[rho.size() / 5], high = rho[rho.size() - 1 - rho.size() / 5];
  return high <= kMostSpread * low ? rho[rho.size() / 2] : 0.0F;
}

// ---- detection ----

double median_distance(const LoopKeyframe& keyframe) {
  std::vector<double> distances;
  for (const Feature& feature : keyframe.features) {
    if (feature.rho > 0) distances.push_back(1.0 / feature.rho);
  }
  if (distances.empty()) return 1.0;
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return *middle;
}

std::vector<double> path_lengths(const std::vector<LoopKeyframe>& keyframes) {
  std::vector<double> lengths{0.0};
  for (std::size_t i = 1; i < keyframes.size(); ++i) {
    const Vec3 step = keyframes[i].T_map_camera.translation - keyframes[i - 1].T_map_camera.translation;
    lengths.push_back(lengths.back() + step.norm());
  }
  return lengths;
}

/// Correction of the map around `to` according to the loop.
Sim3 correction(const std::vector<LoopKeyframe>& keyframes, const Loop& loop) {
  return Sim3(keyframes[loop.from].T_map_camera) * loop.T_from_to * Sim3(keyframes[loop.to].T_map_camera).inverse();
}

/// Whether drift over the path between both keyframes can explain the correction.
bool is_explained_by_drift(const std::vector<LoopKeyframe>& keyframes, const std::vector<double>& path,
                           const Loop& loop, const keyframes::LoopOptions& options) {
  const Sim3 C = correction(keyframes, loop);
  const Vec3& place = keyframes[loop.to].T_map_camera.translation;
  const double length = path[loop.to] - path[loop.from];
  return (C * place - place).norm() < options.max_drift_share * length &&
         std::abs(std::log(C.scale)) < options.max_log_scale &&
         geometry::so3_log(C.rotation).norm() < options.max_rotation_rad;
}

/// Whether both loops correct the map in the same way.
bool is_consistent(const std::vector<LoopKeyframe>& keyframes, const Loop& a, const Loop& b, double distance) {
  constexpr double kTurn_rad = 0.04, kLogScale = 0.08, kShift = 0.08;  // shift: share of the scene's distance; all
                                                                       // three chosen by hand
  const Sim3 A = correction(keyframes, a), B = correction(keyframes, b);
  const Vec3 place = 0.5 * (keyframes[a.to].T_map_camera.translation + keyframes[b.to].T_map_camera.translation);
  return geometry::so3_log(A.rotation.conjugate() * B.rotation).norm() < kTurn_rad &&
         std::abs(std::log(A.scale / B.scale)) < kLogScale && (A * place - B * place).norm() < kShift * distance;
}

/// Best loop of one keyframe with earlier ones; empty if too few features are consistent.
std::vector<Loop> detect_loops_to(int to, const std::vector<LoopKeyframe>& keyframes, const FeatureIndex& index,
                                  const keyframes::LoopOptions& options) {
  std::vector<Loop> loops;
  const std::vector<Feature>& features = keyframes[to].features;
  for (const auto& candidate : index.candidates(features, to - options.min_gap_keyframes + 1, options.candidates)) {
    const std::vector<Feature>& others = keyframes[candidate.keyframe].features;
    const std::vector<FeatureMatch> matches = match_features(others, features);
    const auto similarity = find_similarity(others, features, matches, {});
    if (!similarity || similarity->spread_rad < options.min_spread_rad) continue;
    const int inliers = static_cast<int>(similarity->inliers.size());
    if (inliers < options.min_inliers) continue;
    loops.push_back({candidate.keyframe, to, similarity->T_a_b, inliers});
  }
  return loops;
}

/// Loops confirmed by enough loops of neighbouring keyframes.
std::vector<Loop> keep_supported(const std::vector<LoopKeyframe>& keyframes, const std::vector<Loop>& loops,
                                 const keyframes::LoopOptions& options) {
  std::vector<Loop> out;
  for (const Loop& loop : loops) {
    const double distance = median_distance(keyframes[loop.to]);
    std::vector<int> supporters;
    for (const Loop& other : loops) {
      const bool neighbour = other.to != loop.to && std::abs(other.to - loop.to) <= options.neighbours &&
                             std::abs(other.from - loop.from) <= 3 * options.neighbours;
      if (neighbour && is_consistent(keyframes, loop, other, distance)) supporters.push_back(other.to);
    }
    std::sort(supporters.begin(), supporters.end());
    const auto different = std::unique(supporters.begin(), supporters.end()) - supporters.begin();
    if (different >= options.min_supporters) out.push_back(loop);
  }
  return out;
}

}  // namespace

void assign_feature_depths(const keyframes::Lens& lens, const std::vector<mapping::MapPoint>& points,
                           std::vector<LoopKeyframe>& keyframes) {
  constexpr int kHosts = 3;  // keyframes before and after whose points are used
  // Chosen by hand.
  constexpr float kRadius_px = 5.0F;
  std::map<int, std::vector<const mapping::MapPoint*>> hosted;
  for (const mapping::MapPoint& point : points) {
    if (point.rho > 0) hosted[point.keyframe].push_back(&point);
  }
  const int count = static_cast<int>(keyframes.size());
  tbb::parallel_for(0, count, [&](int k) {
    PixelGrid grid;
    for (int h = std::max(0, k - kHosts); h <= std::min(count - 1, k + kHosts); ++h) {
      const auto found = hosted.find(keyframes[h].id);
      if (found == hosted.end()) continue;
      const SE3 T = keyframes[k].T_map_camera.inverse() * keyframes[h].T_map_camera;
      for (const mapping::MapPoint* point : found->second) {
        const Vec3 X = T.rotation * point->ray.cast<double>() + static_cast<double>(point->rho) * T.translation;
        Eigen::Vector2f pixel;
        if (lens.project<float>(X.cast<float>(), pixel)) grid.add({pixel, static_cast<float>(point->rho / X.norm())});
      }
    }
    for (Feature& feature : keyframes[k].features)
      feature.rho = median_if_consistent(
          grid.rho_within(feature.pixel, std::min(PixelGrid::kCell_px, kRadius_px * feature.size_px)));
  });
}

std::vector<Loop> find_loops(const std::vector<LoopKeyframe>& keyframes, const keyframes::LoopOptions& options) {
  FeatureIndex index;
  for (std::size_t i = 0; i < keyframes.size(); ++i) index.add(static_cast<int>(i), keyframes[i].features);
  std::vector<std::vector<Loop>> of_keyframe(keyframes.size());
  tbb::parallel_for(0, static_cast<int>(keyframes.size()),
                    [&](int to) { of_keyframe[to] = detect_loops_to(to, keyframes, index, options); });
  const std::vector<double> path = path_lengths(keyframes);
  std::vector<Loop> loops;
  for (const std::vector<Loop>& some : of_keyframe) {
    for (const Loop& loop : some) {
      if (is_explained_by_drift(keyframes, path, loop, options)) loops.push_back(loop);
    }
  }
  return keep_supported(keyframes, loops, options);
}

}  // namespace tileflight::loop_closure
