// Pixels that see known curves of light, against when each curve passes the thresholds.
#include "tileflight/capture/events/event_pixels.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <functional>
#include <numbers>

#include "tests/refusal.h"

namespace tileflight::events::event_pixels_test {
namespace {

using Curve = std::function<double(double time_s)>;

/// Thresholds that are all alike, and no noise.
EventOptions ideal() {
  return {.threshold_sigma = 0.0, .refractory_s = 0.0, .leak_rate_hz = 0.0, .shot_noise_rate_hz = 0.0};
}

imaging::FloatImage uniform(int width, int height, double value) { return {width, height, static_cast<float>(value)}; }

/// The events of a picture without structure whose log light follows a curve, sampled at even steps.
std::vector<Event> watch(const EventOptions& options, const Curve& log_light, double end_s, int steps, int width = 1,
                         int height = 1) {
  EventPixels pixels(width, height, options);
  pixels.start(uniform(width, height, log_light(0.0)), 0.0);
  std::vector<Event> events;
  for (int k = 1; k <= steps; ++k) {
    const double time_s = end_s * k / steps;
    const std::vector<Event> next = pixels.advance(uniform(width, height, log_light(time_s)), time_s, 0.0);
    events.insert(events.end(), next.begin(), next.end());
  }
  return events;
}

TEST(EventPixels, ARampGivesAnEventAtEachThreshold) {
  EventOptions options = ideal();
  options.positive_threshold = 0.25;
  const std::vector<Event> events = watch(
      options, [](double t) { return -2.0 + 2.0 * t; }, 0.99, 7);
  ASSERT_EQ(events.size(), 7U);
  for (std::size_t k = 0; k < events.size(); ++k) {
    EXPECT_NEAR(events[k].t_us, 1e6 * 0.125 * static_cast<double>(k + 1), 1.0);
    EXPECT_EQ(events[k].polarity, 1);
  }
}

TEST(EventPixels, ASineGivesThoseOfItsTurns) {
  EventOptions options = ideal();
  options.positive_threshold = 0.3;
  options.negative_threshold = 0.2;
  // Up from 0 to 1 in the first quarter: 0.3, 0.6, 0.9. Down to -1: from 0.9 at 0.7, 0.5, … -0.9. Up to 0: -0.6, -0.3,
  // 0.
  const double w = 2.0 * std::numbers::pi;
  const std::vector<Event> events = watch(
      options, [w](double t) { return std::sin(w * t); }, 0.9999, 20000);
  std::vector<double> expected;
  for (const double level : {0.3, 0.6, 0.9}) expected.push_back(std::asin(level) / w);
  for (int k = 0; k < 9; ++k) expected.push_back((std::numbers::pi - std::asin(0.7 - 0.2 * k)) / w);
  for (const double level : {-0.6, -0.3}) expected.push_back(1.0 + std::asin(level) / w);
  ASSERT_EQ(events.size(), expected.size());
  for (std::size_t k = 0; k < events.size(); ++k) {
    EXPECT_NEAR(events[k].t_us, 1e6 * expected[k], 10.0) << k;
    EXPECT_EQ(events[k].polarity, k < 3 || k >= 12 ? 1 : 0) << k;
  }
}

/// The largest error of an event's time on a curve that is not straight.
double worst_error_s(int steps) {
  EventOptions options = ideal();
  const auto log_light = [](double t) { return std::log(0.05 + t); };
  const std::vector<Event> events = watch(options, log_light, 0.9, steps);
  double worst = 0.0;
  for (std::size_t k = 0; k < events.size(); ++k) {
    const double exact_s = 0.05 * std::exp(0.2 * static_cast<double>(k + 1)) - 0.05;
    worst = std::max(worst, std::abs(1e-6 * (events[k].t_us + 0.5) - exact_s));
  }
  EXPECT_EQ(events.size(), 14U);  // log(0.95 / 0.05) / 0.2 = 14.7
  return worst;
}

TEST(EventPixels, HalfTheStepQuartersTheErrorOfTimes) {
  for (const int steps : {64, 128, 256}) {
    const double coarse = worst_error_s(steps), fine = worst_error_s(2 * steps);
    EXPECT_LT(coarse, 0.9 / steps);
    EXPECT_LT(fine, coarse / 2.5);
  }
}

TEST(EventPixels, TheRefractoryTimeFollowsEachEvent) {
  EventOptions options = ideal();
  options.refractory_s = 0.03;
  // Each event needs 0.2 / 4 s of the slope after the 0.03 s of the one before, in which the pixel is held in reset.
  for (const int steps : {3, 11, 500}) {
    const std::vector<Event> events = watch(
        options, [](double t) { return 4.0 * t; }, 1.0, steps);
    ASSERT_EQ(events.size(), 12U);
    for (std::size_t k = 0; k < events.size(); ++k)
      EXPECT_NEAR(events[k].t_us, 1e6 * (0.05 + 0.08 * static_cast<double>(k)), 1.5);
  }
}

TEST(EventPixels, LeaksGiveOnEventsAtTheirRate) {
  EventOptions options = ideal();
  options.leak_rate_hz = 2.0;
  const std::vector<Event> events = watch(
      options, [](double) { return -1.0; }, 10.0, 100, 40, 50);
  EXPECT_EQ(events.size(), 2000U * 20U);
  for (const Event& event : events) EXPECT_EQ(event.polarity, 1);
  // Not all at once: the pixels began anywhere within a threshold.
  const auto first_tenth = std::ranges::count_if(events, [](const Event& event) { return event.t_us < 50000; });
  EXPECT_NEAR(static_cast<double>(first_tenth), 200.0, 60.0);
}

TEST(EventPixels, ShotNoiseIsAPoissonProcessThatFadesWithLight) {
  EventOptions options = ideal();
  options.shot_noise_rate_hz = 5.0;
  const auto noise = [&](double light) {
    const double log_light = std::log(light + options.dark_light);
    return watch(
        options, [log_light](double) { return log_light; }, 4.0, 40, 50, 50);
  };
  constexpr double kMean = 2500.0 * 4.0 * 5.0;  // in the dark
  for (const auto& [light, share] : {std::pair(0.0, 1.0), {0.4, 0.7}, {1.0, 0.25}}) {
    const std::vector<Event> events = noise(light);
    const auto count = static_cast<double>(events.size());
    EXPECT_NEAR(count, share * kMean, 4.0 * std::sqrt(kMean)) << light;
    const auto on =
        static_cast<double>(std::ranges::count_if(events, [](const Event& event) { return event.polarity == 1; }));
    EXPECT_NEAR(on / count, 0.5, 2.0 / std::sqrt(count));
    // Counts of single pixels have a variance equal to their mean.
    std::vector<double> of_pixel(2500, 0.0);
    for (const Event& event : events) of_pixel[event.y * 50U + event.x] += 1.0;
    double square = 0.0;
    for (const double n : of_pixel) square += (n - count / 2500.0) * (n - count / 2500.0) / 2500.0;
    EXPECT_NEAR(square / (count / 2500.0), 1.0, 0.12);
  }
}

TEST(EventPixels, ThresholdsSpreadFromPixelToPixel) {
  EventOptions options = ideal();
  options.threshold_sigma = 0.03;
  constexpr std::size_t kPixels = 20000;
  double sum = 0.0, squares = 0.0, product = 0.0;
  for (std::size_t i = 0; i < kPixels; ++i) {
    const PixelThresholds one = pixel_thresholds(options, i);
    sum += one.positive - 0.2;
    squares += (one.positive - 0.2) * (one.positive - 0.2);
    product += (one.positive - 0.2) * (one.negative - 0.2);
  }
  EXPECT_NEAR(sum / kPixels, 0.0, 0.001);
  EXPECT_NEAR(std::sqrt(squares / kPixels), 0.03, 0.001);
  EXPECT_NEAR(product / squares, 0.0, 0.03);
  options.threshold_sigma = 1.0;
  for (std::size_t i = 0; i < kPixels; ++i) EXPECT_GE(pixel_thresholds(options, i).positive, 0.01F);
  // Seen in events, too: the first of a ramp tells a pixel's threshold.
  options.threshold_sigma = 0.03;
  const std::vector<Event> events = watch(
      options, [](double t) { return t; }, 0.3, 3, 100, 1);
  std::vector<bool> seen(100, false);
  for (const Event& event : events) {
    if (!seen[event.x]) {
      EXPECT_NEAR(1e-6 * event.t_us, pixel_thresholds(options, event.x).positive, 2e-6);
    }
    seen[event.x] = true;
  }
}

TEST(EventPixels, EventsAreInOrder) {
  const std::vector<Event> events = watch(
      {.leak_rate_hz = 1.0, .shot_noise_rate_hz = 3.0}, [](double t) { return std::sin(9.0 * t); }, 1.0, 30, 20, 20);
  ASSERT_GT(events.size(), 1000U);
  for (std::size_t k = 1; k < events.size(); ++k) {
    const Event &a = events[k - 1], &b = events[k];
    ASSERT_LE(std::tuple(a.t_us, a.y, a.x), std::tuple(b.t_us, b.y, b.x));
  }
}

TEST(EventPixels, WhatIsSeenInAnotherWayGivesNoEvent) {
  EventPixels pixels(3, 2, ideal());
  pixels.start(uniform(3, 2, -1.0), 0.0);
  EXPECT_TRUE(pixels.advance(uniform(3, 2, -0.9), 1.0, 0.0).empty());
  pixels.replace(uniform(3, 2, 4.0));
  EXPECT_TRUE(pixels.advance(uniform(3, 2, 4.05), 2.0, 0.0).empty());
  EXPECT_EQ(pixels.advance(uniform(3, 2, 4.15), 3.0, 0.0).size(), 6U);  // 0.1 before, and 0.15 since
}

TEST(EventPixels, SameEventsForAnyNumberOfThreads) {
  const auto made = [](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return watch(
        {.seed = 7, .shot_noise_rate_hz = 3.0}, [](double t) { return std::sin(9.0 * t); }, 1.0, 30, 64, 64);
  };
  EXPECT_EQ(made(1), made(2));
}

TEST(EventPixels, AnotherSeedIsAnotherCamera) {
  const auto made = [](std::uint64_t seed) {
    return watch(
        {.seed = seed}, [](double t) { return std::sin(9.0 * t); }, 1.0, 30, 8, 8);
  };
  EXPECT_NE(made(1), made(2));
}

TEST(EventPixels, MoreEventsThanCanBeHeldAreRefused) {
  EventOptions options = ideal();
  options.positive_threshold = 0.01;
  EventPixels pixels(20, 10, options, 100000);
  pixels.start(uniform(20, 10, -7.0), 0.0);
  EXPECT_EQ(pixels.advance(uniform(20, 10, -4.005), 0.001, 0.0).size(), 200U * 299U);
  EXPECT_THAT(tests::refusal_of([&] { pixels.advance(uniform(20, 10, 2.0), 0.002, 0.0); }),
              testing::HasSubstr("events between two samples of the light; raise the thresholds"));
}

}  // namespace
}  // namespace tileflight::events::event_pixels_test
