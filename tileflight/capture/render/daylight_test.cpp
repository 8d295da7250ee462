#include "tileflight/capture/render/daylight.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "tileflight/capture/render/image_formation.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::render::daylight_test {
namespace {

using geometry::Vec3;

constexpr double kPi = std::numbers::pi;
const geometry::Geodetic kPlace{35.31, -80.74, {190.0}};

DaylightOptions at_time(const char* time) { return {.utc_s = base::parse_iso_time_s(time)}; }

std::array<float, 3> floats(const Vec3& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}

/// Monte Carlo integral over the hemisphere around the normal, with cosine-weighted directions.
PhotometricRgb brute_force_illuminance(const Sky& sky, const Vec3& normal) {
  constexpr int kDirections = 200000;
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  const Vec3 side = normal.unitOrthogonal(), other = normal.cross(side);
  PhotometricRgb sum{};
  for (int i = 0; i < kDirections; ++i) {
    const double radius = std::sqrt(uniform(random)), angle = 2.0 * kPi * uniform(random);
    const Vec3 direction =
        radius * (std::cos(angle) * side + std::sin(angle) * other) + std::sqrt(1.0 - radius * radius) * normal;
    if (direction.z() <= 0.0) continue;
    const PhotometricRgb light = sky.radiance(direction);
    for (std::size_t c = 0; c < 3; ++c) sum[c] += kPi * light[c] / kDirections;
  }
  return sum;
}

TEST(Daylight, SkyOnASurfaceIsTheIntegralOverItsHemisphere) {
  const Sky sky(Vec3(0.5, -0.6, std::sqrt(1.0 - 0.61)), 3.0);
  for (const Vec3& normal : {Vec3(0, 0, 1), Vec3(1, 0, 0), Vec3(-0.6, 0.0, 0.8), Vec3(0.0, 0.8, -0.6)}) {
    const PhotometricRgb expected = brute_force_illuminance(sky, normal);
    const PhotometricRgb sum = sky_illuminance(sky, normal);
    for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(sum[c], expected[c], 0.01 * expected[c] + 0.002);
  }
}

TEST(Daylight, NoonHasItsWellKnownBrightness) {
  // On a clear day around noon some 80 to 110 klx fall on level ground, a tenth to a quarter of it from the sky.
  const SunPosition sun = sun_position(*base::parse_iso_time_s("2024-03-20T17:30:00Z"), kPlace, standard_air(190.0));
  const double from_sun =
      sun.direction.z() * luminance(sun_illuminance(sun.elevation_rad, sun.distance_au, 3.0, 990.0));
  const double from_sky = luminance(sky_illuminance(Sky(sun.direction, 3.0), Vec3::UnitZ()));
  EXPECT_GT(from_sun + from_sky, 80.0);
  EXPECT_LT(from_sun + from_sky, 120.0);
  EXPECT_GT(from_sky / (from_sun + from_sky), 0.1);
  EXPECT_LT(from_sky / (from_sun + from_sky), 0.3);
}

TEST(Daylight, LevelWhiteIsWhiteInFullLight) {
  for (const char* time : {"2024-06-20T17:00:00Z", "2024-03-20T12:30:00Z", "2024-12-20T21:45:00Z"}) {
    const Daylight light(at_time(time), kPlace);
    const LinearRgb level = light.diffuse({0, 0, 1});
    for (std::size_t c = 0; c < 3; ++c)
      EXPECT_NEAR(level[c] + light.toward_sun()[2] * light.sunlight()[c], 1.0F, 2e-5F) << time;
  }
}

/// The light of a place without textures comes from the north-west, as in relief maps, whatever the place's origin.
TEST(Daylight, ReliefLightIsTheSameEverywhere) {
  const auto light = make_daylight(relief_light(), kPlace);
  EXPECT_NEAR(light->sun().elevation_rad * 180.0 / kPi, 45.0, 0.5);
  EXPECT_NEAR(light->toward_sun()[0], -0.5, 0.01);
  EXPECT_NEAR(light->toward_sun()[1], 0.5, 0.01);
  EXPECT_EQ(light->toward_sun(), make_daylight(relief_light(), std::nullopt)->toward_sun());
  EXPECT_FALSE(light->casts_shadows());
  EXPECT_NEAR(light->diffuse({0, 0, 1})[1] + light->toward_sun()[2] * light->sunlight()[1], std::exp2(-0.7), 1e-4);
}

TEST(Daylight, PlacesWithoutTexturesAreLitUnlessALightWasChosen) {
  ImageFormation formation;
  light_by_relief(false, formation);
  EXPECT_FALSE(formation.light);
  light_by_relief(true, formation);
  ASSERT_TRUE(formation.light);
  EXPECT_FALSE(formation.light->casts_shadows);
  ImageFormation baked;
  baked.light_is_chosen = true;
  light_by_relief(true, baked);
  EXPECT_FALSE(baked.light);
  ImageFormation sunny;
  sunny.light = at_time("2024-06-20T17:00:00Z");
  light_by_relief(true, sunny);
  EXPECT_TRUE(sunny.light->casts_shadows);
}

TEST(Daylight, ExposureIsInStopsAndFixedBalanceKeepsTheSunsColour) {
  DaylightOptions settings = at_time("2024-03-20T12:30:00Z");  // an hour after sunrise
  settings.exposure_stops = 1.0;
  EXPECT_NEAR(Daylight(settings, kPlace).diffuse({0, 0, 1})[1],
              2.0F * Daylight(at_time("2024-03-20T12:30:00Z"), kPlace).diffuse({0, 0, 1})[1], 1e-5F);
  settings.exposure_stops = 0.0;
  settings.white_balance = WhiteBalance::kDaylight;
  const Daylight fixed(settings, kPlace);
  EXPECT_GT(fixed.sunlight()[0], 1.5F * fixed.sunlight()[2]);
  const LinearRgb level = fixed.diffuse({0, 0, 1});
  float luminance = 0.0F;
  for (std::size_t c = 0; c < 3; ++c)
    luminance += std::array{0.2126F, 0.7152F, 0.0722F}[c] * (level[c] + fixed.toward_sun()[2] * fixed.sunlight()[c]);
  EXPECT_NEAR(luminance, 1.0F, 1e-4F);
}

/// Compares the table with the integral in all directions; light from below is that of the lit ground.
TEST(Daylight, DiffuseLightByNormalIsSkyAndGround) {
  DaylightOptions settings = at_time("2024-03-20T14:00:00Z");
  settings.ground_albedo = 0.0;
  const Daylight without(settings, kPlace);
  settings.ground_albedo = 0.35;
  const Daylight with(settings, kPlace);
  const Sky sky(without.sun().direction, settings.turbidity);
  const PhotometricRgb level = sky_illuminance(sky, Vec3::UnitZ());
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 60; ++i) {
    const Vec3 n = Vec3(normal(random), normal(random), normal(random)).normalized();
    const PhotometricRgb expected = sky_illuminance(sky, n);
    const LinearRgb from_sky = without.diffuse(floats(n)), both = with.diffuse(floats(n));
    for (std::size_t c = 0; c < 3; ++c) {
      const double unit = without.diffuse({0, 0, 1})[c] / level[c];
      EXPECT_NEAR(from_sky[c], expected[c] * unit, 0.01 * without.diffuse({0, 0, 1})[c]);
      EXPECT_NEAR(both[c] - from_sky[c], 0.35 * 0.5 * (1.0 - n.z()), 2e-3);
    }
  }
}

