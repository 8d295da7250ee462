#include "tileflight/slam/initialization/initializer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "tileflight/slam/keyframes/synthetic_scene.h"

namespace tileflight::initialization::initializer_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using keyframes::test_support::look_along;
using ::testing::HasSubstr;

constexpr int kLevels = 4;

/// Hilly ground 12 m below a lens of 130 degrees.
struct Ground {
  imaging::Camera camera = imaging::make_fisheye(320, 200, 130.0);
  keyframes::test_support::Relief relief =
      keyframes::test_support::sine_hills({.amplitude_m = 1.5, .k_x = 0.35, .k_y = 0.28, .phase_y = 0.5}, 0.6);
  keyframes::LensPyramid lens = keyframes::build_lens_pyramid(camera, kLevels);

  std::shared_ptr<const keyframes::Pyramid> picture(const SE3& T_local_camera) const {
    return std::make_shared<const keyframes::Pyramid>(keyframes::build_pyramid(
        keyframes::luminance(keyframes::test_support::ReliefCamera(camera, relief).render(T_local_camera), nullptr),
        kLevels));
  }
};

const Ground& ground() {
  static const Ground kGround;
  return kGround;
}

/// T_local_camera of a flight sideways and forwards, image by image.
SE3 flown(int i) {
  return look_along(Vec3(0.15 * i, 0.1 * i, 12.0 + 0.02 * i), Vec3(0.004 * i, 1.0, -0.9 + 0.002 * i));
}

using Pose = std::function<SE3(int)>;

/// Adds images until there is an initialization, `most` at most.
std::optional<InitializationResult> initialize(Initializer& initializer, const Pose& pose, int most,
                                               bool with_poses = false) {
  for (int i = 0; i < most; ++i) {
    auto result = initializer.add(ground().picture(pose(i)), with_poses ? std::optional(pose(i)) : std::nullopt);
    if (result) return result;
  }
  return std::nullopt;
}

/// Compares poses and inverse distances with those of `pose`, up to the scale.
void expect_truth(const InitializationResult& result, const Pose& pose) {
  const auto first = static_cast<int>(result.first_frame);
  ASSERT_EQ(result.T_camera_first.size(), result.parallax_rad.size());
  ASSERT_GE(result.T_camera_first.size(), 3U);
  EXPECT_TRUE(result.T_camera_first.front().matrix().isIdentity());
  const auto true_motion = [&](std::size_t k) { return pose(first + static_cast<int>(k)).inverse() * pose(first); };
  const double scale = true_motion(result.T_camera_first.size() - 1).translation.norm() /
                       result.T_camera_first.back().translation.norm();
  for (std::size_t k = 1; k < result.T_camera_first.size(); ++k) {
    const SE3 truth = true_motion(k);
    const double baseline = true_motion(result.T_camera_first.size() - 1).translation.norm();
    EXPECT_LT((scale * result.T_camera_first[k].translation - truth.translation).norm(), 0.03 * baseline) << k;
    EXPECT_LT(geometry::so3_log(result.T_camera_first[k].rotation.conjugate() * truth.rotation).norm(), 3e-3) << k;
  }
  ASSERT_EQ(result.pixels.size(), result.rho.size());
  ASSERT_GT(result.pixels.size(), 100U);
  std::vector<double> errors;
  for (std::size_t i = 0; i < result.pixels.size(); ++i) {
    const Vec3 ray = pose(first).rotation * *ground().camera.unproject(result.pixels[i].cast<double>());
    const double distance_m = keyframes::test_support::hit_distance(ground().relief, pose(first).translation, ray);
    if (distance_m > 0.0) errors.push_back(std::abs(result.rho[i] / scale * distance_m - 1.0));
  }
  std::nth_element(errors.begin(), errors.begin() + errors.size() / 2, errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.03);
  std::vector<float> rho = result.rho;
  std::nth_element(rho.begin(), rho.begin() + rho.size() / 2, rho.end());
  EXPECT_NEAR(rho[rho.size() / 2], 1.0, 0.1) << "the scale of the result";
}

