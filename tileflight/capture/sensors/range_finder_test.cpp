#include "tileflight/capture/sensors/range_finder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tileflight/capture/render/test_scenes.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::sensors::range_finder_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

scene::Scene ground_at(double z_m) {
  return scene::Scene({render::test_scenes::ground(
      Vec3(0, 0, z_m), 400.0,
      render::test_scenes::texture(1, 1, [](int, int) { return render::test_scenes::grey(128); }))});
}

std::vector<RangeSample> measure(const scene::Scene& scene, const render::PoseFunction& pose, double seconds,
                                 const RangeFinderOptions& options) {
  const flight_path::SampleTimes times = flight_path::make_sample_times("range finder", 0.0, seconds, options.rate_hz);
  return simulate_range_finder(scene, pose, times, 0, times.count(), options);
}

render::PoseFunction climbing(double speed_m_s) {
  return [=](double t) { return render::test_scenes::looking_along(Vec3(0, 0, 10 + speed_m_s * t), Vec3(0, 1, -1)); };
}

TEST(RangeFinder, HeightAboveTheGroundHoweverTheCameraLooks) {
  const scene::Scene scene = ground_at(2.0);
  const std::vector<RangeSample> samples = measure(scene, climbing(3.0), 5.0, {.noise_m = 0.0});
  ASSERT_FALSE(samples.empty());
  for (const RangeSample& sample : samples) EXPECT_NEAR(sample.range_m, 8 + 3 * sample.time_s, 1e-9);
}

TEST(RangeFinder, AlongTheCamerasAxisFromItsOwnPlace) {
  const scene::Scene scene = ground_at(0.0);
  RangeFinderOptions options{.direction = Vec3(0, 0, 2), .direction_is_local = false, .beam_width_deg = 0.0};
  options.rays = 1;
  options.noise_m = 0.0;
  options.position_camera = Vec3(0.3, 0, 0.5);
  EXPECT_NEAR(measure(scene, climbing(0.0), 0.0, options).at(0).range_m, 10 * std::sqrt(2.0) - 0.5, 1e-9);
}

// A cone of half angle a that looks along the ground at elevation e meets it first on its lower rim: h / sin(e + a).
TEST(RangeFinder, TheNearestWithinTheBeamCounts) {
  const scene::Scene scene = ground_at(0.0);
  RangeFinderOptions options{.direction = Vec3(0, 1, -1), .beam_width_deg = 20.0, .rays = 2000, .noise_m = 0.0};
  const double expected = 10.0 / std::sin((45.0 + 10.0) * M_PI / 180.0);
  EXPECT_NEAR(measure(scene, climbing(0.0), 0.0, options).at(0).range_m, expected, 0.01);
}

TEST(RangeFinder, OutOfReachIsInfinite) {
  const scene::Scene scene = ground_at(0.0);
  const RangeFinderOptions options{.min_range_m = 12.0, .max_range_m = 20.0, .noise_m = 0.0};
  const auto samples = measure(scene, climbing(1.0), 15.0, options);
  EXPECT_EQ(samples.front().range_m, -kInfinity);
  EXPECT_EQ(samples.back().range_m, kInfinity);
  EXPECT_NEAR(samples[100].range_m, 15.0, 1e-9);
  EXPECT_EQ(measure(ground_at(50.0), climbing(1.0), 0.0, {}).at(0).range_m, kInfinity);
}

TEST(RangeFinder, NoiseHasItsSizeAndASampleDependsOnItsNumberAlone) {
  const scene::Scene scene = ground_at(0.0);
  const RangeFinderOptions options{.rate_hz = 1000.0, .rays = 1, .noise_m = 0.03, .noise_share = 0.004};
  const auto samples = measure(scene, climbing(0.0), 20.0, options);
  double squares = 0.0;
  for (const RangeSample& sample : samples) squares += std::pow(sample.range_m - 10.0, 2);
  EXPECT_NEAR(std::sqrt(squares / static_cast<double>(samples.size())), 0.05, 0.002);
  const auto part = simulate_range_finder(scene, climbing(0.0), {0.0, 20.0, 1000.0}, 700, 703, options);
  ASSERT_EQ(part.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(part[i].range_m, samples[700 + i].range_m);
}

TEST(RangeFinder, RefusesImpossibleOptions) {
  EXPECT_THAT([&] { check(RangeFinderOptions{.direction = Vec3::Zero()}); },
              ThrowsMessage<InputError>(HasSubstr("range finder direction: must not be zero")));
  EXPECT_THAT([&] { check(RangeFinderOptions{.rays = 0}); },
              ThrowsMessage<InputError>(HasSubstr("range finder rays: must be 1 to 10000")));
  EXPECT_THAT([&] { check(RangeFinderOptions{.min_range_m = 5, .max_range_m = 4}); },
              ThrowsMessage<InputError>(HasSubstr("range finder max_range: must be more than min_range")));
}

}  // namespace
}  // namespace tileflight::sensors::range_finder_test
