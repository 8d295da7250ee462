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

/// Flies the same path with an inertial unit beside the camera, whose readings are 5 ms apart.
class InertialFlight : public LiveFlight {
 protected:
  static SE3 T_imu_camera() {
    return {Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Vec3(1, -2, 1).normalized())), Vec3(0.1, -0.05, 0.2)};
  }
  static LiveOptions options() {
    LiveOptions options;
    options.imu = inertial::ImuModel{.T_imu_camera = T_imu_camera()};
    options.imu->gyroscope_bias_sigma = 0.005;
    options.imu->accelerometer_bias_sigma = 0.05;
    return options;
  }
  /// Returns the reading of a unit without errors, by differences of its poses.
  static geometry::ImuSample reading(double t) {
    constexpr double kStep_s = 1e-3;
    const auto unit = [&](double time_s) { return pose_at(time_s) * T_imu_camera().inverse(); };
    const SE3 before = unit(t - kStep_s), now = unit(t), after = unit(t + kStep_s);
    const Vec3 acceleration = (after.translation - 2.0 * now.translation + before.translation) / (kStep_s * kStep_s);
    return {t, geometry::so3_log(before.rotation.conjugate() * after.rotation) / (2.0 * kStep_s),
            now.rotation.conjugate() * (acceleration + Vec3(0, 0, 9.80665))};
  }
  /// Adds the image of a time, with the readings since the one before.
  LivePose add(const imaging::RgbImage& image, double t) {
    for (; read_s_ < t + 1e-9; read_s_ += 0.005) inertial_.add_reading(reading(read_s_));
    return inertial_.add(image, t);
  }

  Localizer inertial_{place_.scene, camera_, options()};
  double read_s_ = 0.0;
};

TEST_F(InertialFlight, ReadingsCarryTheCameraThroughImagesThatShowNothing) {
  inertial_.start(pose_at(0.0), 0.0);
  const imaging::RgbImage nothing(320, 240);
  LivePose live;
  for (int k = 0; k < 30; ++k) {
    const bool is_blind = k >= 15 && k < 22;
    live = add(is_blind ? nothing : picture(0.1 * k), 0.1 * k);
    EXPECT_EQ(live.located, !is_blind) << k;
    if (k < 5) continue;  // until then the velocity is unknown
    EXPECT_LT(error_m(live, 0.1 * k), is_blind ? 0.15 : 0.05) << k;
    EXPECT_FALSE(live.lost) << k;
    const Vec3 velocity = (pose_at(0.1 * k + 1e-3).translation - pose_at(0.1 * k - 1e-3).translation) / 2e-3;
    EXPECT_LT((live.velocity_m_s - velocity).norm(), 4.0 * live.sigma_velocity_m_s + 0.05) << k;
    EXPECT_LT((live.velocity_m_s - velocity).norm(), 0.3) << k;
  }
}

TEST_F(InertialFlight, ACameraThatStandsOnTheGroundIsNotSearched) {
  LiveOptions resting = options();
  resting.starts_at_rest = true;
  Localizer localizer(place_.scene, camera_, resting);
  const SE3 start = pose_at(0.0);
  localizer.start(start, 0.0);
  const auto stand = [&](double from_s, double to_s, double push_m_s2) {
    for (double t = from_s; t < to_s; t += 0.005)
      localizer.add_reading(
          {t, Vec3::Zero(), (start * T_imu_camera().inverse()).rotation.conjugate() * Vec3(0, 0, 9.80665 + push_m_s2)});
  };
  stand(0.0, 0.101, 0.0);
  EXPECT_FALSE(localizer.add(picture(0.0), 0.0).located);
  LivePose live = localizer.add(picture(0.0), 0.1);
  EXPECT_FALSE(live.located);
  EXPECT_FALSE(live.lost);
  EXPECT_EQ((live.T_local_camera.translation - start.translation).norm(), 0.0);
  stand(0.105, 0.241, 1.0);
  for (const double t : {0.2, 0.21, 0.22, 0.23}) EXPECT_FALSE(localizer.add(picture(0.0), t).located);
  EXPECT_TRUE(localizer.add(picture(0.0), 0.24).located);
}

TEST_F(InertialFlight, AStartAsideIsCorrected) {
  const Vec3 aside(0.5, -0.4, 0.3);
  inertial_.start(SE3(pose_at(0.0).rotation, pose_at(0.0).translation + aside), 0.0);
  LivePose live;
  for (int k = 0; k < 30; ++k) live = add(picture(0.1 * k), 0.1 * k);
  EXPECT_TRUE(live.located);
  EXPECT_LT(error_m(live, 2.9), 0.05);
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
