#include "tileflight/capture/render/atmosphere.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "tileflight/capture/render/daylight.h"
#include "tileflight/capture/render/render_flight.h"
#include "tileflight/capture/render/test_scenes.h"
#include "tileflight/core/base/strict_section.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::render::atmosphere_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using scene::Scene;
using ::testing::HasSubstr;
using namespace test_scenes;

const geometry::Geodetic kPlace{35.31, -80.74, {190.0}};
constexpr imaging::Rgb8 kSky{135, 180, 225};

std::shared_ptr<const Daylight> daylight(const char* time) {
  return std::make_shared<const Daylight>(DaylightOptions{.utc_s = base::parse_iso_time_s(time)}, kPlace);
}

std::shared_ptr<const WeatherOptions> shared(const WeatherOptions& weather) {
  return std::make_shared<const WeatherOptions>(weather);
}

double grey_sky() {
  return 0.2126 * srgb_decode(kSky[0]) + 0.7152 * srgb_decode(kSky[1]) + 0.0722 * srgb_decode(kSky[2]);
}

Scene plain(int value, double size_m = 4000.0) {
  return Scene({ground({0, 0, 0}, size_m, texture(2, 2, [value](int, int) { return grey(value); }))});
}

LinearRgb middle_of(const CameraRenderer& renderer, const SE3& T) {
  const LightFrame frame = renderer.render_light({1, 1, {T}});
  return frame.light(frame.light.width / 2, frame.light.height / 2);
}

TEST(Atmosphere, FogIsBeerAndLambertsLawAtADistance) {
  const Scene scene = plain(200);
  for (const double height_m : {10.0, 50.0, 150.0}) {
    const CameraRenderer renderer(scene, imaging::make_pinhole(33, 33, 40.0),
                                  {.weather = shared({.fog_visibility_m = 120.0})});
    const double clear = std::exp(-3.912 * height_m / 120.0);
    const double expected = clear * srgb_decode(200) + (1.0 - clear) * grey_sky();
    for (const float channel : middle_of(renderer, looking_down({0, 0, height_m})))
      EXPECT_NEAR(channel, expected, 1e-4);
    // The picture of eight bits takes another way.
    const imaging::Rgb8 seen = renderer.render(looking_down({0, 0, height_m})).rgb(16, 16);
    for (const std::uint8_t channel : seen) EXPECT_NEAR(channel, srgb_encode(expected), 0.6);
  }
}

TEST(Atmosphere, ContrastFallsToTwoPercentAtTheVisibility) {
  const double left = std::exp(-extinction_at_visibility(345.0) * 345.0);
  EXPECT_NEAR(left, 0.02, 1e-4);
}

TEST(Atmosphere, TheSkyIsTheAirlight) {
  const Scene scene = plain(200, 10.0);
  const SE3 T = looking_along({0, 0, 20}, {0.3, 1.0, 0.0});
  const CameraRenderer baked(scene, imaging::make_pinhole(33, 33, 40.0),
                             {.weather = shared({.fog_visibility_m = 900.0})});
  for (const float channel : middle_of(baked, T)) EXPECT_NEAR(channel, grey_sky(), 1e-5);
  // In thin layered haze under the sun it is the clear sky's horizon, as far as the sun shines through.
  const auto light = daylight("2024-06-20T17:00:00Z");
  const WeatherOptions haze{.fog_visibility_m = 20000.0, .scale_height_m = 500.0};
  const CameraRenderer lit(scene, imaging::make_pinhole(33, 33, 40.0), {.daylight = light, .weather = shared(haze)});
  const double share = direct_sun_share(haze, light->sun().elevation_rad);
  const double depth = extinction_at_visibility(20000.0) * 500.0 / std::sin(light->sun().elevation_rad);
  EXPECT_NEAR(share, std::exp(-depth), 1e-12);
  const LinearRgb horizon = light->horizon({0.3F, 1.0F, 0.0F}), seen = middle_of(lit, T);
  const LinearRgb sky = light->diffuse({0, 0, 1});
  for (std::size_t c = 0; c < 3; ++c) {
    const double white = 0.6 * (sky[c] + light->toward_sun()[2] * light->sunlight()[c]);
    EXPECT_NEAR(seen[c], share * horizon[c] + (1.0 - share) * white, 1e-4);
  }
}

