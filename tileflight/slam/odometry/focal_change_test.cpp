// Flights over hills whose images are taken with a focal length that changes.

#include "tileflight/slam/odometry/focal_change.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tileflight/slam/odometry/synthetic_flight.h"
#include "tileflight/slam/odometry/track.h"
#include "tileflight/slam/odometry/tracking_warnings.h"

namespace tileflight::odometry {
namespace {

constexpr int kFrames = 100, kZoomBegins = 45, kZoomEnds = 75;

imaging::Camera camera(double factor) {
  return {imaging::PinholeRadtan{factor * 300, factor * 300, 200, 150, {-0.1, 0.02, 0.0, 0.0}}, 400, 300};
}

double factor_at(double largest, int frame) {
  const double part = std::clamp((frame - kZoomBegins) / static_cast<double>(kZoomEnds - kZoomBegins), 0.0, 1.0);
  return std::pow(largest, part);
}

/// Past the hills, looking aside and down.
std::vector<geometry::SE3> path() {
  std::vector<geometry::SE3> poses;
  for (int i = 0; i < kFrames; ++i) {
    const double s = i / 30.0;
    poses.push_back(keyframes::test_support::look_along(geometry::Vec3(5.0 * s, 0.5 * s, 10.0 + 0.3 * std::sin(s)),
                                                        geometry::Vec3(0.05 * std::sin(s), 1.0, -0.8)));
  }
  return poses;
}

test_support::Sequence flight(double largest_factor) {
  test_support::Sequence sequence;
  sequence.calibration.camera = camera(1.0);
  sequence.truth = path();
  for (int i = 0; i < kFrames; ++i) {
    const keyframes::test_support::ReliefCamera scene(camera(factor_at(largest_factor, i)),
                                                      test_support::hilly_ground());
    sequence.images.push_back(scene.render(sequence.truth[static_cast<std::size_t>(i)]));
  }
  return sequence;
}

std::vector<std::string> focal_warnings(const OdometryResult& result) {
  std::vector<std::string> found;
  for (const Warning& warning :
       find_warnings(result, result.frames, [](std::int64_t frame) { return std::to_string(frame); }))
    if (warning.message.starts_with("the focal length changes")) found.push_back(warning.message);
  return found;
}

TEST(FocalChange, AConstantFocalLengthStays) {
  const test_support::Sequence sequence = flight(1.0);
  const OdometryResult result = run_odometry(sequence.calibration, sequence.source(), test_support::small_options());
  ASSERT_GE(result.focal_segments.size(), 2U);
  for (const FocalSegment& segment : result.focal_segments) {
    EXPECT_FALSE(segment.shows_change());
    EXPECT_LT(std::abs(segment.most_changed().log_change), 0.035);
  }
  EXPECT_TRUE(focal_warnings(result).empty());
}

TEST(FocalChange, AZoomIsMeasuredAndNamed) {
  const double largest = 1.25;
  const test_support::Sequence sequence = flight(largest);
  const OdometryResult result = run_odometry(sequence.calibration, sequence.source(), test_support::small_options());
  double measured = 0.0;
  int last = 0;
  for (const FocalSegment& segment : result.focal_segments) {
    if (last == 0) last = static_cast<int>(segment.images.front().frame);
    measured += segment.images.back().log_change;
    last = static_cast<int>(segment.images.back().frame);
  }
  EXPECT_NEAR(measured, std::log(factor_at(largest, last)), 0.02);
  ASSERT_EQ(focal_warnings(result).size(), 1U);
}

TEST(FocalChange, InReverseTheFactorIsTheOther) {
  const FocalSegment segment{.images = {{10, -1.0, 0.0, 0.0}, {14, -0.8, 0.05, 0.001}, {20, -0.5, 0.2, 0.002}},
                             .one_focal_length_px = 1.0,
                             .residual_px = 0.2};
  const FocalSegment turned = reversed(segment, 99);
  ASSERT_EQ(turned.images.size(), 3U);
  EXPECT_EQ(turned.images[0].frame, 79);
  EXPECT_EQ(turned.images[1].frame, 85);
  EXPECT_EQ(turned.images[2].frame, 89);
  EXPECT_DOUBLE_EQ(turned.images[0].time_s, 0.5);
  EXPECT_DOUBLE_EQ(turned.images[0].log_change, 0.0);
  EXPECT_DOUBLE_EQ(turned.images[1].log_change, -0.15);
  EXPECT_DOUBLE_EQ(turned.images[2].log_change, -0.2);
  EXPECT_TRUE(turned.shows_change());
}

}  // namespace
}  // namespace tileflight::odometry
