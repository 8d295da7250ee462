// Estimation of focal lengths and principal point in the window, on a rendered scene with known lens.

#include <gtest/gtest.h>

#include "tileflight/slam/keyframes/lens.h"
#include "tileflight/slam/odometry/synthetic_flight.h"

namespace tileflight::odometry::intrinsics_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using imaging::Camera;

/// fx, fy, cx, cy.
Eigen::Vector4d intrinsics(const Camera& camera) {
  return std::visit([](const auto& m) { return Eigen::Vector4d(m.fx, m.fy, m.cx, m.cy); }, camera.model());
}

OdometryResult run(const test_support::Sequence& truth, const keyframes::IntrinsicsDelta& error, bool refine) {
  test_support::Sequence sequence = truth;
  sequence.calibration.camera = keyframes::apply_delta(truth.calibration.camera, error);
  keyframes::OdometryOptions options = test_support::small_options();
  options.window.refine_intrinsics = refine;
  return run_odometry(sequence.calibration, sequence.source(), options);
}

/// An arc around the point that the camera looks at.
std::vector<SE3> part_of_an_orbit(int frames) {
  std::vector<SE3> truth;
  for (int i = 0; i < frames; ++i) {
    const double angle = 1.2 * i / frames - 0.6;
    const Vec3 position(10.0 * std::sin(angle), -10.0 * std::cos(angle), 12.0 + std::sin(3.0 * angle));
    truth.push_back(keyframes::test_support::look_along(position, -position));
  }
  return truth;
}

/// Error of the estimated lens: focal lengths as shares, principal point in focal lengths.
Eigen::Vector4d off(const OdometryResult& result, const Camera& truth) {
  return (intrinsics(result.camera.value()) - intrinsics(truth)) / intrinsics(truth)[0];
}

double median_height_m(const OdometryResult& result, const test_support::Sequence& sequence) {
  return base::upper_median(test_support::height_errors_m(test_support::hilly_ground(), result, sequence.truth));
}

/// Most of an error of the focal lengths is removed within 75 images (despite the prior on the given ones), and the map
/// improves.
void expect_the_lens_comes_back(const test_support::Sequence& sequence, double focal_error) {
  const keyframes::IntrinsicsDelta error(focal_error, focal_error, 0.0, 0.0);
  const OdometryResult refined = run(sequence, error, true), as_given = run(sequence, error, false);
  EXPECT_FALSE(refined.lost) << refined.lost_reason;
  const Eigen::Vector4d left = off(refined, sequence.calibration.camera);
  EXPECT_LT(left.head<2>().cwiseAbs().maxCoeff(), 0.5 * std::abs(focal_error)) << left.transpose();
  EXPECT_LT(left.tail<2>().cwiseAbs().maxCoeff(), 0.001) << left.transpose();
  EXPECT_LT(median_height_m(refined, sequence), 0.6 * median_height_m(as_given, sequence));
}

TEST(Intrinsics, OfAFisheyeComeBack) {
  const Camera camera = imaging::make_fisheye(320, 200, 130.0);
  const test_support::Sequence sequence = test_support::render_hill_flight(camera, 75);
  expect_the_lens_comes_back(sequence, -0.02);
  expect_the_lens_comes_back(sequence, 0.02);
}

TEST(Intrinsics, OfAPinholeComeBack) {
  const test_support::Sequence sequence = test_support::render_sequence(
      imaging::make_pinhole(320, 220, 80.0), test_support::hilly_ground(), part_of_an_orbit(75));
  expect_the_lens_comes_back(sequence, -0.02);
  expect_the_lens_comes_back(sequence, 0.02);
}

TEST(Intrinsics, ThatAreRightStay) {
  for (const Camera& camera : {imaging::make_fisheye(320, 200, 130.0), imaging::make_pinhole(320, 220, 80.0)}) {
    const test_support::Sequence sequence =
        test_support::render_sequence(camera, test_support::hilly_ground(), part_of_an_orbit(75));
    const OdometryResult refined = run(sequence, keyframes::IntrinsicsDelta::Zero(), true),
                         fixed = run(sequence, keyframes::IntrinsicsDelta::Zero(), false);
    EXPECT_LT(off(refined, camera).cwiseAbs().maxCoeff(), 0.005) << off(refined, camera).transpose();
    EXPECT_LT(median_height_m(refined, sequence), 1.2 * median_height_m(fixed, sequence));
  }
}

