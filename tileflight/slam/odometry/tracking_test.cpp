// Components that read images, each on rendered ground with known truth: pixel selection, corner tracks, alignment,
// epipolar search.

#include <gtest/gtest.h>

#include <algorithm>

#include "tileflight/slam/initialization/klt.h"
#include "tileflight/slam/keyframes/pixel_selector.h"
#include "tileflight/slam/keyframes/synthetic_scene.h"
#include "tileflight/slam/mapping/distance_map.h"
#include "tileflight/slam/mapping/tracer.h"
#include "tileflight/slam/tracking/tracker.h"

namespace tileflight::odometry::tracking_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using keyframes::test_support::Relief;

/// Two views of rolling ground through a wide lens, with the true distances of the first.
struct TwoViews {
  keyframes::OdometryOptions options;
  imaging::Camera camera = imaging::make_fisheye(320, 240, 140.0);
  Relief relief = keyframes::test_support::sine_hills({.amplitude_m = 2.0, .k_x = 0.15, .k_y = 0.12}, 0.7);
  SE3 first = keyframes::test_support::look_along(Vec3(0, 0, 20), Vec3(0, 1, -0.9));
  SE3 second = SE3(geometry::so3_exp(Vec3(0.01, 0.02, -0.02)), Vec3::Zero()) *
               keyframes::test_support::look_along(Vec3(0.7, 0.5, 20.2), Vec3(0.02, 1, -0.9));
  keyframes::LensPyramid lens = keyframes::build_lens_pyramid(camera, 4);
  keyframes::Pyramid a, b;

  TwoViews() {
    const keyframes::test_support::ReliefCamera scene(camera, relief);
    a = keyframes::build_pyramid(keyframes::luminance(scene.render(first), nullptr), 4);
    b = keyframes::build_pyramid(keyframes::luminance(scene.render(second), nullptr), 4);
  }
  SE3 T_second_first() const { return second.inverse() * first; }
  /// True inverse distance of a pixel of the first view; 0: sky.
  double rho(const Eigen::Vector2f& pixel) const {
    const Vec3 ray = *camera.unproject(pixel.cast<double>());
    const double distance = keyframes::test_support::hit_distance(relief, first.translation, first.rotation * ray);
    return distance > 0 ? 1.0 / distance : 0.0;
  }
  Eigen::Vector2f in_second(const Eigen::Vector2f& pixel) const {
    const SE3 T = T_second_first();
    const Vec3 X = T.rotation * *camera.unproject(pixel.cast<double>()) + rho(pixel) * T.translation;
    return camera.project(X)->cast<float>();
  }
};

const TwoViews& views() {
  static const TwoViews kViews;
  return kViews;
}

TEST(PixelSelector, GivesTheWantedCountEvenlyAndInsideTheBorder) {
  for (const int wanted : {200, 800}) {
    const auto pixels = keyframes::select_pixels(views().a, views().lens.rays[0], wanted, views().options.selection);
    EXPECT_LE(static_cast<int>(pixels.size()), wanted);
    EXPECT_GE(static_cast<int>(pixels.size()), wanted * 7 / 10);
    std::array<int, 2> halves{};
    for (const keyframes::SelectedPixel& p : pixels) {
      ++halves[p.x < 160];
      EXPECT_TRUE(p.x >= 6 && p.y >= 6 && p.x < 314 && p.y < 234);
    }
    EXPECT_LT(std::abs(halves[0] - halves[1]), static_cast<int>(pixels.size()) / 3);
  }
}

TEST(PixelSelector, FindsNothingInAPlainPicture) {
  const keyframes::Pyramid plain = keyframes::build_pyramid(imaging::FloatImage(320, 240, 128.0F), 4);
  EXPECT_TRUE(keyframes::select_pixels(plain, views().lens.rays[0], 500, views().options.selection).empty());
}

TEST(DistanceMap, IsTheBruteForceOne) {
  mapping::DistanceMap map(40, 30, 12);
  const std::vector<std::pair<int, int>> points{{3, 4}, {20, 15}, {39, 29}, {21, 18}, {-5, 3}};
  for (const auto& [x, y] : points) map.add(x, y);
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 40; ++x) {
      int nearest = 12;
      for (const auto& [px, py] : points) {
        if (px >= 0) nearest = std::min(nearest, std::abs(px - x) + std::abs(py - y));
      }
      EXPECT_EQ(map.at(x, y), nearest);
    }
  }
}

