#include "tileflight/capture/render/streaks.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <variant>

#include "tileflight/capture/render/render_flight.h"
#include "tileflight/capture/render/test_scenes.h"

namespace tileflight::render::streaks_test {
namespace {

using geometry::Box3;
using geometry::SE3;
using geometry::Vec2;
using geometry::Vec3;
using scene::Scene;
using namespace test_scenes;

std::shared_ptr<const WeatherOptions> shared(const WeatherOptions& weather) {
  return std::make_shared<const WeatherOptions>(weather);
}

TEST(Precipitation, DropsAreAsManyAsMarshallAndPalmerSay) {
  const WeatherOptions weather{.rain_mm_per_h = 12.0};
  const auto classes = particle_classes(PrecipitationKind::kRain, weather);
  const Box3 box(Vec3(-3, 50, 10), Vec3(5, 56, 17));
  const double slope = 4.1 * std::pow(12.0, -0.21);
  for (const double time_s : {0.0, 3.21, 86400.0}) {
    const std::vector<Particle> drops = particles_in(classes, box, time_s);
    // By diameter: N0 / L (exp(-L low) - exp(-L high)) a cubic metre, within 4.5 standard deviations of a Poisson
    // count.
    for (double low = 0.5; low < 3.0; low += 0.25) {
      const double expected =
          box.volume() * 8000.0 / slope * (std::exp(-slope * low) - std::exp(-slope * (low + 0.25)));
      const auto count = std::ranges::count_if(
          drops, [&](const Particle& p) { return 1e3 * p.diameter_m >= low && 1e3 * p.diameter_m < low + 0.25; });
      EXPECT_NEAR(static_cast<double>(count), expected, 4.5 * std::sqrt(expected) + 1.0) << low << " mm at " << time_s;
    }
    Vec3 mean = Vec3::Zero();
    for (const Particle& p : drops) mean += p.position / static_cast<double>(drops.size());
    const Vec3 spread = box.sizes() / std::sqrt(12.0 * static_cast<double>(drops.size()));
    for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(mean[axis], box.center()[axis], 4.5 * spread[axis]);
  }
}

TEST(Precipitation, WaterThatFallsIsTheRate) {
  // The flux of the volume of the drops, pi/6 D^3 v(D) N(D): Marshall and Palmer's law and the speeds fit to within a
  // fifth. Drops below half a millimetre are few of it.
  for (const double rate : {2.0, 10.0, 50.0}) {
    double flux_mm_per_h = 0.0;
    for (const ParticleClass& one : particle_classes(PrecipitationKind::kRain, {.rain_mm_per_h = rate})) {
      const double volume_m3 = std::numbers::pi / 6.0 * std::pow(one.mean_diameter_m(), 3);
      flux_mm_per_h += one.count_per_m3() * volume_m3 * -one.velocity_m_s().z() * 1e3 * 3600.0;
    }
    EXPECT_NEAR(flux_mm_per_h, rate, 0.2 * rate);
  }
}

TEST(Precipitation, DropsFallWithTheirSpeedAndDriftWithTheWind) {
  const WeatherOptions weather{.rain_mm_per_h = 20.0, .wind_m_s = {4, -2, 0}};
  EXPECT_NEAR(drop_speed_m_s(2.0), 9.65 - 10.3 * std::exp(-1.2), 1e-12);
  EXPECT_NEAR(drop_speed_m_s(1.0), 4.03, 0.1) << "Gunn and Kinzer measured 4.03 m/s";
  EXPECT_NEAR(drop_speed_m_s(3.0), 8.06, 0.13);
  EXPECT_NEAR(drop_speed_m_s(5.0), 9.09, 0.1);
  for (const ParticleClass& one : particle_classes(PrecipitationKind::kRain, weather)) {
    const Box3 box(Vec3(0, 0, 0), Vec3(6, 6, 6));
    const Vec3 moved = 0.37 * one.velocity_m_s();
    EXPECT_EQ(one.velocity_m_s().head<2>(), Vec2(4, -2));
    const auto before = particles_in({one}, box, 5.0);
    const auto after = particles_in({one}, Box3(box.min() + moved, box.max() + moved), 5.37);
    ASSERT_EQ(before.size(), after.size());
    for (std::size_t i = 0; i < before.size(); ++i) {
      EXPECT_LT((before[i].position + moved - after[i].position).norm(), 1e-9);
      EXPECT_EQ(before[i].diameter_m, after[i].diameter_m);
    }
  }
}

TEST(Precipitation, FlakesAreSlowAndSeedsDiffer) {
  EXPECT_NEAR(flake_speed_m_s(1.0), 0.80, 0.01);
  EXPECT_NEAR(flake_diameter_mm(1.0), std::cbrt(10.0), 1e-12);
  const Box3 box(Vec3(0, 0, 0), Vec3(4, 4, 4));
  WeatherOptions weather{.snow_mm_per_h = 2.0};
  const auto some = particles_in(particle_classes(PrecipitationKind::kSnow, weather), box, 1.0);
  weather.seed = 2;
  const auto others = particles_in(particle_classes(PrecipitationKind::kSnow, weather), box, 1.0);
  ASSERT_FALSE(some.empty());
  ASSERT_FALSE(others.empty());
  EXPECT_NE(some.front().position, others.front().position);
  EXPECT_TRUE(particle_classes(PrecipitationKind::kRain, weather).empty());
}

const imaging::Camera kCamera = imaging::make_pinhole(320, 240, 80.0);
double focal_px() {
  return std::visit([](const auto& lens) { return lens.fx; }, kCamera.model());
}

StreakShutter still(const SE3& T, double time_s, double open_s) {
  return {[T](double) { return T; }, time_s, open_s, 0.0};
}

TEST(Streaks, HaveTheLengthOfFallTimesExposure) {
  const StreakRenderer renderer({.weather = shared({.rain_mm_per_h = 30.0})}, 0.0);
  const SE3 T = looking_along({0, 0, 0}, {0, 1, 0});
  const double open_s = 0.008;
  const auto streaks = renderer.streaks(kCamera, still(T, 4.0, open_s));
  ASSERT_GT(streaks.size(), 100U);
  int compared = 0;
  for (const Streak& streak : streaks) {
    // Straight down, by f v T / z, where v is the speed of one of the classes.
    EXPECT_NEAR(streak.from_px.x(), streak.to_px.x(), 1e-6);
    const double speed_m_s = (streak.to_px.y() - streak.from_px.y()) * streak.depth_m / (focal_px() * open_s);
    const auto classes = particle_classes(PrecipitationKind::kRain, {.rain_mm_per_h = 30.0});
    const bool is_known = std::ranges::any_of(
        classes, [&](const ParticleClass& one) { return std::abs(-one.velocity_m_s().z() - speed_m_s) < 1e-6; });
    EXPECT_TRUE(is_known) << speed_m_s;
    ++compared;
  }
  EXPECT_GT(compared, 100);
}

TEST(Streaks, LeanAsTheCameraFlies) {
  // v = drop - camera: a camera that flies ahead at 12 m/s to its right sees drops fall to its left.
  const StreakRenderer renderer({.weather = shared({.rain_mm_per_h = 30.0})}, 0.0);
  const SE3 T = looking_along({0, 0, 0}, {0, 1, 0});
  const auto flying = [&](double time_s) { return SE3(T.rotation, T.translation + Vec3(12.0 * (time_s - 4.0), 0, 0)); };
  const auto streaks = renderer.streaks(kCamera, {flying, 4.0, 0.005, 0.0});
  ASSERT_GT(streaks.size(), 100U);
  for (const Streak& streak : streaks) {
    const Vec2 way = (streak.to_px - streak.from_px) * streak.depth_m / (focal_px() * 0.005);
    EXPECT_NEAR(way.x(), -12.0, 1e-6);
    EXPECT_GT(way.y(), 1.5);
    EXPECT_LT(way.y(), 9.6);
  }
}

TEST(Streaks, OfARollingShutterAreWhereTheRowsSeeThem) {
  // A row is late by its number times the delay: the same drops as with a global shutter at that time, to a hundredth
  // of a pixel.
  const StreakRenderer renderer({.weather = shared({.rain_mm_per_h = 10.0})}, 0.0);
  const SE3 T = looking_along({0, 0, 0}, {0, 1, 0});
  const double delay_s = 40e-6;
  StreakShutter rolling = still(T, 2.0, 0.002);
  rolling.line_delay_s = delay_s;
  int compared = 0;
  for (const Streak& streak : renderer.streaks(kCamera, rolling)) {
    const Vec2 middle = 0.5 * (streak.from_px + streak.to_px);
    if (middle.y() < 1.0 || middle.y() > 238.0 || streak.distance_m > 0.8) continue;  // within reach of each class
    const double row_s = 2.0 + (std::lround(middle.y()) - 119.5) * delay_s;
    double nearest_px = 1e9;
    if (++compared > 20) break;
    for (const Streak& one : renderer.streaks(kCamera, still(T, row_s, 0.002)))
      nearest_px = std::min(nearest_px, (0.5 * (one.from_px + one.to_px) - middle).norm());
    EXPECT_LT(nearest_px, 0.05);
  }
  EXPECT_GT(compared, 10);
}

TEST(Streaks, OfACameraWithAnotherClockAreThoseOfTheTrueInstant) {
  const StreakRenderer renderer({.weather = shared({.rain_mm_per_h = 5.0})}, 0.0);
  const SE3 T = looking_along({0, 0, 0}, {0, 1, 0});
  const auto expected = renderer.streaks(kCamera, still(T, 7.5, 0.001));
  StreakShutter late = still(T, 7.25, 0.001);
  late.weather_offset_s = 0.25;
  const auto found = renderer.streaks(kCamera, late);
  ASSERT_EQ(found.size(), expected.size());
  ASSERT_GT(found.size(), 100U);
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_LT((found[i].from_px - expected[i].from_px).norm(), 1e-6);
    EXPECT_LT((found[i].to_px - expected[i].to_px).norm(), 1e-6);
  }
}

TEST(Streaks, OfTwoCamerasAreTheSameDrops) {
  // A stereo pair: each drop of the left picture, moved by its disparity, is one of the right.
  const StreakRenderer renderer({.weather = shared({.rain_mm_per_h = 5.0})}, 0.0);
  const SE3 left = looking_along({0, 0, 0}, {0, 1, 0}), right = looking_along({0.2, 0, 0}, {0, 1, 0});
  const auto seen_left = renderer.streaks(kCamera, still(left, 7.5, 0.001));
  const auto seen_right = renderer.streaks(kCamera, still(right, 7.5, 0.001));
  int compared = 0;
  for (const Streak& streak : seen_left) {
    const Vec2 expected = streak.from_px - Vec2(focal_px() * 0.2 / streak.depth_m, 0.0);
    const bool is_inside = expected.x() > 5.0 && expected.y() > 5.0 && expected.y() < 235.0;
    if (!is_inside || streak.distance_m > 0.8) continue;  // nearer than what any class is drawn to
    ++compared;
    EXPECT_TRUE(
        std::ranges::any_of(seen_right, [&](const Streak& one) { return (one.from_px - expected).norm() < 1e-6; }));
  }
  EXPECT_GT(compared, 50);
}

TEST(Streaks, CoverTheAreaOfTheirDrops) {
  // One white drop on black: the light that it adds is its area, pi/4 (f D / z)^2, wherever and however it lies.
  for (const Vec3& wind : {Vec3(0, 0, 0), Vec3(9, 0, 0), Vec3(-3, 0, 0)}) {
    WeatherOptions weather{.rain_mm_per_h = 20.0};
    weather.wind_m_s = wind;
    const StreakRenderer renderer({.background = {0, 0, 0}, .weather = shared(weather)}, 0.0);
    const SE3 T = looking_along({0, 0, 0}, {0, 1, 0});
    double expected = 0.0;
    for (const Streak& one : renderer.streaks(kCamera, still(T, 1.0, 0.004))) {
      const Vec2 middle = 0.5 * (one.from_px + one.to_px);
      if (middle.x() < 0 || middle.x() > 319 || middle.y() < 0 || middle.y() > 239) continue;
      expected += one.opacity * one.width_px * streak_length_px(one);
    }
    // Light of the drops is that of a black sky; what they take of a white picture is their area.
    LinearImage light(320, 240, LinearRgb{1, 1, 1});
    const imaging::FloatImage depth(320, 240, INFINITY);
    renderer.draw(kCamera, still(T, 1.0, 0.004), depth, light);
    double taken = 0.0;
    for (const LinearRgb& pixel : light.pixels) taken += 1.0 - pixel[1];
    EXPECT_NEAR(taken, expected, 0.06 * expected) << wind.transpose();  // those that overlap, and at the border
  }
}

TEST(Streaks, AreHiddenBySurfaces) {
  const StreakRenderer renderer({.weather = shared({.rain_mm_per_h = 40.0})}, 0.0);
  const SE3 T = looking_along({0, 0, 0}, {0, 1, 0});
  const auto changed = [&](float depth_m) {
    LinearImage light(320, 240, LinearRgb{0, 0, 0});
    renderer.draw(kCamera, still(T, 1.0, 0.004), imaging::FloatImage(320, 240, depth_m), light);
    return std::ranges::count_if(light.pixels, [](const LinearRgb& pixel) { return pixel[1] > 0.0F; });
  };
  EXPECT_GT(changed(INFINITY), 1000);
  EXPECT_LT(changed(2.0F), changed(INFINITY));
  EXPECT_GT(changed(2.0F), 0);
  EXPECT_EQ(changed(0.05F), 0);
  EXPECT_EQ(changed(NAN), 0) << "outside the lens";
}

imaging::RgbImage flown(const Scene& scene, const FlightRenderOptions& options, std::size_t frame = 1) {
  geometry::Trajectory frames;
  for (int i = 0; i < 3; ++i)
    frames.poses.push_back({0.1 * i, looking_along({0, -30.0 + i, 8.0}, Vec3(0.1, 1.0, -0.2))});
  imaging::RgbImage image;
  FlightRenderOptions one = options;
  one.frame_filter = [frame](std::size_t index) { return index == frame; };
  render_flight(scene, kCamera, frames, {}, one, [&](const FlightFrame& made) {
    image = made.rgb;
    EXPECT_EQ(made.depth_m.empty(), !options.render.depth);
  });
  return image;
}

TEST(Streaks, FallInFlightsTheSameForAnyNumberOfThreads) {
  const Scene scene({hills({0, 0, 0}, 300.0, 20, texture(64, 64, [](int x, int y) { return grey(noise(x, y)); }))});
  FlightRenderOptions options;
  options.render.depth = false;
  const imaging::RgbImage dry = flown(scene, options);
  options.render.weather = shared({.rain_mm_per_h = 1e-3});
  const imaging::RgbImage drizzle = flown(scene, options);
  options.render.weather = shared({.rain_mm_per_h = 30.0, .snow_mm_per_h = 1.0});
  const imaging::RgbImage wet = flown(scene, options);
  EXPECT_NE(wet.pixels, drizzle.pixels);
  EXPECT_NE(wet.pixels, flown(scene, options, 2).pixels);
  options.render.depth = true;
  EXPECT_EQ(wet.pixels, flown(scene, options).pixels) << "with and without depth";
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  EXPECT_EQ(wet.pixels, flown(scene, options).pixels);
  options.render.weather = shared({});
  EXPECT_EQ(dry.pixels, flown(scene, options).pixels);
}

}  // namespace
}  // namespace tileflight::render::streaks_test