/// Midpoint rule.
double numeric_depth(const WeatherOptions& w, double height_m, double upward, double distance_m) {
  constexpr int kSteps = 200000;
  double sum = 0.0;
  for (int i = 0; i < kSteps; ++i) {
    const double z = height_m + upward * distance_m * (i + 0.5) / kSteps;
    sum += std::exp(-(z - w.base_height_m) / w.scale_height_m);
  }
  return sum * distance_m / kSteps * extinction_at_visibility(w.fog_visibility_m);
}

TEST(Atmosphere, LayersThinOutAsTheIntegralSays) {
  const WeatherOptions weather{.fog_visibility_m = 300.0, .scale_height_m = 40.0, .base_height_m = 15.0};
  const double anchor_z_m = 7.0;
  const Atmosphere air(weather, nullptr, kSky, anchor_z_m);
  for (const double height_m : {0.0, 15.0, 120.0}) {
    for (const double upward : {-0.9, -0.2, -1e-4, 0.0, 3e-5, 0.01, 0.5, 1.0}) {
      for (const double distance_m : {1.0, 60.0, 700.0}) {
        if (height_m + upward * distance_m < -100.0) continue;
        const double expected = numeric_depth(weather, height_m, upward, distance_m);
        EXPECT_NEAR(air.optical_depth(static_cast<float>(height_m - anchor_z_m), static_cast<float>(upward),
                                      static_cast<float>(distance_m)),
                    expected, 2e-4 * expected + 1e-6)
            << height_m << " " << upward << " " << distance_m;
      }
    }
  }
  // Straight up to the sky, the layer ends: b H exp(-(h - base) / H).
  EXPECT_NEAR(air.optical_depth(8.0F, 1.0F, INFINITY), extinction_at_visibility(300.0) * 40.0, 1e-4);
  EXPECT_GT(air.optical_depth(8.0F, -1.0F, INFINITY), 1e6F) << "and down it does not, but stays finite";
  EXPECT_TRUE(std::isfinite(air.optical_depth(8.0F, -1.0F, INFINITY)));
}

TEST(Atmosphere, DustIsBrownAndFogIsNot) {
  const Atmosphere fog({.fog_visibility_m = 100.0}, nullptr, kSky, 0.0);
  const Atmosphere dust({.dust_visibility_m = 100.0}, nullptr, kSky, 0.0);
  const Atmosphere both({.fog_visibility_m = 100.0, .dust_visibility_m = 100.0}, nullptr, kSky, 0.0);
  const LinearRgb grey = fog.airlight({0, 1, 0}, 0.0F), brown = dust.airlight({0, 1, 0}, 0.0F);
  EXPECT_FLOAT_EQ(grey[0], grey[2]);
  EXPECT_GT(brown[0], 1.15F * brown[1]);
  EXPECT_GT(brown[1], 1.15F * brown[2]);
  for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(both.airlight({0, 1, 0}, 0.0F)[c], 0.5F * (grey[c] + brown[c]), 1e-6);
  EXPECT_FLOAT_EQ(both.optical_depth(0.0F, 0.3F, 50.0F), 2.0F * fog.optical_depth(0.0F, 0.3F, 50.0F));
}

