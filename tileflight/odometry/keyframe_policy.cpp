#include "tileflight/odometry/keyframe_policy.h"

#include <algorithm>
#include <cmath>

#include "tileflight/odometry/marginalization.h"

namespace tileflight::odometry {
namespace {

/// Points that the keyframe hosts and the newest keyframe still shows.
int visible_points(const Keyframe& keyframe, const Lens& lens, const PairTransform& T, const PyramidLevel& newest) {
  const auto shows = [&](const Patch& patch, float rho) {
    Eigen::Vector2f pixel;
    return lens.project<float>(T.R * patch.ray + rho * T.t, pixel) && newest.inside(pixel.x(), pixel.y(), 4.0F);
  };
  int count = 0;
  for (const ActivePoint& point : keyframe.points) count += shows(point.patch, point.rho);
  for (const ImmaturePoint& point : keyframe.immature) count += point.has_depth() && shows(point.patch, point.rho());
  return count;
}

/// The keyframe with the largest distance score among those that may go (eq. 20); -1 if none.
int most_crowded(const Window& window) {
  constexpr double kEpsilon = 1e-5;
  constexpr int kNewestKept = 2;
  const int n = window.size();
  std::vector<geometry::Vec3> centers;
  for (const Keyframe& keyframe : window.keyframes) centers.push_back(keyframe.T_camera_map().inverse().translation);
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

/// Whether a point says nothing new any more: it left the newest keyframe's view or is occluded there.
bool is_out(const ActivePoint& point) {
  if (point.recent[0] == ResidualState::kOutside) return true;
  return point.recent[0] == ResidualState::kOutlier && point.recent[1] == ResidualState::kOutlier;
}

/// Whether a point has enough good residuals to be worth keeping in the prior.
bool is_well_observed(const ActivePoint& point) {
  constexpr float kMinInformation = 50.0F;
  constexpr int kMinResiduals = 3;
  constexpr int kMinObservations = 4;
  return static_cast<int>(point.observations.size()) >= kMinResiduals && point.good_observations >= kMinObservations &&
         point.information > kMinInformation;
}

}  // namespace

bool needs_keyframe(const TrackingChange& change, int width, int height, const WindowOptions& options) {
  constexpr double kRmseGrowth = 2.0;
  const double size = options.keyframe_shift * (width + height);
  const double score = change.flow.translation_px / size + 0.5 * change.flow.full_px / size +
                       std::abs(change.log_brightness) / options.keyframe_light;
  return score > 1.0 || change.rmse > kRmseGrowth * change.first_rmse;
}

void mark_keyframes(Window& window, const Lens& lens, const WindowOptions& options) {
  constexpr int kNewestKept = 2;
  const int newest = window.size() - 1;
  const Keyframe& last = window.keyframes[newest];
  int left = window.size();
  for (int i = 0; i <= newest - kNewestKept; ++i) {
    Keyframe& keyframe = window.keyframes[i];
    if (left <= options.min_keyframes) break;
    const PairTransform T =
        pair_transform(last.T_camera_map() * keyframe.T_camera_map().inverse(), keyframe.light(), last.light());
    const double total =
        static_cast<double>(std::max<std::int64_t>(keyframe.hosted, 1)) + static_cast<double>(keyframe.immature.size());
    const bool out_of_sight =
        visible_points(keyframe, lens, T, last.pyramid->levels[0]) < options.min_points_left_share * total;
    const bool other_light = std::abs(std::log(T.gain)) > 0.7F;
    if (out_of_sight || other_light) {
      keyframe.to_marginalize = true;
      --left;
    }
  }
  if (left <= options.max_keyframes) return;
  const int crowded = most_crowded(window);
  if (crowded >= 0) window.keyframes[crowded].to_marginalize = true;
}

void retire_points(Window& window, const WindowOptions& options, std::vector<LeftPoint>& left) {
  const int newest = window.size() - 1;
  std::vector<PointRef> to_prior;
  std::vector<std::vector<bool>> leaves(window.size());
  for (int h = 0; h <= newest; ++h) {
    const Keyframe& host = window.keyframes[h];
    leaves[h].assign(host.points.size(), false);
    for (int i = 0; i < static_cast<int>(host.points.size()); ++i) {
      const ActivePoint& point = host.points[i];
      const bool lost = point.observations.empty() || point.rho < 0;
      if (!lost && !host.to_marginalize && !is_out(point)) continue;
      leaves[h][i] = true;
      if (!lost && is_well_observed(point)) to_prior.push_back({h, i});
    }
  }
  marginalize_points(window, make_pairs(window), to_prior, options.marginal_weight);
  for (int h = 0; h <= newest; ++h) {
    std::vector<ActivePoint>& points = window.keyframes[h].points;
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

}  // namespace tileflight::odometry
