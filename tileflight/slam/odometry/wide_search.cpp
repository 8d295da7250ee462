#include "tileflight/slam/odometry/wide_search.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/base/order_statistics.h"
#include "tileflight/slam/initialization/bundle_adjustment.h"
#include "tileflight/slam/initialization/two_view.h"
#include "tileflight/slam/loop_closure/loop_alignment.h"

namespace tileflight::odometry {
namespace {

using geometry::SE3;
using geometry::Vec3;

constexpr double kLargestError_px = 6.0;  ///< of a match that fits; chosen by hand
constexpr std::size_t kFewestMatches = 20;

/// The pose that fits the matches, by robust Gauss-Newton from the best rotation.
SE3 pose_from(const keyframes::Lens& lens, const std::vector<initialization::CornerTrack>& tracks,
              const std::vector<double>& rho) {
  std::vector<initialization::RayPair> pairs;
  for (const initialization::CornerTrack& track : tracks) {
    if (const auto ray = lens.unproject(*track.pixels[0])) pairs.push_back({track.ray, *ray});
  }
  return initialization::resect(lens, tracks, rho, 0, SE3(initialization::fit_rotation(pairs).R_b_a, Vec3::Zero()));
}

}  // namespace

keyframes::OdometryOptions options_for_images_far_apart(keyframes::OdometryOptions options) {
  options.tracing.max_search_share = 0.15;
  options.tracing.max_steps = 600;
  options.window.min_residuals = 2;
  options.window.min_observations = 2;
  options.map.min_observations = std::min(options.map.min_observations, 2);
  return options;
}

bool WideSearch::shows_anything() const { return features_.size() >= kFewestMatches; }

std::optional<WidePose> WideSearch::find(const keyframes::Pyramid& picture,
                                         const tracking::TrackingReference& reference) {
  constexpr float kRadius_px = 16.0F;  // within which the pixels around a feature tell its distance; at most a cell
  const keyframes::Lens& lens = lens_.lenses[0];
  matches_.clear();
  motion_px_ = 0.0;
  if (!shows_anything()) return std::nullopt;
  const auto features = keyframes::find_features(picture, lens_, keyframes::kManyFeatures);
  const auto found = keyframes::consistent_matches(features, features_, keyframes::match_features(features, features_));
  loop_closure::PixelGrid grid;
  for (std::size_t i = 0; i < reference.levels[0].size(); ++i)
    grid.add({reference.levels[0].pixels[i], reference.levels[0].rho[i]});
  std::vector<initialization::CornerTrack> tracks;
  std::vector<double> rho, motions_px;
  for (const keyframes::FeatureMatch& match : found) {
    const keyframes::Feature &here = features[match.a], &there = features_[match.b];
    motions_px.push_back((here.pixel - there.pixel).norm());
    std::vector<float> around = grid.rho_within(here.pixel, kRadius_px);
    if (around.empty()) continue;
    matches_.push_back({here.ray.cast<double>(), base::upper_median(std::move(around)), here.pixel.cast<double>(),
                        there.pixel.cast<double>()});
    tracks.push_back({matches_.back().ray, {matches_.back().pixel}});
    rho.push_back(matches_.back().rho);
  }
  if (motions_px.size() >= kFewestMatches) motion_px_ = base::upper_median(motions_px);
  if (matches_.size() < kFewestMatches) return std::nullopt;
  WidePose pose{.T_target_reference = pose_from(lens, tracks, rho)};
  const std::vector<double> errors = errors_px(pose.T_target_reference);
  pose.motion_px = motion_px_;
  pose.matches = static_cast<int>(std::ranges::count_if(errors, [](double e) { return e < kLargestError_px; }));
  if (pose.matches < static_cast<int>(kFewestMatches) || 2 * pose.matches < static_cast<int>(matches_.size()))
    return std::nullopt;
  return pose;
}

std::vector<double> WideSearch::errors_px(const SE3& T_target_reference) const {
  std::vector<double> errors;
  for (const Match& match : matches_) {
    geometry::Vec2 pixel;
    const Vec3 X = T_target_reference.rotation * match.ray + match.rho * T_target_reference.translation;
    errors.push_back(lens_.lenses[0].project<double>(X, pixel) ? (pixel - match.pixel).norm() : HUGE_VAL);
  }
  return errors;
}

bool WideSearch::supports(const SE3& T_target_reference) const {
  return !matches_.empty() && base::upper_median(errors_px(T_target_reference)) < kLargestError_px;
}

}  // namespace tileflight::odometry
