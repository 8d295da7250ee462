#include "tileflight/capture/render/auto_exposure.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <map>
#include <mutex>

#include "tileflight/capture/render/appearance.h"
#include "tileflight/capture/render/render_flight.h"
#include "tileflight/capture/render/test_scenes.h"

namespace tileflight::render::auto_exposure_test {
namespace {

using geometry::Vec3;
using test_scenes::grey;
using test_scenes::ground;
using test_scenes::looking_down;
using test_scenes::texture;

std::vector<double> times_s(int count, double step_s) {
  std::vector<double> times;
  for (int i = 0; i < count; ++i) times.push_back(step_s * i);
  return times;
}

TEST(AutoExposure, FollowsAStepOfLightAsAFirstOrderLag) {
  const AutoExposure options{.target = 0.2, .time_constant_s = 0.4};
  std::vector<double> light(40, 0.1);
  for (std::size_t i = 10; i < light.size(); ++i) light[i] = 0.4;
  std::optional<AutoExposureState> state;
  const std::vector<double> gains = exposure_gains(options, times_s(40, 0.05), light, state);
  for (std::size_t i = 0; i <= 10; ++i) EXPECT_NEAR(gains[i], 2.0, 1e-12);  // settled; the step is not known yet
  for (std::size_t i = 11; i < gains.size(); ++i) {
    const double since_s = 0.05 * (static_cast<double>(i) - 10.0);
    EXPECT_NEAR(std::log(gains[i]), std::log(0.5) + std::log(4.0) * std::exp(-since_s / 0.4), 1e-9) << i;
  }
}

TEST(AutoExposure, StaysWithinItsLimits) {
  const AutoExposure options{.target = 0.2, .time_constant_s = 0.0, .min_gain = 0.5, .max_gain = 4.0};
  std::optional<AutoExposureState> state;
  const std::vector<double> light{0.2, 1.0, 0.0, 0.2, 0.2};
  EXPECT_THAT(exposure_gains(options, times_s(5, 0.1), light, state),
              testing::Pointwise(testing::DoubleNear(1e-12), {1.0, 1.0, 0.5, 4.0, 1.0}));
}

TEST(AutoExposure, PartsOfAFlightGoOnWhereTheOneBeforeEnded) {
  const AutoExposure options{.target = 0.18};
  const std::vector<double> times = times_s(12, 0.1);
  std::vector<double> light;
  for (int i = 0; i < 12; ++i) light.push_back(0.1 + 0.05 * std::sin(i));
  std::optional<AutoExposureState> whole, parts;
  const std::vector<double> expected = exposure_gains(options, times, light, whole);
  std::vector<double> found;
  for (const auto& [begin, count] : {std::pair{0, 5}, {5, 1}, {6, 6}}) {
    const auto part = exposure_gains(
        options, std::span(times).subspan(static_cast<std::size_t>(begin), static_cast<std::size_t>(count)),
        std::span(light).subspan(static_cast<std::size_t>(begin), static_cast<std::size_t>(count)), parts);
    found.insert(found.end(), part.begin(), part.end());
  }
  EXPECT_EQ(found, expected);
}

TEST(AutoExposure, TheMeteringLensSeesTheSameField) {
  const imaging::Camera camera = imaging::make_fisheye(333, 181, 150.0, {-0.02, 0.001, 0, 0});
  const imaging::Camera small = metering_camera(camera);
  EXPECT_EQ(small.width(), 64);
  EXPECT_EQ(small.height(), 35);
  for (const geometry::Vec2& corner : {geometry::Vec2(-0.5, -0.5), geometry::Vec2(332.5, 90.0)}) {
    const Vec3 ray = *camera.unproject(corner);
    const geometry::Vec2 pixel = *small.project(ray);
    EXPECT_NEAR((pixel.x() + 0.5) / 64, (corner.x() + 0.5) / 333, 1e-9);
    EXPECT_NEAR((pixel.y() + 0.5) / 35, (corner.y() + 0.5) / 181, 1e-9);
  }
  EXPECT_EQ(metering_camera(imaging::make_pinhole(20, 10, 60.0)).width(), 20);
}

/// Dark ground in the west, bright in the east.
scene::Scene two_grounds() {
  return scene::Scene({ground(Vec3(-500, 0, 0), 1000.0, texture(2, 2, [](int, int) { return grey(60); })),
                       ground(Vec3(500, 0, 0), 1000.0, texture(2, 2, [](int, int) { return grey(200); }))});
}

TEST(AutoExposure, MeteredLightIsTheMeanOfThePicture) {
  const scene::Scene scene = two_grounds();
  const auto appearance = std::make_shared<const Appearance>(scene);
  const imaging::Camera camera = imaging::make_pinhole(128, 96, 60.0);
  const std::vector<geometry::StampedPose> poses{{0.0, looking_down({-200, 0, 50})}, {1.0, looking_down({0, 0, 50})}};
  const std::vector<double> light = meter_light(scene, appearance, camera, {}, {}, poses);
  EXPECT_NEAR(light[0], srgb_decode(60), 1e-4);
  EXPECT_NEAR(light[1], 0.5 * (srgb_decode(60) + srgb_decode(200)), 1e-4);
  // V = 1 - 0.5 (r / r_corner)^2 over the 64 x 48 pixels of the metering picture, whose corners are pixel centres.
  const double mean_square = (64.0 * 64 - 1 + 48.0 * 48 - 1) / 12, corner_square = (63.0 * 63 + 47.0 * 47) / 4;
  const std::vector<double> vignetted = meter_light(scene, appearance, camera, {}, {.vignetting = 0.5}, poses);
  EXPECT_NEAR(vignetted[0], srgb_decode(60) * (1.0 - 0.5 * mean_square / corner_square), 1e-4 * srgb_decode(60));
}

TEST(AutoExposure, AFlightIntoTheLightIsDazzledAndAdapts) {
  const scene::Scene scene = two_grounds();
  geometry::Trajectory frames;
  for (int i = 0; i < 30; ++i) frames.poses.push_back({0.1 * i, looking_down({i < 10 ? -200.0 : 200.0, 0, 50})});
  struct Seen {
    int grey;
    double exposure_ms;
  };
  const auto fly = [&](std::size_t threads, std::size_t cut) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    std::mutex mutex;
    std::map<std::size_t, Seen> seen;
    FlightRenderOptions options;
    options.formation.exposure_time_s = 0.001;
    options.formation.exposure_samples = 1;
    options.formation.auto_exposure = {.target = 0.18, .time_constant_s = 0.3};
    for (const auto& [begin, end] : {std::pair{std::size_t{0}, cut}, {cut, std::size_t{30}}}) {
      options.first_frame = begin;
      options.end_frame = end;
      const auto report =
          render_flight(scene, imaging::make_pinhole(64, 48, 60.0), frames, {}, options, [&](const FlightFrame& frame) {
            const std::scoped_lock lock(mutex);
            seen[frame.index] = {frame.rgb(32, 24)[1], frame.exposure_ms};
          });
      options.exposure_before = report.exposure_after;
    }
    return seen;
  };
  const auto seen = fly(2, 30);
  const int middle = static_cast<int>(std::lround(srgb_encode(0.18)));
  EXPECT_NEAR(seen.at(9).grey, middle, 1);
  EXPECT_NEAR(seen.at(9).exposure_ms, 0.18 / srgb_decode(60), 1e-3);
  EXPECT_EQ(seen.at(10).grey, 255);          // over-exposed at the gain for the dark
  EXPECT_NEAR(seen.at(29).grey, middle, 2);  // adapted
  EXPECT_GT(seen.at(13).grey, seen.at(16).grey);
  for (const auto& other : {fly(1, 30), fly(4, 12), fly(2, 10)}) {
    for (const auto& [index, frame] : seen) {
      EXPECT_EQ(other.at(index).grey, frame.grey) << index;
      EXPECT_EQ(other.at(index).exposure_ms, frame.exposure_ms) << index;
    }
  }
}

}  // namespace
}  // namespace tileflight::render::auto_exposure_test
