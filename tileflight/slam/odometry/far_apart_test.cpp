// Surveys: photos far apart over relief with known poses, and starts that show little parallax.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tileflight/slam/odometry/odometry.h"
#include "tileflight/slam/odometry/synthetic_flight.h"

namespace tileflight::odometry::far_apart_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using test_support::relative_ate;
using test_support::render_sequence;
using test_support::Sequence;
using test_support::small_options;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

/// Camera `pitch_rad` off straight down, the image's top towards `yaw_rad` clockwise from the y axis.
SE3 downwards(const Vec3& position, double yaw_rad, double pitch_rad) {
  const Vec3 ahead(std::sin(yaw_rad), std::cos(yaw_rad), 0.0), right(std::cos(yaw_rad), -std::sin(yaw_rad), 0.0);
  const Vec3 forward = std::sin(pitch_rad) * ahead - std::cos(pitch_rad) * Vec3::UnitZ();
  geometry::Mat3 R;
  R << right, forward.cross(right), forward;
  return SE3(R, position);
}

constexpr double kHeight_m = 30.0;

keyframes::test_support::Relief ground(double amplitude_m = 2.0) {
  return keyframes::test_support::sine_hills({.amplitude_m = amplitude_m, .k_x = 0.21, .k_y = 0.17}, 0.5);
}

/// Two lines of a lawn-mower, 45 % apart, flown to and fro with the drone turned if it looks straight down; `overlap`
/// from photo to photo.
std::vector<SE3> lawn_mower(const imaging::Camera& camera, double overlap, double pitch_rad) {
  constexpr int kLines = 2, kPhotos = 7;
  const double f = (*camera.project(Vec3(1, 0, 1)) - *camera.project(Vec3(0, 0, 1))).norm();
  const double distance_m = kHeight_m / std::cos(pitch_rad);
  const double step_m = (1.0 - overlap) * camera.height() / f * distance_m;
  const double gap_m = 0.45 * camera.width() / f * distance_m;
  std::vector<SE3> poses;
  for (int line = 0; line < kLines; ++line) {
    for (int i = 0; i < kPhotos; ++i) {
      const auto n = static_cast<double>(poses.size());
      const bool is_back = line % 2 == 1;
      const double y_m = step_m * (is_back ? kPhotos - 1 - i : i);
      const Vec3 shake(0.3 * std::sin(2.1 * n), 0.3 * std::sin(1.7 * n + 1.0), 0.4 * std::sin(1.3 * n));
      poses.push_back(downwards(Vec3(line * gap_m, y_m, kHeight_m) + shake,
                                (is_back && pitch_rad == 0.0 ? std::numbers::pi : 0.0) + 0.03 * std::sin(3.0 * n),
                                pitch_rad + 0.02 * std::sin(2.3 * n)));
    }
  }
  return poses;
}

OdometryResult track_survey(const imaging::Camera& camera, double overlap, double pitch_rad, Sequence& sequence) {
  sequence = render_sequence(camera, ground(), lawn_mower(camera, overlap, pitch_rad));
  return run_odometry(sequence.calibration, sequence.source(), small_options());
}

TEST(FarApart, ASurveyStraightDownIsTracked) {
  for (const double fov_deg : {60.0, 90.0}) {
    Sequence sequence;
    const OdometryResult result = track_survey(imaging::make_pinhole(480, 360, fov_deg), 0.8, 0.0, sequence);
    EXPECT_FALSE(result.lost) << fov_deg << ": " << result.lost_reason;
    EXPECT_EQ(result.frames_tracked, 14) << fov_deg;
    ASSERT_GT(result.frames_tracked, 4);
    EXPECT_LT(relative_ate(result.trajectory, sequence.truth), 0.005) << fov_deg;
    EXPECT_GT(result.map.size(), 300U) << fov_deg;
  }
}

TEST(FarApart, AnObliqueSurveyIsTracked) {
  Sequence sequence;
  const OdometryResult result = track_survey(imaging::make_pinhole(480, 360, 70.0), 0.75, 0.5, sequence);
  EXPECT_FALSE(result.lost) << result.lost_reason;
  EXPECT_EQ(result.frames_tracked, 14);
  ASSERT_GT(result.frames_tracked, 4);
  EXPECT_LT(relative_ate(result.trajectory, sequence.truth), 0.01);
}

TEST(FarApart, ImagesThatHardlyOverlapAreNamed) {
  Sequence sequence;
  const OdometryResult result = track_survey(imaging::make_pinhole(480, 360, 70.0), 0.35, 0.0, sequence);
  EXPECT_TRUE(result.lost);
  EXPECT_THAT(result.lost_reason,
              AllOf(HasSubstr("too far apart"), HasSubstr("pixels"), HasSubstr("--system colmap"),
                    HasSubstr("odometry: {system: colmap} in an experiment"), Not(HasSubstr("turns"))));
}

/// A rotation absorbs most of the motion that a narrow lens sees over level ground.
TEST(FarApart, ANarrowLensStraightDownOverLevelGroundStarts) {
  std::vector<SE3> poses;
  for (int i = 0; i < 60; ++i) poses.push_back(downwards(Vec3(0.02 * i, 0.5 * i, kHeight_m), 0.0, 0.0));
  const Sequence sequence = render_sequence(imaging::make_pinhole(320, 240, 60.0), ground(0.2), poses);
  const OdometryResult result = run_odometry(sequence.calibration, sequence.source(), small_options());
  EXPECT_FALSE(result.lost) << result.lost_reason;
  EXPECT_GE(result.frames_tracked, 55);
  ASSERT_GT(result.frames_tracked, 4);
  EXPECT_LT(relative_ate(result.trajectory, sequence.truth), 0.01);
}

}  // namespace
}  // namespace tileflight::odometry::far_apart_test
