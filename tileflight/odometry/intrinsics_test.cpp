// Estimation of focal lengths and principal point in the window, on a rendered scene with known lens.

#include <gtest/gtest.h>

#include "tileflight/odometry/synthetic_flight.h"
#include "tileflight/photometry/lens.h"

namespace tileflight::odometry::intrinsics_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using imaging::Camera;

/// fx, fy, cx, cy.
Eigen::Vector4d intrinsics(const Camera& camera) {
  return std::visit([](const auto& m) { return Eigen::Vector4d(m.fx, m.fy, m.cx, m.cy); }, camera.model());
}

OdometryResult run(const test_support::Sequence& truth, const photometry::IntrinsicsDelta& error, bool refine) {
  test_support::Sequence sequence = truth;
  sequence.calibration.camera = photometry::apply_delta(truth.calibration.camera, error);
  photometry::OdometryOptions options = test_support::small_options();
  options.window.refine_intrinsics = refine;
  return run_odometry(sequence.calibration, nullptr, sequence.source(), options);
}

/// An arc around the point that the camera looks at.
std::vector<SE3> part_of_an_orbit(int frames) {
  std::vector<SE3> truth;
  for (int i = 0; i < frames; ++i) {
    const double angle = 1.2 * i / frames - 0.6;
    const Vec3 position(10.0 * std::sin(angle), -10.0 * std::cos(angle), 12.0 + std::sin(3.0 * angle));
    truth.push_back(photometry::test_support::look_along(position, -position));
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
  const photometry::IntrinsicsDelta error(focal_error, focal_error, 0.0, 0.0);
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
  const test_support::Sequence sequence =
      test_support::render_sequence(imaging::make_pinhole(320, 220, 80.0), test_support::hilly_ground(), part_of_an_orbit(75));
  expect_the_lens_comes_back(sequence, -0.02);
  expect_the_lens_comes_back(sequence, 0.02);
}

TEST(Intrinsics, ThatAreRightStay) {
  for (const Camera& camera : {imaging::make_fisheye(320, 200, 130.0), imaging::make_pinhole(320, 220, 80.0)}) {
    const test_support::Sequence sequence = test_support::render_sequence(camera, test_support::hilly_ground(), part_of_an_orbit(75));
    const OdometryResult refined = run(sequence, photometry::IntrinsicsDelta::Zero(), true),
                         fixed = run(sequence, photometry::IntrinsicsDelta::Zero(), false);
    EXPECT_LT(off(refined, camera).cwiseAbs().maxCoeff(), 0.005) << off(refined, camera).transpose();
    EXPECT_LT(median_height_m(refined, sequence), 1.2 * median_height_m(fixed, sequence));
  }
}

TEST(Intrinsics, StayAsGivenWhereAskedFor) {
  const Camera camera = imaging::make_fisheye(320, 200, 130.0);
  const OdometryResult result = run(test_support::render_hill_flight(camera, 20), photometry::IntrinsicsDelta::Zero(), false);
  ASSERT_TRUE(result.camera);
  EXPECT_EQ(intrinsics(*result.camera), intrinsics(camera));
}

}  // namespace
}  // namespace tileflight::odometry::intrinsics_test