TEST(Daylight, SkyMeetsItsHorizonAndShowsTheSun) {
  const Daylight light(at_time("2024-03-20T14:00:00Z"), kPlace);
  for (int azimuth = 0; azimuth < 360; azimuth += 7) {
    const double a = azimuth * kPi / 180.0;
    const std::array<float, 3> just_above = floats(Vec3(std::sin(a), std::cos(a), 1e-3).normalized());
    const std::array<float, 3> below = floats(Vec3(std::sin(a), std::cos(a), -0.7).normalized());
    for (std::size_t c = 0; c < 3; ++c) {
      EXPECT_NEAR(light.sky(just_above)[c], light.horizon(just_above)[c], 0.01F);
      EXPECT_EQ(light.sky(below)[c], light.horizon(below)[c]);
    }
  }
  const LinearRgb disc = light.sky(light.toward_sun());
  EXPECT_FLOAT_EQ(std::max({disc[0], disc[1], disc[2]}), Daylight::kDiscWhites);
  const Vec3 sun = light.sun().direction;
  const Vec3 beside = (sun + std::tan(0.3 * kPi / 180.0) * sun.unitOrthogonal()).normalized();
  EXPECT_LT(light.sky(floats(beside))[1], 5.0F);
}

std::string refusal(const DaylightOptions& settings, const std::optional<geometry::Geodetic>& origin = kPlace) {
  try {
    make_daylight(settings, origin);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(Daylight, RefusesWhatItCannotLight) {
  const std::string night = refusal(at_time("2024-03-20T05:00:00Z"));
  EXPECT_NE(night.find("degrees below the horizon"), std::string::npos) << night;
  EXPECT_NE(night.find("35.31"), std::string::npos) << night;
  EXPECT_NE(refusal({}).find("has no time"), std::string::npos);
  EXPECT_NE(refusal(at_time("2024-03-20T17:00:00Z"), std::nullopt).find("not georeferenced"), std::string::npos);
  DaylightOptions settings = at_time("2024-03-20T17:00:00Z");
  EXPECT_EQ(refusal(settings), "");
  settings.turbidity = 1.0;
  EXPECT_NE(refusal(settings).find("turbidity"), std::string::npos);
  settings.turbidity = std::nan("");
  EXPECT_NE(refusal(settings).find("turbidity"), std::string::npos);
  settings = at_time("2024-03-20T17:00:00Z");
  settings.ground_albedo = 1.5;
  EXPECT_NE(refusal(settings).find("ground albedo"), std::string::npos);
}

TEST(Daylight, NightIsDarkIfItIsAllowed) {
  DaylightOptions settings = at_time("2024-03-20T05:00:00Z");
  settings.allows_night = true;
  const Daylight night(settings, kPlace);
  EXPECT_LT(night.sun().elevation_rad, -0.5);
  EXPECT_EQ(night.sunlight(), (LinearRgb{0, 0, 0}));
  for (const float channel : night.diffuse({0, 0, 1})) EXPECT_NEAR(channel, 1.0 / 64.0, 1e-3);
  for (const float channel : night.sky({0.0F, 0.6F, 0.8F})) EXPECT_TRUE(std::isfinite(channel));
  // Civil twilight ends at 6 degrees; the published illuminances are 758 lx at 0 and 10.4 lx at -5 degrees.
  EXPECT_EQ(twilight_dimming(0.01), 1.0);
  EXPECT_NEAR(twilight_dimming(-1e-9), 1.0, 1e-6);
  EXPECT_NEAR(twilight_dimming(-0.8 * kPi / 180.0), 0.62, 0.02);
  EXPECT_NEAR(twilight_dimming(-4.0 * kPi / 180.0), 29.9 / 758.0, 0.001);
  EXPECT_EQ(twilight_dimming(-0.5), 1.0 / 64.0);
  settings = at_time("2024-03-20T17:00:00Z");
  const Daylight day(settings, kPlace);
  settings.allows_night = true;
  EXPECT_EQ(Daylight(settings, kPlace).diffuse({0, 0, 1}), day.diffuse({0, 0, 1}));
}

TEST(Daylight, SaysWhereTheSunStands) {
  SunPosition sun;
  sun.elevation_rad = 0.5 * kPi / 3.0;
  sun.azimuth_rad = kPi;
  EXPECT_EQ(describe_sun_position(sun), "sun 30.0 degrees high, azimuth 180.0 degrees");
}

}  // namespace
}  // namespace tileflight::render::daylight_test