TEST(Klt, FollowsCornersToAFewHundredthsOfAPixelInTheMedian) {
  const auto corners = initialization::find_corners(views().a, views().lens.rays[0], 300);
  ASSERT_GT(corners.size(), 100U);
  const auto tracked = initialization::track_corners(views().a, views().b, corners);
  std::vector<float> errors;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    if (tracked[i] && views().rho(corners[i]) > 0)
      errors.push_back((*tracked[i] - views().in_second(corners[i])).norm());
  }
  ASSERT_GT(errors.size(), corners.size() / 2);
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.1F);
  EXPECT_LT(errors[errors.size() * 9 / 10], 0.6F);
}

TEST(Klt, DoesNotMindGainAndOffset) {
  imaging::FloatImage brighter(320, 240);
  for (int y = 0; y < 240; ++y) {
    for (int x = 0; x < 320; ++x) brighter(x, y) = 1.3F * views().a.levels[0].at(x, y)[keyframes::kIntensity] - 12.0F;
  }
  const auto corners = initialization::find_corners(views().a, views().lens.rays[0], 200);
  const auto tracked = initialization::track_corners(views().a, keyframes::build_pyramid(brighter, 4), corners);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    ASSERT_TRUE(tracked[i]);
    EXPECT_LT((*tracked[i] - corners[i]).norm(), 0.02F);
  }
}

std::vector<tracking::ReferencePoint> true_points() {
  std::vector<tracking::ReferencePoint> points;
  for (const keyframes::SelectedPixel& p :
       keyframes::select_pixels(views().a, views().lens.rays[0], 800, views().options.selection)) {
    const Eigen::Vector2f pixel(p.x, p.y);
    if (views().rho(pixel) > 0) points.push_back({pixel, static_cast<float>(views().rho(pixel)), 1.0F});
  }
  return points;
}

TEST(Tracker, FindsTheTruePoseAndLightFromAPerturbedStart) {
  const tracking::TrackingReference reference =
      tracking::make_tracking_reference(views().lens, views().a, true_points());
  const tracking::ImageAlignmentState start{SE3(geometry::so3_exp(Vec3(0.02, -0.02, 0.01)), Vec3(0.1, 0.1, -0.1)), 0.0,
                                            0.0};
  const tracking::ImageAlignment result =
      tracking::align_image(views().lens, reference, views().b, start, views().options.tracking);
  EXPECT_TRUE(result.converged);
  const SE3 error = result.state.T_target_reference * views().T_second_first().inverse();
  EXPECT_LT(error.translation.norm(), 0.02);  // of 0.9 m
  EXPECT_LT(geometry::so3_log(error.rotation).norm(), 1e-3);
  // Interpolation reduces contrast, so gain and offset are slightly exchanged; a medium grey is preserved.
  EXPECT_NEAR(std::exp(result.state.a) * 125.0 + result.state.b, 125.0, 2.0);
}

TEST(Tracker, SaysWhenAPictureShowsSomethingElse) {
  const tracking::TrackingReference reference =
      tracking::make_tracking_reference(views().lens, views().a, true_points());
  const keyframes::Pyramid black = keyframes::build_pyramid(imaging::FloatImage(320, 240, 0.0F), 4);
  EXPECT_FALSE(tracking::align_image(views().lens, reference, black, {}, views().options.tracking).converged);
}

TEST(Tracer, IntervalsHoldTheTruth) {
  const keyframes::Pyramid& a = views().a;
  const keyframes::PairTransform pair = keyframes::pair_transform(views().T_second_first(), {}, {});
  std::vector<keyframes::ImmaturePoint> points;
  std::vector<double> truth;
  for (const keyframes::SelectedPixel& p :
       keyframes::select_pixels(a, views().lens.rays[0], 600, views().options.selection)) {
    const Eigen::Vector2f pixel(p.x, p.y);
    const auto patch = keyframes::make_patch(a.levels[0], views().lens.lenses[0], pixel, 50.0F);
    if (!patch || views().rho(pixel) <= 0) continue;
    keyframes::ImmaturePoint point;
    point.patch = *patch;
    points.push_back(point);
    truth.push_back(views().rho(pixel));
  }
  mapping::trace_points(views().lens.lenses[0], views().b.levels[0], pair, views().options.tracing, 9.0F, points);
  int good = 0, right = 0;
  std::vector<double> errors;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (points[i].status != keyframes::ImmaturePoint::Status::kGood ||
        points[i].quality < views().options.tracing.min_quality)
      continue;
    ++good;
    right += points[i].rho_min <= truth[i] && truth[i] <= points[i].rho_max;
    errors.push_back(std::abs(points[i].rho() / truth[i] - 1.0));
  }
  ASSERT_GT(good, 150);
  EXPECT_GT(right, 0.85 * good);
  std::nth_element(errors.begin(), errors.begin() + errors.size() / 2, errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.06);
}

}  // namespace
}  // namespace tileflight::odometry::tracking_test
