#include "tileflight/slam/odometry/tracking_warnings.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace tileflight::odometry::tracking_warnings_test {
namespace {

using geometry::SE3;
using geometry::Sim3;
using geometry::Vec3;

SE3 at(double x, double y, double z) { return {Eigen::Quaterniond::Identity(), Vec3(x, y, z)}; }

/// Sixty images along a curve, all tracked well.
OdometryResult good_flight() {
  OdometryResult result;
  for (int i = 0; i < 60; ++i) {
    const double t = 0.1 * i;
    result.trajectory.poses.push_back({t, at(2.0 * t, std::sin(t), 0.3 * t)});
    result.quality.push_back({.frame = i,
                              .time_s = t,
                              .tracked = true,
                              .keyframe = 0,
                              .rmse = 5.0,
                              .inside_share = 0.9,
                              .saturated_share = 0.03,
                              .sigma_log_scale = 1e-6 * i});
  }
  result.frames = result.frames_tracked = 60;
  return result;
}

std::string name_of(std::int64_t frame) { return "f" + std::to_string(frame); }

Warnings warnings_about(const OdometryResult& result, std::int64_t frames = 60,
                        const std::optional<RunAgreement>& second = {}) {
  return find_warnings(result, frames, name_of, second);
}

/// Expects exactly one warning, with texts `what` and `where`.
void expect_only(const Warnings& warnings, const std::string& what, const std::string& where) {
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_NE(warnings[0].message.find(what), std::string::npos) << warnings[0].message;
  EXPECT_EQ(warnings[0].where, where);
  EXPECT_FALSE(warnings[0].remedy.empty());
}

TEST(TrackingWarnings, AGoodFlightHasNone) {
  EXPECT_TRUE(warnings_about(good_flight()).empty());
  EXPECT_TRUE(warnings_about(good_flight(), 60, RunAgreement{60, 0.002, 0.004, 1.0}).empty());
}

TEST(TrackingWarnings, AReversedRunIsDescribedInTheOrderOfTheFlight) {
  OdometryResult result = good_flight();
  result.backwards = true;
  result.lost = true;
  result.frames_tracked = 50;
  result.lost_reason = "a wall";
  result.lost_remedy = "fly around it";
  const Warnings lost = warnings_about(result);
  ASSERT_EQ(lost.size(), 1U);
  EXPECT_EQ(lost[0].message, "the flight was not tracked back to its beginning (50 of 60 frames have a pose): a wall");
  EXPECT_EQ(lost[0].remedy, "fly around it");
  // The map began with the last images: the scale is the less certain, the earlier an image is.
  OdometryResult drifted = good_flight();
  drifted.backwards = true;
  for (int i = 0; i < 60; ++i) drifted.quality[static_cast<std::size_t>(i)].sigma_log_scale = i < 20 ? 0.01 : 0.0;
  expect_only(warnings_about(drifted), "scale", "odometry, up to frame f19");
}

TEST(TrackingWarnings, APatternInTheResidualsIsTheCalibration) {
  OdometryResult result = good_flight();
  result.systematic_displacement = mapping::SystematicDisplacement{.rms_px = 0.02, .sigmas = 5.0};
  EXPECT_TRUE(warnings_about(result).empty());
  result.systematic_displacement = mapping::SystematicDisplacement{.rms_px = 0.3, .sigmas = 1.0};  // explained by noise
  EXPECT_TRUE(warnings_about(result).empty());
  result.systematic_displacement = mapping::SystematicDisplacement{.rms_px = 0.06, .sigmas = 5.0};
  expect_only(warnings_about(result),
              "calibration does not fit the images: residuals have a systematic pattern of 0.06 pixels", "odometry");
  EXPECT_EQ(warnings_about(result)[0].severity, Severity::kNote);
  result.systematic_displacement->rms_px = 0.2;
  EXPECT_EQ(warnings_about(result)[0].severity, Severity::kWarning);
}

TEST(TrackingWarnings, AFlightThatWasLostIsSaidWithItsReason) {
  OdometryResult result = good_flight();
  result.lost = true;
  result.lost_reason = "a wall";
  result.frames_tracked = 45;
  const Warnings warnings = warnings_about(result);
  expect_only(warnings, "45 of 60 frames have a pose): a wall", "odometry");
  EXPECT_EQ(warnings[0].severity, Severity::kError);
}

TEST(TrackingWarnings, ATrackedPartThatIsTooShortIsNotRecommended) {
  OdometryResult result = good_flight();
  result.lost = true;
  result.lost_reason = "a wall";
  result.frames_tracked = 5;
  const Warnings warnings = warnings_about(result);
  ASSERT_EQ(warnings.size(), 2U);
  EXPECT_EQ(warnings[0].remedy, "use a flight that can be tracked throughout");
  EXPECT_EQ(warnings[1].remedy, "use a flight of which a longer part can be tracked");
}

TEST(TrackingWarnings, NoStartIsOneWarning) {
  OdometryResult result;
  result.frames = 60;
  result.lost = true;
  result.lost_reason = "no parallax";
  expect_only(warnings_about(result), "no parallax", "odometry");
}

TEST(TrackingWarnings, GapsAndFewFramesAreSaid) {
  OdometryResult result = good_flight();
  result.frames_tracked = 57;
  EXPECT_TRUE(warnings_about(result).empty());
  result.frames_tracked = 50;  // the others are in one map: a verdict on it is possible
  expect_only(warnings_about(result), "50 of 60", "odometry");
  EXPECT_EQ(warnings_about(result)[0].severity, Severity::kNote);
  result.frames_tracked = 40;
  expect_only(warnings_about(result), "40 of 60", "odometry");
  EXPECT_EQ(warnings_about(result)[0].severity, Severity::kError);
  result.frames_tracked = 12;
  expect_only(warnings_about(result, 12), "only 12 frames", "odometry");
}

TEST(TrackingWarnings, FramesThatFitBadlyAreNamed) {
  OdometryResult result = good_flight();
  for (const int i : {20, 21, 24}) result.quality[i].saturated_share = 0.3 + 0.01 * i;
  expect_only(warnings_about(result), "residuals are high in 3 frames: up to 54 %", "odometry, frames f20 to f24");
  EXPECT_EQ(warnings_about(result)[0].severity, Severity::kWarning);
}

TEST(TrackingWarnings, AFewFramesThatFitByMostOfTheirPointsAreASmallPart) {
  OdometryResult result = good_flight();
  for (const int i : {20, 21, 24}) result.quality[i].saturated_share = 0.19;
  expect_only(warnings_about(result), "residuals are high in 3 frames: up to 19 %", "odometry, frames f20 to f24");
  EXPECT_EQ(warnings_about(result)[0].severity, Severity::kNote);
  result.quality[25].saturated_share = 0.19;  // more than one of twenty
  EXPECT_EQ(warnings_about(result)[0].severity, Severity::kWarning);
}

TEST(TrackingWarnings, ThoseAboutThePathAsAWholeAreKnown) {
  OdometryResult result = good_flight();
  result.quality[20].saturated_share = 0.5;
  for (int i = 30; i < 60; ++i) result.quality[i].sigma_log_scale = 0.02;
  const RunAgreement apart{60, 0.08, 0.2, 3.04};
  const Warnings path = find_path_warnings(result, name_of, apart);
  ASSERT_EQ(path.size(), 2U);
  EXPECT_NE(path[0].message.find("differ by 8 %"), std::string::npos);
  EXPECT_NE(path[1].message.find("scale may have drifted"), std::string::npos);
  EXPECT_EQ(warnings_about(result, 60, apart).size(), 3U);
}

TEST(TrackingWarnings, AScaleCarriedByLittleIsNamedFromItsFrameOn) {
  OdometryResult result = good_flight();
  for (int i = 30; i < 60; ++i) result.quality[i].sigma_log_scale = 0.02;
  expect_only(warnings_about(result), "scale may have drifted", "odometry, from frame f30 on");
}

TEST(TrackingWarnings, AScaleCarriedByLittleIsNamedOnBothSidesOfTheStart) {
  OdometryResult result = good_flight();
  result.frames_before_start = 20;
  for (int i = 0; i < 10; ++i) result.quality[i].sigma_log_scale = 0.02;
  expect_only(warnings_about(result), "scale may have drifted", "odometry, up to frame f9");
  for (int i = 50; i < 60; ++i) result.quality[i].sigma_log_scale = 0.02;
  expect_only(warnings_about(result), "scale may have drifted", "odometry, up to frame f9 and from frame f50 on");
}

TEST(TrackingWarnings, PicturesThatJumpAwayAndBackAreNamed) {
  OdometryResult result = good_flight();
  for (int i = 40; i < 46; ++i) result.trajectory.poses[i].T_local_camera.translation += Vec3(0, 4.8, 0);
  expect_only(warnings_about(result), "the camera jumps", "odometry, frame f40");
}

TEST(TrackingWarnings, AFlightThatStartsAndStopsDoesNotJump) {
  OdometryResult result = good_flight();
  for (int i = 0; i < 60; ++i)
    result.trajectory.poses[i].T_local_camera.translation = Vec3(i < 20 ? i : i < 40 ? 20 : 20 + 3 * (i - 40), 0, 0);
  EXPECT_TRUE(warnings_about(result).empty());
}

TEST(TrackingWarnings, AnotherRunThatDisagreesIsAWarning) {
  expect_only(warnings_about(good_flight(), 60, RunAgreement{60, 0.08, 0.2, 3.04}), "differ by 8 %",
              "odometry, most at frame f30");
}

// ---- two runs ----

TEST(Belief, IsInTheFirstWhereBothAgreeOrTheSecondSaysLittle) {
  const OdometryResult good = good_flight();
  OdometryResult half = good;
  half.frames_tracked = 30;
  EXPECT_EQ(choose_run(good, good, RunAgreement{60, 0.001, 0.01, 0.0}), RunChoice::kFirst);
  EXPECT_EQ(choose_run(good, half, RunAgreement{30, 0.1, 0.2, 0.0}), RunChoice::kFirst);
  EXPECT_EQ(choose_run(good, good, {}), RunChoice::kFirst);
}

TEST(Belief, IsInTheSecondWhereTheFirstHasNoStartOrIsWorseByItself) {
  const OdometryResult good = good_flight();
  OdometryResult none, worse = good;
  EXPECT_EQ(choose_run(none, good, {}), RunChoice::kSecond);
  for (tracking::FrameQuality& q : worse.quality) q.rmse = 7.0, q.saturated_share = 0.2;
  EXPECT_EQ(choose_run(worse, good, RunAgreement{60, 0.1, 0.2, 0.0}), RunChoice::kSecond);
  EXPECT_EQ(choose_run(good, worse, RunAgreement{60, 0.1, 0.2, 0.0}), RunChoice::kFirst);
}

TEST(Belief, IsRatherInTheSecondWhereOnlyTheFirstHasWarningsThoughBothFitAlike) {
  const OdometryResult good = good_flight();
  OdometryResult worse = good, lost = good;
  for (tracking::FrameQuality& q : worse.quality) q.saturated_share = 0.2;
  lost.frames_tracked = 50;  // of 60
  const RunAgreement apart{50, 0.1, 0.2, 0.0};
  EXPECT_EQ(choose_run(worse, good, apart), RunChoice::kRatherSecond);
  EXPECT_EQ(choose_run(lost, good, apart), RunChoice::kRatherSecond);
  EXPECT_EQ(choose_run(good, worse, apart), RunChoice::kOpen);
  EXPECT_EQ(choose_run(worse, good, RunAgreement{50, 0.001, 0.01, 0.0}), RunChoice::kFirst);
  OdometryResult loose = good;
  for (tracking::FrameQuality& q : loose.quality) q.rmse *= 1.3;
  EXPECT_EQ(choose_run(worse, loose, apart), RunChoice::kOpen);
}

TEST(Belief, IsOpenWhereNothingTellsThem) {
  const OdometryResult good = good_flight();
  EXPECT_EQ(choose_run(good, good, RunAgreement{60, 0.1, 0.2, 0.0}), RunChoice::kOpen);
}

TEST(SecondOpinion, ASimilarityChangesNothing) {
  const geometry::Trajectory path = good_flight().trajectory;
  const Sim3 T(3.0, Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized())), Vec3(4, 5, 6));
  const auto found = measure_agreement(path, geometry::transformed(T, path));
  ASSERT_TRUE(found);
  EXPECT_EQ(found->pictures, 60U);
  EXPECT_LT(found->rms_share, 1e-9);
}

