#include "tileflight/slam/mapping/activation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "tileflight/slam/mapping/test_rendered_window.h"

namespace tileflight::mapping::activation_test {
namespace {

using keyframes::ImmaturePoint;
using Status = ImmaturePoint::Status;
using test_support::RenderedFlight;

constexpr int kKeyframes = 4;

const RenderedFlight& flight() {
  static const RenderedFlight kFlight;
  return kFlight;
}

/// Window at the true poses, without points; its images are rendered once.
keyframes::Window empty_window() {
  static const keyframes::Window kWindow = test_support::make_true_window(flight(), kKeyframes);
  return kWindow;
}

/// A traced point whose interval of the inverse distance is `share` of it to either side of `offset` times the truth.
ImmaturePoint traced_point(int host, const keyframes::Patch& patch, float offset = 1.0F, float share = 0.1F) {
  ImmaturePoint point;
  point.patch = patch;
  const float rho = offset * flight().rho(2 * host, patch.ray);
  point.rho_min = (1.0F - share) * rho;
  point.rho_max = (1.0F + share) * rho;
  point.quality = 10.0F;
  point.interval_px = 2.0F;
  point.status = Status::kGood;
  return point;
}

/// Immature points of true inverse distance in all keyframes but the newest.
keyframes::Window window_with_immature_points(int each) {
  keyframes::Window window = empty_window();
  for (int h = 0; h < kKeyframes - 1; ++h) {
    for (const keyframes::Patch& patch : flight().patches(2 * h, *window.keyframes[h].pyramid, each))
      window.keyframes[h].immature.push_back(traced_point(h, patch));
  }
  return window;
}

using Pixel = std::array<float, 2>;
Pixel pixel_of(const keyframes::Patch& patch) { return {patch.pixel.x(), patch.pixel.y()}; }

/// Energy of a patch of keyframe `host` in all other keyframes, truncated as in the window.
double energy_of(const keyframes::Window& window, int host, const keyframes::Patch& patch, float rho) {
  const std::vector<keyframes::PairTransform> pairs = pair_transforms_from(window, host);
  double energy = 0.0;
  for (int t = 0; t < kKeyframes; ++t) {
    if (t == host) continue;
    energy += std::min(keyframes::evaluate_rho(flight().lens.lenses[0], window.keyframes[t].pyramid->levels[0], patch,
                                               rho, pairs[t], flight().options.window.huber)
                           .energy,
                       window.keyframes[t].energy_threshold);
  }
  return energy;
}

TEST(TryActivation, FindsTheInverseDistanceOfTheSmallestEnergyNearTheTrueOne) {
  const keyframes::Window window = empty_window();
  std::vector<double> errors;
  int smallest = 0;
  for (const keyframes::Patch& patch : flight().patches(2, *window.keyframes[1].pyramid, 300)) {
    const float truth = flight().rho(2, patch.ray);
    double least = std::numeric_limits<double>::infinity();
    for (float factor = 0.94F; factor < 1.06F; factor += 0.001F)
      least = std::min(least, energy_of(window, 1, patch, factor * truth));
    for (const float offset : {0.97F, 1.03F}) {
      const auto active = try_activation(window, flight().lens.lenses[0], 1, traced_point(1, patch, offset),
                                         flight().options.window, kKeyframes - 1);
      if (!active) continue;
      smallest += energy_of(window, 1, patch, active->rho) < 1.05 * least;
      errors.push_back(std::abs(active->rho / truth - 1.0));
      EXPECT_EQ(active->observations.size(), kKeyframes - 1U);
      for (const keyframes::Observation& o : active->observations) EXPECT_NE(o.target, 1);
      EXPECT_GT(active->information, 0.0F);
      EXPECT_EQ(active->first_frame, 2);
    }
  }
  ASSERT_GT(errors.size(), 300U);
  EXPECT_GT(smallest, 0.8 * static_cast<double>(errors.size()));
  std::nth_element(errors.begin(), errors.begin() + errors.size() / 2, errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.008);
}

TEST(TryActivation, RefusesAPatchThatIsNowhereInTheOtherImages) {
  const keyframes::Window window = empty_window();
  keyframes::Patch patch = flight().patches(2, *window.keyframes[1].pyramid, 100).front();
  patch.intensity = {0, 255, 0, 255, 0, 255, 0, 255};
  EXPECT_FALSE(try_activation(window, flight().lens.lenses[0], 1, traced_point(1, patch), flight().options.window, 1));
}

/// Pixels of the immature points that are far enough (city block, on level 1 of the newest image) from all earlier
/// ones, which are `taken`.
std::set<Pixel> spaced_by_brute_force(const keyframes::Keyframe& keyframe, int host, double spacing,
                                      std::vector<Eigen::Vector2i>& taken) {
  std::set<Pixel> chosen;
  for (const ImmaturePoint& point : keyframe.immature) {
    const geometry::SE3 T =
        RenderedFlight::T_camera_map(2 * kKeyframes - 2) * RenderedFlight::T_camera_map(2 * host).inverse();
    const geometry::Vec3 X = T * (point.patch.ray.cast<double>() / point.rho());
    const auto pixel = flight().camera.project(X);
    if (!pixel || (pixel->array() < 0).any() || pixel->x() >= 320 || pixel->y() >= 240) continue;
    const Eigen::Vector2i here = (0.5 * *pixel).array().floor().cast<int>();
    const bool apart = std::ranges::all_of(taken, [&](const Eigen::Vector2i& other) {
      return (here - other).cwiseAbs().sum() >= spacing * (1.0 + 0.5 * point.scale);
    });
    if (!apart) continue;
    taken.push_back(here);
    chosen.insert(pixel_of(point.patch));
  }
  return chosen;
}

TEST(ActivatePoints, TakesThosePointsThatAreFarEnoughFromTheOthers) {
  keyframes::Window window = window_with_immature_points(700);
  for (keyframes::Keyframe& keyframe : window.keyframes) {
    for (std::size_t i = 0; i < keyframe.immature.size(); i += 3) keyframe.immature[i].scale = static_cast<int>(i) % 2;
  }
  const keyframes::Window before = window;
  ActivationSpacing spacing{.pixels = 5.3};
  const int activated = activate_points(window, flight().lens.lenses[0], flight().options, spacing);
  EXPECT_DOUBLE_EQ(spacing.pixels, 5.3 - 0.8 - 0.5) << "there were no active points at all";

  std::vector<Eigen::Vector2i> taken;
  std::size_t active = 0, chosen_count = 0;
  for (int h = 0; h < kKeyframes - 1; ++h) {
    const std::set<Pixel> chosen = spaced_by_brute_force(before.keyframes[h], h, spacing.pixels, taken);
    chosen_count += chosen.size();
    const keyframes::Keyframe& host = window.keyframes[h];
    for (const keyframes::ActivePoint& point : host.points) EXPECT_TRUE(chosen.contains(pixel_of(point.patch)));
    for (const ImmaturePoint& point : host.immature) EXPECT_FALSE(chosen.contains(pixel_of(point.patch)));
    EXPECT_EQ(host.immature.size() + host.out_of_view.size() + chosen.size(), before.keyframes[h].immature.size());
    EXPECT_EQ(host.activated_points, static_cast<std::int64_t>(host.points.size()));
    active += host.points.size();
  }
  EXPECT_EQ(activated, static_cast<int>(active));
  EXPECT_GT(chosen_count, 300U);
  EXPECT_LT(chosen_count, 1500U) << "some are too near to others";
  EXPECT_GT(active, chosen_count * 8 / 10) << "the images fit";
  EXPECT_TRUE(window.keyframes.back().points.empty());
}

TEST(ActivatePoints, LeavesOutPointsWithoutADepthAndRemovesUselessOnes) {
  keyframes::Window window = empty_window();
  keyframes::Keyframe& host = window.keyframes[1];
  // The middle of the image is seen by all keyframes.
  std::vector<keyframes::Patch> patches = flight().patches(2, *host.pyramid, 500);
  std::erase_if(patches, [](const keyframes::Patch& p) {
    return (p.pixel - Eigen::Vector2f(160, 140)).cwiseAbs().maxCoeff() > 50.0F;
  });
  ASSERT_GT(patches.size(), 9U);
  std::vector<ImmaturePoint>& immature = host.immature;
  for (int i = 0; i < 9; ++i) immature.push_back(traced_point(1, patches[i]));
  immature[0].rho_max = std::numeric_limits<float>::quiet_NaN();
  immature[1].interval_px = 8.5F;
  immature[2].quality = 2.5F;
  immature[3].failed_searches = 1;
  immature[4].status = Status::kOutlier;
  immature[5].status = Status::kUntraced;
  immature[6].rho_max *= 4.0F;  // the interval is wider than the distance itself
  immature[7].failed_searches = 2;
  immature[8].status = Status::kOutside;  // the last search failed, an earlier one did not
  // An active point gives the window's median inverse distance.
  keyframes::ActivePoint other;
  other.patch = patches[9];
  other.rho = flight().rho(2, patches[9].ray);
  host.points.push_back(other);
  ActivationSpacing spacing{.pixels = 0.0};
  EXPECT_EQ(activate_points(window, flight().lens.lenses[0], flight().options, spacing), 1);
  EXPECT_EQ(spacing.pixels, 0.0) << "never negative";
  std::set<Pixel> kept;
  for (const ImmaturePoint& point : immature) kept.insert(pixel_of(point.patch));
  for (int i = 0; i <= 6; ++i) EXPECT_TRUE(kept.contains(pixel_of(patches[i]))) << i;
  EXPECT_EQ(kept.size(), 7U);
  ASSERT_EQ(host.points.size(), 2U);
  EXPECT_EQ(pixel_of(host.points[1].patch), pixel_of(patches[8]));
}

TEST(ActivatePoints, PutsPointsOutOfTheNewestImageAside) {
  keyframes::Window window = empty_window();
  const keyframes::Patch patch = flight().patches(0, *window.keyframes[0].pyramid, 100).front();
  window.keyframes[0].immature = {traced_point(0, patch)};
  keyframes::Keyframe& newest = window.keyframes.back();
  newest.T_camera_map_linear =
      geometry::SE3(geometry::so3_exp(geometry::Vec3(0, 3.0, 0)), geometry::Vec3::Zero()) * newest.T_camera_map_linear;
  ActivationSpacing spacing;
  EXPECT_EQ(activate_points(window, flight().lens.lenses[0], flight().options, spacing), 0);
  EXPECT_TRUE(window.keyframes[0].immature.empty());
  ASSERT_EQ(window.keyframes[0].out_of_view.size(), 1U);
  EXPECT_EQ(pixel_of(window.keyframes[0].out_of_view[0].patch), pixel_of(patch));
}

TEST(ActivatePoints, AdaptsTheSpacingToTheNumberOfPoints) {
  keyframes::OdometryOptions options = flight().options;
  options.window.active_points = 100;
  keyframes::ActivePoint point;
  point.patch = flight().patches(0, *empty_window().keyframes[0].pyramid, 100).front();
  point.rho = 0.05F;
  for (const auto& [have, change] : std::vector<std::pair<int, double>>{{50, -1.3},
                                                                        {70, -0.5},
                                                                        {85, -0.2},
                                                                        {95, -0.1},
                                                                        {100, 0.0},
                                                                        {110, 0.1},
                                                                        {120, 0.3},
                                                                        {140, 0.8},
                                                                        {160, 1.6}}) {
    keyframes::Window window = empty_window();
    window.keyframes[0].points.assign(have, point);
    ActivationSpacing spacing{.pixels = 4.0};
    activate_points(window, flight().lens.lenses[0], options, spacing);
    EXPECT_NEAR(spacing.pixels, 4.0 + change, 1e-12) << have;
  }
}

}  // namespace
}  // namespace tileflight::mapping::activation_test
