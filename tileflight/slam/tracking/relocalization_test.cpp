#include "tileflight/slam/tracking/relocalization.h"

#include <gtest/gtest.h>

#include "tileflight/slam/keyframes/pixel_selector.h"
#include "tileflight/slam/keyframes/synthetic_scene.h"

namespace tileflight::tracking::relocalization_test {
namespace {

using geometry::SE3;
using geometry::Vec3;

constexpr int kLevels = 4;

/// Hilly ground seen through a wide lens, with keyframes whose pixels have true distances.
struct Ground {
  keyframes::OdometryOptions options;
  imaging::Camera camera = imaging::make_fisheye(320, 200, 130.0);
  keyframes::test_support::Relief relief =
      keyframes::test_support::sine_hills({.amplitude_m = 1.5, .k_x = 0.25, .k_y = 0.2}, 0.8);
  keyframes::LensPyramid lens = keyframes::build_lens_pyramid(camera, kLevels);

  keyframes::Pyramid picture(const SE3& pose) const {
    return keyframes::build_pyramid(
        keyframes::luminance(keyframes::test_support::ReliefCamera(camera, relief).render(pose), nullptr), kLevels);
  }
  TrackingReference keyframe(const SE3& pose) const {
    const keyframes::Pyramid seen = picture(pose);
    std::vector<ReferencePoint> points;
    for (const keyframes::SelectedPixel& p : keyframes::select_pixels(seen, lens.rays[0], 800, options.selection)) {
      const Vec3 ray = pose.rotation * lens.rays[0].at(p.x, p.y).cast<double>();
      const double distance = keyframes::test_support::hit_distance(relief, pose.translation, ray);
      if (distance > 0) points.push_back({Eigen::Vector2f(p.x, p.y), static_cast<float>(1.0 / distance), 1.0F});
    }
    return make_tracking_reference(lens, seen, points);
  }
};

TEST(Relocalization, FindsAPictureThatLooksAnotherWay) {
  const Ground ground;
  const SE3 here = keyframes::test_support::look_along(Vec3(0, 0, 20), Vec3(0, 1, -1)),
            there = keyframes::test_support::look_along(Vec3(60, 40, 20), Vec3(1, 0, -1));
  const SE3 lost(here.rotation * geometry::so3_exp(Vec3(0.12, 0.2, 0.0)), here.translation + Vec3(0.4, -0.3, 0.1));
  const std::vector<TrackingReference> keyframes{ground.keyframe(there), ground.keyframe(here)};
  const auto found = relocalize(ground.lens, keyframes, ground.picture(lost), 12.0, ground.options.tracking);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->keyframe, 1U);
  const SE3 error = found->alignment.state.T_target_reference * (lost.inverse() * here).inverse();
  EXPECT_LT(error.translation.norm(), 0.05);
  EXPECT_LT(geometry::so3_log(error.rotation).norm(), 3e-3);
}

/// A vehicle that turns: about the optical axis of a camera that looks down, about an oblique axis of one that looks
/// ahead and down.
TEST(Relocalization, FindsAPictureAfterATurnOfTheVehicle) {
  const Ground ground;
  for (const Vec3& direction : {Vec3(0, 0.05, -1), Vec3(0, 1, -1), Vec3(0, 1, -0.4)}) {
    const SE3 here = keyframes::test_support::look_along(Vec3(0, 0, 20), direction);
    const std::vector<TrackingReference> keyframes{ground.keyframe(here)};
    for (const double turn_rad : {-0.4, 0.25, 0.45}) {
      const SE3 lost(geometry::so3_exp(Vec3(0, 0, turn_rad)) * here.rotation, here.translation + Vec3(0.3, 0.4, 0.1));
      const auto found = relocalize(ground.lens, keyframes, ground.picture(lost), 12.0, ground.options.tracking);
      ASSERT_TRUE(found) << direction.transpose() << ", " << turn_rad;
      const SE3 error = found->alignment.state.T_target_reference * (lost.inverse() * here).inverse();
      EXPECT_LT(error.translation.norm(), 0.05) << direction.transpose() << ", " << turn_rad;
      EXPECT_LT(geometry::so3_log(error.rotation).norm(), 3e-3) << direction.transpose() << ", " << turn_rad;
    }
  }
}

TEST(Relocalization, FindsNothingInAPictureOfAnotherPlace) {
  const Ground ground;
  const SE3 here = keyframes::test_support::look_along(Vec3(0, 0, 20), Vec3(0, 1, -1)),
            away = keyframes::test_support::look_along(Vec3(90, -70, 20), Vec3(-1, 0.5, -1));
  const std::vector<TrackingReference> keyframes{ground.keyframe(here)};
  EXPECT_FALSE(relocalize(ground.lens, keyframes, ground.picture(away), 8.0, ground.options.tracking));
  EXPECT_FALSE(relocalize(ground.lens, {}, ground.picture(here), 8.0, ground.options.tracking));
}

/// An alignment to another place lets what does not fit saturate, so that its RMSE says little; here nothing else
/// refuses it.
TEST(Relocalization, APictureOfAnotherPlaceIsRefusedWhateverItsRmse) {
  const Ground ground;
  const Vec3 ahead(0, 1, -1);
  const std::vector<TrackingReference> keyframes{
      ground.keyframe(keyframes::test_support::look_along(Vec3(0, 0, 20), ahead))};
  keyframes::TrackingOptions permissive = ground.options.tracking;
  permissive.lost_rmse = 100.0;
  permissive.max_log_gain = 10.0;
  for (const Vec3& away : {Vec3(90, -70, 20), Vec3(-120, 50, 20), Vec3(200, 80, 22), Vec3(-60, -160, 18)}) {
    const keyframes::Pyramid picture = ground.picture(keyframes::test_support::look_along(away, ahead));
    EXPECT_FALSE(relocalize(ground.lens, keyframes, picture, permissive.lost_rmse, permissive)) << away.transpose();
  }
}

TEST(Correlation, IsOneForTheSamePictureInAnyLightAndSmallForAnother) {
  const Ground ground;
  const SE3 here = keyframes::test_support::look_along(Vec3(0, 0, 20), Vec3(0, 1, -1)),
            away = keyframes::test_support::look_along(Vec3(90, -70, 20), Vec3(-1, 0.5, -1));
  const TrackingReference keyframe = ground.keyframe(here);
  imaging::FloatImage darker =
      keyframes::luminance(keyframes::test_support::ReliefCamera(ground.camera, ground.relief).render(here), nullptr);
  for (float& grey : darker.pixels) grey = 0.5F * grey + 20.0F;
  const SE3 same;
  EXPECT_NEAR(correlation(ground.lens, keyframe, ground.picture(here), same), 1.0, 0.01);
  EXPECT_NEAR(correlation(ground.lens, keyframe, keyframes::build_pyramid(darker, kLevels), same), 1.0, 0.01);
  EXPECT_LT(correlation(ground.lens, keyframe, ground.picture(away), same), 0.4);
  const SE3 behind(geometry::so3_exp(Vec3(0, 3.1, 0)), Vec3::Zero());
  EXPECT_EQ(correlation(ground.lens, keyframe, ground.picture(here), behind), 0.0);
}

}  // namespace
}  // namespace tileflight::tracking::relocalization_test