TEST(SecondOpinion, ANoiseOfKnownSizeIsItsShareOfThePath) {
  // A straight path of 59 steps; every second camera of one run is displaced to either side.
  geometry::Trajectory first, second;
  for (int i = 0; i < 60; ++i) {
    first.poses.push_back({0.1 * i, at(i, 0, 0)});
    second.poses.push_back({0.1 * i, at(i, i % 4 < 2 ? 0.5 : -0.5, 0)});
  }
  const auto found = measure_agreement(first, second);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->rms_share, 0.5 / 59, 1e-4);
}

TEST(SecondOpinion, AScaleThatChangedHalfWayIsSeen) {
  const geometry::Trajectory path = good_flight().trajectory;
  geometry::Trajectory other = path;
  const Vec3 middle = path.poses[30].T_local_camera.translation;
  for (int i = 31; i < 60; ++i) {
    Vec3& p = other.poses[i].T_local_camera.translation;
    p = middle + 0.7 * (p - middle);
  }
  EXPECT_GT(measure_agreement(path, other)->rms_share, 0.02);
  EXPECT_NEAR(measure_agreement(path, other)->rms_share, measure_agreement(other, path)->rms_share, 0.02);
}

TEST(SecondOpinion, PathsThatRunAgainstEachOtherDisagree) {
  geometry::Trajectory first, second;
  for (int i = 0; i < 60; ++i) {
    first.poses.push_back({0.1 * i, at(i, 0, 0)});
    second.poses.push_back({0.1 * i, at(-0.2 * i, 0, 0)});
  }
  const auto found = measure_agreement(first, second);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->rms_share, std::sqrt((60.0 * 60.0 - 1.0) / 12.0) / 59.0,
              1e-9);  // of 60 equal steps about the middle
  const OdometryResult good = good_flight();
  OdometryResult worse = good;
  for (tracking::FrameQuality& q : worse.quality) q.rmse = 7.0, q.saturated_share = 0.2;
  EXPECT_EQ(choose_run(worse, good, found), RunChoice::kSecond);
}

