#include "tileflight/core/alignment/time_offset.h"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <random>

namespace tileflight::alignment::time_offset_test {
namespace {

using geometry::so3_exp;
using geometry::Vec3;
using testing::HasSubstr;

using Motion = std::function<Vec3(double)>;

constexpr double kOffset_s = 3.217;  ///< the first clock's time minus the second's
const geometry::Mat3 kTurn = so3_exp({0.4, -1.1, 2.0}).toRotationMatrix();

/// Rotation like that of a drone: sums of waves that do not repeat within minutes.
Vec3 turning(double t) {
  return {0.2 * std::sin(1.9 * t) + 0.1 * std::sin(0.31 * t + 1), 0.15 * std::sin(1.1 * t + 2),
          0.5 * std::sin(0.7 * t) + 0.3 * std::sin(0.43 * t * std::sqrt(5.0))};
}

std::vector<TimedVector> sampled(const Motion& motion, double from_s, double to_s, double rate_hz, double sigma,
                                 unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, 1);
  std::vector<TimedVector> signal;
  for (double t = from_s; t < to_s; t += 1 / rate_hz)
    signal.push_back({t, motion(t) + sigma * Vec3(normal(random), normal(random), normal(random))});
  return signal;
}

/// A motion recorded with the first clock, and rotated with the second clock.
TimeOffset estimated(const Motion& motion, double sigma, unsigned seed, const TimeOffsetOptions& options = {}) {
  const auto on_second = [&](double t) { return Vec3(kTurn.transpose() * motion(t + kOffset_s)); };
  return estimate_time_offset(sampled(motion, 0, 30, 30, sigma, seed),
                              sampled(on_second, -10, 45, 97, sigma, seed + 1000), options);
}

TEST(TimeOffset, IsFoundWithTheTurnBetweenTheFrames) {
  const TimeOffset offset = estimated(turning, 0.02, 1);
  ASSERT_TRUE(offset.determined) << offset.reason;
  EXPECT_NEAR(offset.offset_s, kOffset_s, 0.005);
  EXPECT_LT((offset.R_first_second - kTurn).norm(), 0.02);
  EXPECT_GT(offset.explained_variance, 0.98);
  EXPECT_LT(offset.sigma_s, 0.005);
}

TEST(TimeOffset, WithoutNoiseItIsExact) {
  const TimeOffset offset = estimated(turning, 0, 1);
  ASSERT_TRUE(offset.determined);
  EXPECT_NEAR(offset.offset_s, kOffset_s, 5e-4);
}

/// The errors of forty flights with noise are as large as their sigmas say.
TEST(TimeOffset, SigmaIsWhatItErrsBy) {
  double squares = 0;
  const int flights = 40;
  for (unsigned seed = 0; seed < flights; ++seed) {
    const TimeOffset offset = estimated(turning, 0.15, 10 + seed);
    ASSERT_TRUE(offset.determined) << offset.reason;
    squares += std::pow((offset.offset_s - kOffset_s) / offset.sigma_s, 2);
  }
  EXPECT_GT(std::sqrt(squares / flights), 0.6);
  EXPECT_LT(std::sqrt(squares / flights), 1.6);
}

TEST(TimeOffset, AnUnknownScaleIsFound) {
  const auto smaller = [](double t) { return Vec3(0.125 * kTurn.transpose() * turning(t + kOffset_s)); };
  const TimeOffset offset = estimate_time_offset(sampled(turning, 0, 30, 30, 0.02, 1),
                                                 sampled(smaller, -10, 45, 10, 0.002, 2), {.estimate_scale = true});
  ASSERT_TRUE(offset.determined) << offset.reason;
  EXPECT_NEAR(offset.offset_s, kOffset_s, 0.01);
  EXPECT_NEAR(offset.scale, 8, 0.2);
}

TEST(TimeOffset, AShortFilmWithinALongLog) {
  const auto log = [](double t) { return turning(t + kOffset_s); };
  const TimeOffset offset =
      estimate_time_offset(sampled(turning, 100, 112, 30, 0.02, 1), sampled(log, 0, 600, 25, 0.02, 2));
  ASSERT_TRUE(offset.determined) << offset.reason;
  EXPECT_NEAR(offset.offset_s, kOffset_s, 0.01);
}

TEST(TimeOffset, GapsOfALogAreLeftOut) {
  auto log = sampled([](double t) { return turning(t + kOffset_s); }, -10, 45, 97, 0.02, 2);
  std::erase_if(log, [](const TimedVector& sample) { return sample.time_s > 10 && sample.time_s < 14; });
  const TimeOffset offset = estimate_time_offset(sampled(turning, 0, 30, 30, 0.02, 1), log);
  ASSERT_TRUE(offset.determined) << offset.reason;
  EXPECT_NEAR(offset.offset_s, kOffset_s, 0.005);
}

TEST(TimeOffset, AStraightFlightDoesNotTellIt) {
  const TimeOffset still = estimated([](double) { return Vec3(0.1, 0, 0); }, 0.05, 3);
  EXPECT_FALSE(still.determined);
  EXPECT_THAT(still.reason, HasSubstr("too uniform"));
}

TEST(TimeOffset, MotionsThatHaveNothingInCommonDoNotTellIt) {
  int determined = 0;
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal(0, 1);
    std::vector<TimedVector> walk[2];
    for (int which = 0; which < 2; ++which) {
      Vec3 value = Vec3::Zero();
      for (double t = 0; t < 30 + 20 * which; t += 0.1) {
        value = 0.9 * value + 0.1 * Vec3(normal(random), normal(random), normal(random));
        walk[which].push_back({t, value});
      }
    }
    determined += estimate_time_offset(walk[0], walk[1]).determined ? 1 : 0;
  }
  EXPECT_EQ(determined, 0);
}

TEST(TimeOffset, ARepeatedMotionDoesNotTellIt) {
  const TimeOffset swing = estimated([](double t) { return Vec3(0, 0, 0.5 * std::sin(2 * t)); }, 0.02, 4);
  EXPECT_FALSE(swing.determined);
  EXPECT_THAT(swing.reason, HasSubstr("the motion repeats"));
}

TEST(TimeOffset, ShortSignalsDoNotTellIt) {
  EXPECT_THAT(estimate_time_offset({}, {}).reason, HasSubstr("fewer than two samples"));
  const auto shorter = sampled(turning, 0, 3, 30, 0, 1);
  EXPECT_THAT(estimate_time_offset(shorter, shorter).reason, HasSubstr("overlap too little in time"));
}

}  // namespace
}  // namespace tileflight::alignment::time_offset_test
