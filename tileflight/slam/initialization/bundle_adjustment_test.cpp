// Tracks of known points by cameras whose poses and focal lengths are known.

#include "tileflight/slam/initialization/bundle_adjustment.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace tileflight::initialization {
namespace {

using geometry::SE3;
using geometry::Vec2;
using geometry::Vec3;

constexpr int kImages = 5;
constexpr double kNoise_px = 0.1;

const keyframes::Lens& lens() {
  static const keyframes::Lens kLens(imaging::Camera(imaging::PinholeRadtan{400, 400, 320, 180, {}}, 640, 360));
  return kLens;
}

struct Example {
  std::vector<CornerTrack> tracks;
  std::vector<SE3> T_camera_first;
};

/// `step`: of the camera between two images, metres. The logarithm of the focal length grows by `log_step` an image.
Example make_example(std::uint32_t seed, const Vec3& step, double log_step) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> across(-0.6, 0.6), depth(8.0, 24.0);
  std::normal_distribution<double> noise(0.0, kNoise_px);
  Example example;
  for (int k = 1; k <= kImages; ++k)
    example.T_camera_first.emplace_back(geometry::so3_exp(0.004 * k * Vec3(1, -0.5, 0.7)), k * step);
  for (int i = 0; i < 150; ++i) {
    const Vec3 direction = Vec3(across(random), 0.6 * across(random), 1.0);
    const Vec3 point = depth(random) * direction;
    CornerTrack track{point.normalized(), {}};
    for (int k = 1; k <= kImages; ++k) {
      const Vec3 in_camera = example.T_camera_first[static_cast<std::size_t>(k - 1)] * point;
      const double focal_px = 400 * std::exp(log_step * k);
      track.pixels.emplace_back(Vec2(320 + focal_px * in_camera.x() / in_camera.z() + noise(random),
                                     180 + focal_px * in_camera.y() / in_camera.z() + noise(random)));
    }
    example.tracks.push_back(std::move(track));
  }
  return example;
}

std::optional<FocalChangeFit> fit(const Example& example) {
  SE3 T_last_first = example.T_camera_first.back();
  T_last_first.translation.normalize();
  const auto bundle = bundle_adjust(lens(), example.tracks, kImages, T_last_first, 30);
  return fit_focal_change(lens(), example.tracks, bundle, 30);
}

TEST(FitFocalChange, ErrorsAreAsLargeAsStated) {
  double squares = 0.0;
  int count = 0;
  for (const double log_step : {0.0, 0.02, -0.03}) {
    for (std::uint32_t seed = 1; seed <= 10; ++seed) {
      const auto found = fit(make_example(seed, Vec3(-0.5, 0.2, 0.1), log_step));
      ASSERT_TRUE(found.has_value());
      EXPECT_NEAR(found->median_residual_px, 1.1774 * kNoise_px, 0.03);
      for (int k = 1; k <= kImages; ++k) {
        const auto image = static_cast<std::size_t>(k - 1);
        EXPECT_LT(found->sigma[image], 0.005);
        const double error = (found->log_change[image] - log_step * k) / found->sigma[image];
        squares += error * error;
        ++count;
      }
    }
  }
  const double rms = std::sqrt(squares / count);
  EXPECT_GT(rms, 0.6);
  EXPECT_LT(rms, 1.6);
}

TEST(FitFocalChange, WhereOnlyParallaxTellsItFromAMotionAheadSigmaIsLarger) {
  const auto aside = fit(make_example(1, Vec3(-0.5, 0.2, 0.0), 0.0));
  const auto ahead = fit(make_example(1, Vec3(0.0, 0.0, -0.2), 0.0));
  ASSERT_TRUE(aside && ahead);
  EXPECT_GT(ahead->sigma.back(), 5.0 * aside->sigma.back());
}

}  // namespace
}  // namespace tileflight::initialization