/// Two runs with errors of `noise` (position, per axis) and `turn_rad` (about one axis), sigmas stated as given.
std::optional<Dispersion> dispersion_of(double noise, double turn_rad, double stated_position, double stated_rotation) {
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  const auto disturbed = [&](const geometry::Trajectory& path) {
    geometry::Trajectory other = path;
    for (std::size_t i = 0; i < other.size(); i += 1) {
      if (i % 6 == 0) continue;  // keyframes: the steps' errors are then those of the pictures between
      SE3& pose = other.poses[i].T_local_camera;
      pose.translation += noise * Vec3(normal(random), normal(random), normal(random));
      pose.rotation = pose.rotation * Eigen::AngleAxisd(turn_rad * normal(random), Vec3::UnitY());
    }
    return other;
  };
  OdometryResult result = good_flight();
  for (int k = 0; k < 10; ++k) result.keyframes.poses.push_back(result.trajectory.poses[6 * k]);
  for (int i = 0; i < 60; ++i) {
    tracking::FrameQuality& q = result.quality[static_cast<std::size_t>(i)];
    q.keyframe = i / 6;
    q.sigma_position = i % 6 == 0 ? 0.0 : stated_position;
    q.sigma_rotation_rad = i % 6 == 0 ? 0.0 : stated_rotation;
  }
  geometry::Trajectory second = disturbed(result.trajectory);
  for (auto& pose : second.poses) pose.T_local_camera.translation *= 2.5;  // its own scale
  return estimate_dispersion(disturbed(result.trajectory), result.keyframes, result.quality, second);
}

