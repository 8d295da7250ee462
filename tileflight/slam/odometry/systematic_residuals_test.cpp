// One flight is tracked with its own lens and with slightly different ones.

#include "tileflight/slam/mapping/systematic_residuals.h"

#include <gtest/gtest.h>

#include "tileflight/slam/odometry/synthetic_flight.h"
#include "tileflight/slam/odometry/tracking_warnings.h"

namespace tileflight::odometry::systematic_residuals_test {
namespace {

using imaging::Camera;
using imaging::PinholeRadtan;

const PinholeRadtan kLens{320, 322, 250, 175, {-0.2, 0.05, 1e-3, -1e-3}};

const test_support::Sequence& flight() {
  static const test_support::Sequence sequence = test_support::render_hill_flight(Camera(kLens, 500, 360), 60);
  return sequence;
}

OdometryResult tracked_with(const PinholeRadtan& lens) {
  imaging::Calibration calibration;
  calibration.camera = Camera(lens, 500, 360);
  return run_odometry(calibration, flight().source(), {});
}

bool warnings_calibration(const OdometryResult& result) {
  const Warnings warnings =
      find_warnings(result, result.frames, [](std::int64_t frame) { return std::to_string(frame); });
  return std::ranges::any_of(warnings,
                             [](const Warning& d) { return d.message.starts_with("the calibration does not fit"); });
}

TEST(SystematicResiduals, TheRightLensHasNone) {
  const OdometryResult result = tracked_with(kLens);
  ASSERT_TRUE(result.systematic_displacement.has_value());
  EXPECT_LT(result.systematic_displacement->rms_px, 0.03);
  EXPECT_FALSE(warnings_calibration(result));
}

TEST(SystematicResiduals, AnotherLensOfNearlyTheSameShapeIsWarninged) {
  for (const std::array<double, 4>& distortion :
       {std::array{-0.12, 0.05, 1e-3, -1e-3}, std::array{-0.2, 0.15, 0.0, 0.0}, std::array{-0.2, 0.05, 5e-3, 5e-3},
        std::array{0.0, 0.0, 0.0, 0.0}}) {
    PinholeRadtan lens = kLens;
    lens.d = distortion;
    const OdometryResult result = tracked_with(lens);
    ASSERT_TRUE(result.systematic_displacement.has_value());
    EXPECT_GT(result.systematic_displacement->rms_px, 0.08);
    EXPECT_TRUE(warnings_calibration(result));
  }
}

}  // namespace
}  // namespace tileflight::odometry::systematic_residuals_test