TEST(Atmosphere, RainDimsAsItsDropsCrossSectionsDo) {
  // Twice the cross-section of Marshall and Palmer's drops, summed up.
  for (const double rate : {1.0, 10.0, 60.0}) {
    const double slope = 4.1 * std::pow(rate, -0.21), step = 1e-3;
    double sum = 0.0;
    for (double d = 0.5 * step; d < 30.0; d += step)
      sum += 2.0 * 0.25 * std::numbers::pi * d * d * 1e-6 * 8000.0 * std::exp(-slope * d) * step;
    EXPECT_NEAR(rain_extinction_per_m(rate), sum, 1e-5 * sum);
    // The measured law, dB/km.
    const double db_per_km = 10.0 / std::numbers::ln10 * 1e3 * rain_extinction_per_m(rate);
    EXPECT_NEAR(db_per_km, 1.58 * std::pow(rate, 0.63), 0.01 * db_per_km);
  }
  EXPECT_NEAR(10.0 / std::numbers::ln10 * 1e3 * snow_extinction_per_m(2.0), 5.5257 * std::pow(2.0, 1.38), 1e-2);
  EXPECT_EQ(rain_extinction_per_m(0.0), 0.0);
  EXPECT_EQ(snow_extinction_per_m(0.0), 0.0);
}

TEST(Atmosphere, WetGroundIsDarkerAndWetWallsAreNot) {
  EXPECT_FLOAT_EQ(wet_reflectance(0.0F), 0.0F);
  EXPECT_FLOAT_EQ(wet_reflectance(1.0F), 1.0F);
  EXPECT_NEAR(wet_reflectance(0.2F), 0.2 / (1.7689 * 0.8 + 0.2), 1e-6);
  const Scene scene = plain(124);
  const double dry = srgb_decode(124);
  for (const double wetness : {0.5, 1.0}) {
    const CameraRenderer renderer(scene, imaging::make_pinhole(33, 33, 40.0),
                                  {.weather = shared({.wetness = wetness})});
    const double wet = dry + wetness * (wet_reflectance(static_cast<float>(dry)) - dry);
    EXPECT_NEAR(middle_of(renderer, looking_down({0, 0, 10}))[1], wet, 1e-3);
    EXPECT_NEAR(middle_of(renderer, looking_down({0, 0, -10}))[1], srgb_decode(kSky[1]), 1e-4) << "nothing is below";
  }
  imaging::TexturedMesh wall = ground({0, 0, 0}, 40.0, texture(2, 2, [](int, int) { return grey(124); }));
  for (Vec3& vertex : wall.mesh.vertices) vertex = {vertex.x(), 10.0, vertex.y()};
  const Scene walled({wall});
  const CameraRenderer renderer(walled, imaging::make_pinhole(33, 33, 40.0), {.weather = shared({.wetness = 1.0})});
  EXPECT_NEAR(middle_of(renderer, looking_along({0, 0, 0}, {0, 1, 0}))[1], dry, 1e-3);
}

TEST(Atmosphere, ThickFogTakesTheShadowsAndKeepsTheLight) {
  const auto light = daylight("2024-06-20T14:00:00Z");
  // A roof 5 m above the ground, and its shadow beside the camera's axis.
  const Scene scene({ground({0, 0, 0}, 400.0, texture(2, 2, [](int, int) { return grey(150); })),
                     ground({0, 0, 5}, 6.0, texture(2, 2, [](int, int) { return grey(150); }))});
  const auto& sun = light->toward_sun();
  const Vec3 shaded(-5.0 * sun[0] / sun[2], -5.0 * sun[1] / sun[2], 0.0), open = shaded + Vec3(40, 40, 0);
  const auto seen = [&](const WeatherOptions& weather, const Vec3& at) {
    const CameraRenderer renderer(scene, imaging::make_pinhole(33, 33, 10.0),
                                  {.daylight = light, .weather = shared(weather)});
    return middle_of(renderer, looking_along(at + Vec3(-9, 9, 1.5), Vec3(9, -9, -1.5)))[1];
  };
  const WeatherOptions clear, wet{.wetness = 1e-9}, overcast{.rain_mm_per_h = 1e-4};
  EXPECT_LT(seen(clear, shaded), 0.7F * seen(clear, open));
  EXPECT_FLOAT_EQ(seen(wet, shaded), seen(clear, shaded));
  EXPECT_NEAR(seen(overcast, shaded), seen(overcast, open), 0.01F);
  EXPECT_NEAR(seen(overcast, open), seen(clear, open), 0.01F);
}