TEST(SecondOpinion, DispersionIsOneWhereTheSigmasAreRight) {
  const auto right = dispersion_of(0.01, 0.002, std::sqrt(3.0) * 0.01, 0.002);
  ASSERT_TRUE(right);
  EXPECT_EQ(right->pictures, 50U);
  EXPECT_NEAR(right->position, 1.0, 0.25);
  EXPECT_NEAR(right->rotation, 1.0, 0.35);
  const auto too_small = dispersion_of(0.01, 0.002, std::sqrt(3.0) * 0.005, 0.001);
  ASSERT_TRUE(too_small);
  EXPECT_NEAR(too_small->position, 4.0 * right->position, 1e-9);
  EXPECT_NEAR(too_small->rotation, 4.0 * right->rotation, 1e-9);
  std::vector<tracking::FrameQuality> quality{{.sigma_position = 0.1, .sigma_rotation_rad = 0.2}};
  rescale_sigmas(quality, {50, 4.0, 0.01});
  EXPECT_DOUBLE_EQ(quality[0].sigma_position, 0.2);
  EXPECT_DOUBLE_EQ(quality[0].sigma_rotation_rad, 0.1);  // not below a half
}

TEST(TrackingWarnings, ARigWithoutScaleIsSaidAndWhereTheScaleIsFromThen) {
  OdometryResult result = good_flight();
  result.stereo.emplace().metric = false;
  ASSERT_EQ(warnings_about(result).size(), 1U);
  EXPECT_NE(warnings_about(result)[0].message.find("the map has no metric scale"), std::string::npos);
  result.inertial.emplace().metric = true;
  ASSERT_EQ(warnings_about(result).size(), 1U);
  EXPECT_NE(warnings_about(result)[0].message.find("the inertial unit did"), std::string::npos);
}