TEST(Intrinsics, StayAsGivenWhereAskedFor) {
  const Camera camera = imaging::make_fisheye(320, 200, 130.0);
  const OdometryResult result =
      run(test_support::render_hill_flight(camera, 20), keyframes::IntrinsicsDelta::Zero(), false);
  ASSERT_TRUE(result.camera);
  EXPECT_EQ(intrinsics(*result.camera), intrinsics(camera));
}

/// Largest distance of a keyframe from where the one before and the true motion put it, metres. `T_map_camera` is
/// scaled and turned into the truth's axes by what the first and last keyframe have in common with it.
double largest_step_error_m(const std::vector<SE3>& T_map_camera, const std::vector<double>& times_s,
                            const std::vector<SE3>& truth) {
  geometry::Trajectory path;
  for (std::size_t k = 0; k < times_s.size(); ++k) path.poses.push_back({times_s[k], T_map_camera[k]});
  const geometry::Sim3 T_truth_map = test_support::similarity_to_truth(path, truth);
  const auto truth_at = [&](std::size_t k) { return truth[static_cast<std::size_t>(std::lround(30.0 * times_s[k]))]; };
  double largest = 0.0;
  for (std::size_t k = 1; k < times_s.size(); ++k) {
    const SE3 step = T_map_camera[k - 1].inverse() * T_map_camera[k],
              expected = truth_at(k - 1).inverse() * truth_at(k);
    largest = std::max(largest, (T_truth_map.scale * step.translation - expected.translation).norm());
  }
  return largest;
}

/// Ahead and a little down, so that what is far away stays in sight.
std::vector<SE3> ahead(int frames) {
  std::vector<SE3> truth;
  for (int i = 0; i < frames; ++i) {
    const double s = i / 30.0;
    truth.push_back(keyframes::test_support::look_along(Vec3(0.5 * std::sin(s), 5.0 * s, 12.0 + 0.5 * std::sin(s)),
                                                        Vec3(0.1 * std::sin(0.7 * s), 1.0, -0.6)));
  }
  return truth;
}

// A keyframe that stays long in the window is seen at its end by few points, from far away. If the lens is a little
// off, they move it against its neighbours, by much more than the steps between keyframes that are near each other are
// off. Readings are compared with those steps.
TEST(Intrinsics, AnErrorMovesKeyframesThatStayButNotTheSteps) {
  const test_support::Sequence truth =
      test_support::render_sequence(imaging::make_pinhole(320, 240, 90.0), test_support::hilly_ground(), ahead(180));
  keyframes::OdometryOptions options = test_support::small_options();
  options.window.refine_intrinsics = false;
  imaging::Calibration calibration = truth.calibration;
  calibration.camera = keyframes::apply_delta(calibration.camera, keyframes::IntrinsicsDelta(0.0, 0.0, 0.01, 0.0));
  Odometry odometry(calibration, options);
  for (std::size_t i = 0; i < truth.images.size(); ++i) odometry.add(truth.images[i], static_cast<double>(i) / 30.0);
  ASSERT_FALSE(odometry.lost());
  std::vector<double> times_s;
  std::vector<SE3> by_steps, latest;
  for (const inertial::VisualKeyframe& keyframe : odometry.latest_keyframes(1000)) {
    times_s.push_back(keyframe.time_s);
    by_steps.push_back(keyframe.T_map_camera);
  }
  for (const geometry::StampedPose& pose : odometry.keyframes().poses) latest.push_back(pose.T_local_camera);
  ASSERT_EQ(by_steps.size(), latest.size());
  ASSERT_GT(by_steps.size(), 10U);
  const double of_steps = largest_step_error_m(by_steps, times_s, truth.truth),
               of_latest = largest_step_error_m(latest, times_s, truth.truth);
  EXPECT_LT(of_steps, 0.5 * of_latest);
}

}  // namespace
}  // namespace tileflight::odometry::intrinsics_test