TEST(Atmosphere, ClearWeatherCostsNothingAndChangesNothing) {
  const Scene scene({hills({0, 0, 0}, 300.0, 20, texture(64, 64, [](int x, int y) { return grey(noise(x, y)); }))});
  const imaging::Camera camera = imaging::make_pinhole(80, 60, 70.0);
  const SE3 T = looking_along({0, -60, 30}, {0.2, 1.0, -0.4});
  const CameraRenderer none(scene, camera, {}), clear(scene, camera, {.weather = shared({})});
  EXPECT_EQ(none.render(T).rgb.pixels, clear.render(T).rgb.pixels);
}

std::string refusal(const WeatherOptions& weather) {
  try {
    validate_weather(weather);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(Weather, IsCheckedAndDescribed) {
  EXPECT_EQ(refusal({}), "");
  EXPECT_THAT(refusal({.fog_visibility_m = 0.5}), HasSubstr("fog's visibility: must lie between 1 and 1000000 m"));
  EXPECT_THAT(refusal({.dust_visibility_m = std::nan("")}), HasSubstr("dust's visibility"));
  EXPECT_THAT(refusal({.rain_mm_per_h = -1.0}), HasSubstr("rain: must lie between 0 and 300 mm/h"));
  EXPECT_THAT(refusal({.snow_mm_per_h = 31.0}), HasSubstr("snow: must lie between 0 and 30 mm/h"));
  EXPECT_THAT(refusal({.wetness = 1.1}), HasSubstr("wetness: must lie between 0 and 1"));
  EXPECT_THAT(refusal({.wind_m_s = {90, 90, 0}}), HasSubstr("wind"));
  EXPECT_EQ(describe_weather({}), "clear");
  EXPECT_EQ(describe_weather({.fog_visibility_m = 200.0, .rain_mm_per_h = 2.5}),
            "fog_visibility_m: 200, rain_mm_per_h: 2.5");
}

std::optional<WeatherOptions> read(const std::string& text) {
  nlohmann::json json = nlohmann::json::parse(text);
  base::StrictSection section(json, "flight.yaml");
  return read_weather(section);
}

std::string read_refusal(const std::string& text) {
  try {
    read(text);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(Weather, IsReadFromAFlightFile) {
  EXPECT_FALSE(read("{}"));
  const auto weather = read(R"({"weather": {"fog_visibility_m": 150, "scale_height_m": 30, "base_height_m": -4,
      "rain_mm_per_h": 5, "snow_mm_per_h": 1, "wetness": 0.5, "wind_m_s": [3, -1],
      "streak_exposure_s": 0.004}})");
  ASSERT_TRUE(weather);
  EXPECT_EQ(describe_weather(*weather),
            "fog_visibility_m: 150, scale_height_m: 30, base_height_m: -4, rain_mm_per_h: 5, snow_mm_per_h: 1, "
            "wetness: 0.5, wind_east_m_s: 3, wind_north_m_s: -1, streak_exposure_s: 0.004");
  EXPECT_THAT(read_refusal(R"({"weather": {"fog": 1}})"), HasSubstr("fog"));
  EXPECT_THAT(read_refusal(R"({"weather": {"fog_visibility_m": 0.1}})"), HasSubstr("fog_visibility_m"));
  EXPECT_THAT(read_refusal(R"({"weather": {"rain_mm_per_h": 301}})"), HasSubstr("rain_mm_per_h"));
  EXPECT_THAT(read_refusal(R"({"weather": {"scale_height_m": 0.5}})"), HasSubstr("scale_height_m"));
  EXPECT_THAT(read_refusal(R"({"weather": {"wind_m_s": [100, 1]}})"), HasSubstr("wind_m_s"));
  EXPECT_THAT(read_refusal(R"({"weather": {"wind_m_s": [1]}})"), HasSubstr("wind_m_s"));
  EXPECT_THAT(read_refusal(R"({"weather": 3})"), HasSubstr("weather"));
}

}  // namespace
}  // namespace tileflight::render::atmosphere_test