TEST(Initializer, FindsTheTrueMotionAndDistances) {
  Initializer initializer(ground().lens, {});
  const auto result = initialize(initializer, flown, 40);
  ASSERT_TRUE(result) << initializer.failure_reason();
  EXPECT_EQ(result->first_frame, 0U);
  EXPECT_GE(result->parallax_rad.back(), keyframes::InitializationOptions().min_parallax_rad);
  EXPECT_EQ(initializer.parallax_rad(), result->parallax_rad.back());
  EXPECT_LT(result->median_residual_px, 0.3);
  expect_truth(*result, flown);
}

TEST(Initializer, StartsAgainAfterImagesInWhichNothingIsTracked) {
  Initializer initializer(ground().lens, {});
  for (int i = 0; i < 4; ++i) EXPECT_FALSE(initializer.add(ground().picture(flown(i))));
  const auto black = std::make_shared<const keyframes::Pyramid>(
      keyframes::build_pyramid(imaging::FloatImage(320, 200, 0.0F), kLevels));
  EXPECT_FALSE(initializer.add(black));
  EXPECT_EQ(initializer.first_frame(), 4U);
  std::optional<InitializationResult> result;
  for (int i = 5; i < 45 && !result; ++i) result = initializer.add(ground().picture(flown(i)));
  ASSERT_TRUE(result) << initializer.failure_reason();
  EXPECT_EQ(result->first_frame, 5U) << "the first image after the black one";
  expect_truth(*result, flown);
}

/// The picture with all but its last columns black.
std::shared_ptr<const keyframes::Pyramid> mostly_black(const SE3& T_local_camera) {
  const Ground& g = ground();
  imaging::RgbImage image = keyframes::test_support::ReliefCamera(g.camera, g.relief).render(T_local_camera);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width * 78 / 100; ++x) image(x, y) = {};
  }
  return std::make_shared<const keyframes::Pyramid>(
      keyframes::build_pyramid(keyframes::luminance(image, nullptr), kLevels));
}

/// Most corners are lost at the first step, as by fast motion; those that are left are followed on and suffice.
TEST(Initializer, StartsWithTheFewCornersThatAreFollowedFromTheFirstStepOn) {
  Initializer initializer(ground().lens, {});
  EXPECT_FALSE(initializer.add(ground().picture(flown(0))));
  std::optional<InitializationResult> result;
  for (int i = 1; i < 40 && !result; ++i) result = initializer.add(mostly_black(flown(i)));
  ASSERT_TRUE(result) << initializer.failure_reason();
  EXPECT_EQ(result->first_frame, 0U);
}

TEST(Initializer, SaysThatCornersWereLost) {
  Initializer initializer(ground().lens, {});
  EXPECT_FALSE(initialize(
      initializer, [](int i) { return look_along(Vec3(0, 0, 12), Vec3(0.9 * i, 1.0, -0.9)); }, 6));
  EXPECT_THAT(initializer.failure_reason(), HasSubstr("rays moved by at most 0."));
  EXPECT_THAT(initializer.failure_reason(), HasSubstr("corners were lost"));
}

TEST(Initializer, WaitsWhileTheCameraOnlyTurns) {
  Initializer initializer(ground().lens, {});
  EXPECT_FALSE(initialize(
      initializer, [](int i) { return look_along(Vec3(0, 0, 12), Vec3(0.01 * i, 1.0, -0.9)); }, 25));
  EXPECT_THAT(initializer.failure_reason(), HasSubstr("no parallax: the camera turns, by 13.4 degrees"));
}

/// Parallax of a motion at right angles to the view is about the angle at the ground.
TEST(Initializer, ParallaxIsThatOfTheRays) {
  Initializer initializer(ground().lens, {.min_parallax_rad = 1.0, .fallback_parallax_rad = 1.0});
  initialize(initializer, flown, 8);
  const double baseline_m = (flown(7).translation - flown(0).translation).norm();
  EXPECT_GT(initializer.parallax_rad(), 0.2 * baseline_m / 12.0);
  EXPECT_LT(initializer.parallax_rad(), baseline_m / 10.0);
}

TEST(Initializer, TakesTheMotionOfKnownPoses) {
  Initializer initializer(ground().lens, {});
  const auto result = initialize(initializer, flown, 40, true);
  ASSERT_TRUE(result) << initializer.failure_reason();
  EXPECT_EQ(result->cost_ratio, 0.0) << "no second motion is tried";
  expect_truth(*result, flown);
}

}  // namespace
}  // namespace tileflight::initialization::initializer_test