TEST(TrackingWarnings, AFocalLengthThatMovedFurtherThanItsSigmaIsNamed) {
  const auto lens = [](double focal_px) {
    return imaging::Camera(imaging::PinholeRadtan{.fx = focal_px, .fy = focal_px, .cx = 800, .cy = 600}, 1600, 1200);
  };
  EXPECT_TRUE(focal_warnings(lens(1000.0), lens(1029.0), 0.02).empty());
  EXPECT_TRUE(focal_warnings(lens(1000.0), lens(971.0), 0.02).empty());
  const Warnings warnings = focal_warnings(lens(1000.0), lens(956.0), 0.02);
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_NE(warnings[0].message.find("as 956 pixels, 4.4 % from the calibration's 1000"), std::string::npos);
}

TEST(SecondOpinion, OnlyPicturesThatBothHaveCount) {
  const geometry::Trajectory path = good_flight().trajectory;
  geometry::Trajectory part = path;
  part.poses.erase(part.poses.begin(), part.poses.begin() + 40);
  EXPECT_EQ(measure_agreement(path, part)->pictures, 20U);
  part.poses.resize(3);
  EXPECT_FALSE(measure_agreement(path, part));
  EXPECT_FALSE(measure_agreement(path, {}));
}

}  // namespace
}  // namespace tileflight::odometry::tracking_warnings_test
