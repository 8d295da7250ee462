// A rolling shutter without row times: its line delay from the images.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <vector>

#include "tileflight/slam/odometry/line_delay_record.h"
#include "tileflight/slam/odometry/synthetic_flight.h"

namespace tileflight::odometry::line_delay_test {
namespace {

using test_support::Sequence;

constexpr int kFrames = 90;

LineDelayPasses estimated(const Sequence& sequence, double given_s = 0.0) {
  keyframes::OdometryOptions options = test_support::small_options();
  options.estimate_line_delay = true;
  return track_with_line_delay(given_s, [&](double line_delay_s) {
    imaging::Calibration calibration = sequence.calibration;
    calibration.line_delay_s = line_delay_s;
    return run_odometry(calibration, sequence.source(), options);
  });
}

double ate(const Sequence& sequence, double line_delay_s) {
  imaging::Calibration calibration = sequence.calibration;
  calibration.line_delay_s = line_delay_s;
  return test_support::relative_ate(
      run_odometry(calibration, sequence.source(), test_support::small_options()).trajectory, sequence.truth);
}

TEST(LineDelay, IsFoundInTheImages) {
  for (const double true_s : {6e-5, -3e-5}) {
    const Sequence sequence = test_support::shaken_flight(kFrames, true_s);
    const LineDelayPasses found = estimated(sequence);
    ASSERT_TRUE(found.estimate);
    const double with_truth = ate(sequence, true_s), without = ate(sequence, 0.0);
    const double with_estimate = test_support::relative_ate(found.result.trajectory, sequence.truth);
    std::printf(
        "true %.2f us, found %.2f, sigma %.2f, used %.2f, %d passes, %d windows; ATE %.4f %%, %.4f with the "
        "truth, %.4f without\n",
        1e6 * true_s, 1e6 * found.estimate->line_delay_s, 1e6 * found.estimate->sigma_s, 1e6 * found.line_delay_s,
        found.passes, found.estimate->windows, 100 * with_estimate, 100 * with_truth, 100 * without);
    EXPECT_LT(std::abs(found.estimate->line_delay_s - true_s), 3.0 * found.estimate->sigma_s);
    EXPECT_LT(found.estimate->sigma_s, 7e-6);
    EXPECT_LT(std::abs(found.line_delay_s - found.estimate->line_delay_s), found.estimate->sigma_s);
    EXPECT_LT(with_estimate, 1.2 * with_truth);
    EXPECT_LT(with_truth, 0.7 * without);
  }
}

TEST(LineDelay, OfAGlobalShutterStaysZero) {
  const Sequence sequence = test_support::shaken_flight(kFrames, 0.0);
  const LineDelayPasses found = estimated(sequence);
  ASSERT_TRUE(found.estimate);
  std::printf("found %.2f us, sigma %.2f, used %.2f\n", 1e6 * found.estimate->line_delay_s,
              1e6 * found.estimate->sigma_s, 1e6 * found.line_delay_s);
  EXPECT_LT(std::abs(found.estimate->line_delay_s), 3.0 * found.estimate->sigma_s);
  EXPECT_EQ(found.line_delay_s, 0.0);
  EXPECT_EQ(found.passes, 1);
}

/// Passes over images of which each says that the delay is `true_s`, known to `sigma_s`.
struct Answers {
  double true_s, sigma_s;
  std::vector<double> tracked_with_s = {};

  LineDelayPasses passes(double given_s) {
    return track_with_line_delay(given_s, [&](double line_delay_s) {
      tracked_with_s.push_back(line_delay_s);
      OdometryResult result;
      result.line_delay = {true_s - line_delay_s, sigma_s, 20};
      return result;
    });
  }
};

TEST(LineDelayPasses, EndWhenTheEstimateStays) {
  Answers answers{3e-5, 1e-6};
  const LineDelayPasses found = answers.passes(0.0);
  EXPECT_EQ(answers.tracked_with_s, (std::vector<double>{0.0, 3e-5}));
  EXPECT_EQ(found.passes, 2);
  EXPECT_EQ(found.line_delay_s, 3e-5);
  EXPECT_EQ(found.estimate->line_delay_s, 3e-5);
}

TEST(LineDelayPasses, KeepWhatWasGivenWithinThreeSigmas) {
  Answers answers{3e-5, 1.1e-5};
  const LineDelayPasses found = answers.passes(0.0);
  EXPECT_EQ(found.passes, 1);
  EXPECT_EQ(found.line_delay_s, 0.0);
  EXPECT_EQ(found.estimate->line_delay_s, 3e-5);
  Answers near{3e-5, 1e-6};
  EXPECT_EQ(near.passes(2.8e-5).line_delay_s, 2.8e-5);
}

TEST(LineDelayPasses, ReturnToWhatWasGivenIfASecondPassIsLessSure) {
  int pass = 0;
  const LineDelayPasses found = track_with_line_delay(0.0, [&](double line_delay_s) {
    OdometryResult result;
    result.line_delay = {2e-5 - line_delay_s, ++pass == 2 ? 1e-5 : 1e-6, 20};
    return result;
  });
  EXPECT_EQ(found.passes, 3);
  EXPECT_EQ(found.line_delay_s, 0.0);
}

}  // namespace
}  // namespace tileflight::odometry::line_delay_test
