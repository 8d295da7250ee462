#include "tileflight/evaluation/localization/localizer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tileflight/capture/render/camera_renderer.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/evaluation/localization/test_places.h"

namespace tileflight::localization::localizer_test {
namespace {

using geometry::SE3;
using geometry::Vec3;

/// A camera that flies a bend over the hills, ten images a second.
class LiveFlight : public ::testing::Test {
 protected:
  static SE3 pose_at(double t) {
    SE3 pose = render::test_scenes::looking_down(Vec3(-15.0 + 6.0 * t, 4.0 * std::sin(0.5 * t), 38.0 - t));
    pose.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(0.1 * t, Vec3::UnitZ())) * pose.rotation *
                    geometry::so3_exp(Vec3(0.15 + 0.03 * std::sin(2.0 * t), 0.0, 0.0));
    return pose;
  }
  imaging::RgbImage picture(double t) const { return renderer_.render(pose_at(t)).rgb; }
  static double error_m(const LivePose& live, double t) {
    return (live.T_local_camera.translation - pose_at(t).translation).norm();
  }
  void start_beside(double t) {
    SE3 pose = pose_at(t);
    pose.translation += Vec3(0.6, -0.4, 0.3);
    localizer_.start(pose, t);
  }

  test_places::Hills place_{3};
  imaging::Camera camera_ = imaging::make_pinhole(320, 240, 80.0);
  render::CameraRenderer renderer_{place_.scene, camera_, {}};
  Localizer localizer_{place_.scene, camera_};
};

TEST_F(LiveFlight, EveryImageIsLocated) {
  start_beside(0.0);
  for (int k = 0; k < 40; ++k) {
    const LivePose live = localizer_.add(picture(0.1 * k), 0.1 * k);
    EXPECT_TRUE(live.located) << k;
    EXPECT_LT(error_m(live, 0.1 * k), 0.05) << k;
    EXPECT_LT(live.sigma_position_m(), 0.1) << k;
  }
}

TEST_F(LiveFlight, ImagesThatShowNothingArePredictedAndTheCameraIsFoundAgain) {
  start_beside(0.0);
  const imaging::RgbImage nothing(320, 240);
  double sigma_m = 0.0;
  for (int k = 0; k < 40; ++k) {
    const bool is_blind = k >= 15 && k < 21;
    const LivePose live = localizer_.add(is_blind ? nothing : picture(0.1 * k), 0.1 * k);
    EXPECT_EQ(live.located, !is_blind) << k;
    EXPECT_TRUE(!is_blind || live.sigma_position_m() > sigma_m) << k;
    EXPECT_LT(error_m(live, 0.1 * k), is_blind ? 3.0 * live.sigma_position_m() + 0.05 : 0.05) << k;
    sigma_m = live.sigma_position_m();
  }
}

TEST_F(LiveFlight, AKnownMotionKeepsTheSigmaSmall) {
  start_beside(0.0);
  for (int k = 0; k < 10; ++k) localizer_.add(picture(0.1 * k), 0.1 * k);
  const imaging::RgbImage nothing(320, 240);
  LivePose live;
  for (int k = 10; k < 20; ++k) {
    const SE3 motion = pose_at(0.1 * (k - 1)).inverse() * pose_at(0.1 * k);
    live = localizer_.add(nothing, 0.1 * k, motion);
  }
  EXPECT_FALSE(live.located);
  EXPECT_FALSE(live.lost);
  EXPECT_LT(error_m(live, 1.9), 0.2);
}

TEST_F(LiveFlight, AnotherPlaceIsNotTakenAndTheCameraIsLost) {
  start_beside(0.0);
  const test_places::Hills elsewhere(11);
  const render::CameraRenderer other(elsewhere.scene, camera_, {});
  LivePose live;
  for (int k = 0; k < 15; ++k) {
    live = localizer_.add(other.render(pose_at(0.1 * k)).rgb, 0.1 * k);
    EXPECT_FALSE(live.located) << k;
  }
  EXPECT_TRUE(live.lost);
}

TEST_F(LiveFlight, WrongUseIsNamed) {
  EXPECT_THROW(localizer_.add(picture(0.0), 0.0), InputError);
  start_beside(0.0);
  EXPECT_THROW(localizer_.add(imaging::RgbImage(10, 10), 0.0), InputError);
  localizer_.add(picture(1.0), 1.0);
  EXPECT_THROW(localizer_.add(picture(0.5), 0.5), InputError);
}

}  // namespace
}  // namespace tileflight::localization::localizer_test
