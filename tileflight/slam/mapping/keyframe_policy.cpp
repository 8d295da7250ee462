#include "tileflight/slam/mapping/keyframe_policy.h"

#include <algorithm>
#include <cmath>

#include "tileflight/slam/mapping/marginalization.h"

namespace tileflight::mapping {
namespace {

/// Number of points hosted by the keyframe that project into the newest keyframe.
int count_visible_points(const keyframes::Keyframe& keyframe, const keyframes::Lens& lens,
                         const keyframes::PairTransform& T, const keyframes::PyramidLevel& newest) {
  const auto shows = [&](const keyframes::Patch& patch, float rho) {
    Eigen::Vector2f pixel;
    return lens.project<float>(T.R * patch.ray + rho * T.t, pixel) && newest.inside(pixel.x(), pixel.y(), 4.0F);
  };
  int count = 0;
  for (const keyframes::ActivePoint& point : keyframe.points) count += shows(point.patch, point.rho);
  for (const keyframes::ImmaturePoint& point : keyframe.immature)
    count += point.has_depth() && shows(point.patch, point.rho());
  return count;
}

/// The keyframe with the largest distance score (DSO, eq. 20), without the two newest; -1 if none.
int max_distance_score(const keyframes::Window& window) {
  constexpr double kEpsilon = 1e-5;  // of DSO's implementation; "a small constant" in the paper
  constexpr int kNewestKept = 2;     // as in the paper
  const int n = window.size();
  std::vector<geometry::Vec3> centers;
  for (const keyframes::Keyframe& keyframe : window.keyframes)
    centers.push_back(keyframe.T_camera_map().inverse().translation);
  int worst = -1;
  double worst_score = -1;
  for (int i = 0; i < n - kNewestKept; ++i) {
    double crowding = 0;
    for (int j = 0; j < n - kNewestKept; ++j) {
      if (j != i) crowding += 1.0 / (kEpsilon + (centers[i] - centers[j]).norm());
    }
    const double score = std::sqrt((centers[i] - centers[n - 1]).norm()) * crowding;
    if (score > worst_score) worst = i, worst_score = score;
  }
  return worst;
}

/// Whether a point is no longer useful: it left the newest keyframe's view or is occluded there.
bool is_out_of_view(const keyframes::ActivePoint& point) {
  if (point.recent_states[0] == keyframes::ResidualState::kOutside) return true;
  return point.recent_states[0] == keyframes::ResidualState::kOutlier &&
         point.recent_states[1] == keyframes::ResidualState::kOutlier;
}

/// Whether a point has enough good residuals to be marginalised into the prior.
bool is_well_observed(const keyframes::ActivePoint& point, const keyframes::WindowOptions& options) {
  // The value of DSO's implementation.
  constexpr float kMinInformation = 50.0F;
  const std::size_t residuals = point.observations.size() + point.stereo_observations.size();
  return static_cast<int>(residuals) >= options.min_residuals && point.good_observations >= options.min_observations &&
         point.information > kMinInformation;
}

}  // namespace

bool needs_keyframe(const TrackingChange& change, int width, int height, const keyframes::WindowOptions& options) {
  // DSO's implementation uses this factor.
  constexpr double kRmseGrowth = 2.0;
  const double size = options.keyframe_flow_share * (width + height);
  // DSO, section 3.1, step 2; the weight 0.5 of the full flow is that of the authors' implementation.
  const double score = change.flow.translation_px / size + 0.5 * change.flow.full_px / size +
                       std::abs(change.log_brightness) / options.keyframe_log_brightness;
  return score > 1.0 || change.rmse > kRmseGrowth * change.first_rmse;
}

void flag_for_marginalization(keyframes::Window& window, const keyframes::Lens& lens,
                              const keyframes::WindowOptions& options) {
  constexpr int kNewestKept = 2;
  const int newest = window.size() - 1;
  const keyframes::Keyframe& last = window.keyframes[newest];
  int left = window.size();
  for (int i = 0; i <= newest - kNewestKept; ++i) {
    keyframes::Keyframe& keyframe = window.keyframes[i];
    if (left <= options.min_keyframes) break;
    const keyframes::PairTransform T = keyframes::pair_transform(
        last.T_camera_map() * keyframe.T_camera_map().inverse(), keyframe.brightness(), last.brightness());
    const double total = static_cast<double>(std::max<std::int64_t>(keyframe.activated_points, 1)) +
                         static_cast<double>(keyframe.immature.size());
    const bool out_of_sight =
        count_visible_points(keyframe, lens, T, last.pyramid->levels[0]) < options.min_visible_share * total;
    // Limit e^0.7 as in the authors' implementation.
    const bool other_light = std::abs(std::log(T.gain)) > 0.7F;
    if (out_of_sight || other_light) {
      keyframe.to_marginalize = true;
      --left;
    }
  }
  if (left <= options.max_keyframes) return;
  const int crowded = max_distance_score(window);
  if (crowded >= 0) window.keyframes[crowded].to_marginalize = true;
}

void retire_points(keyframes::Window& window, const keyframes::WindowOptions& options,
                   std::vector<RetiredPoint>& left) {
  const int newest = window.size() - 1;
  std::vector<PointRef> to_prior;
  std::vector<std::vector<bool>> leaves(window.size());
  for (int h = 0; h <= newest; ++h) {
    const keyframes::Keyframe& host = window.keyframes[h];
    leaves[h].assign(host.points.size(), false);
    for (int i = 0; i < static_cast<int>(host.points.size()); ++i) {
      const keyframes::ActivePoint& point = host.points[i];
      const bool lost = point.observations.empty() || point.rho < 0;
      if (!lost && !host.to_marginalize && !is_out_of_view(point)) continue;
      leaves[h][i] = true;
      if (!lost && is_well_observed(point, options)) to_prior.push_back({h, i});
    }
  }
  marginalize_points(window, make_host_target_pairs(window), to_prior, options.marginal_weight);
  for (int h = 0; h <= newest; ++h) {
    std::vector<keyframes::ActivePoint>& points = window.keyframes[h].points;
    std::size_t kept = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (leaves[h][i]) {
        left.push_back({h, std::move(points[i])});
      } else {
        if (kept != i) points[kept] = std::move(points[i]);
        ++kept;
      }
    }
    points.resize(kept);
  }
}

}  // namespace tileflight::mapping
