#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

#include "tests/refusal.h"
#include "tileflight/capture/render/linear_color.h"
#include "tileflight/capture/render/solar_position.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/live/simulator/test_world.h"
#include "tileflight/live/simulator/world.h"

namespace tileflight::simulator::environment_test {
namespace {

using namespace test_world;
using testing::HasSubstr;

constexpr int kRain = 0, kRoadWetness = 1, kSnow = 2, kMapleLeaf = 4, kDust = 6, kFog = 7, kEnabled = 8;
constexpr double kLatitude_deg = -0.2, kLongitude_deg = -78.5;
const std::string kQuito = R"({"SimMode": "ComputerVision", "StepOnDemand": true,
    "OriginGeopoint": {"Latitude": -0.2, "Longitude": -78.5, "Altitude": 2800}})";

std::vector<std::uint8_t> picture(Simulator& world, const std::string& camera = "0") {
  return world.cameras().get_images({{camera, 0, false, false}}, "", false).at(0).image_data_uint8;
}

/// Red, green and blue in the middle of the picture.
std::array<int, 3> middle(Simulator& world, const std::string& camera = "0") {
  const ImageResponse image = world.cameras().get_images({{camera, 0, false, false}}, "", false).at(0);
  const std::size_t i = 3 * static_cast<std::size_t>(image.width * (image.height / 2) + image.width / 2);
  return {image.image_data_uint8.at(i + 2), image.image_data_uint8.at(i + 1), image.image_data_uint8.at(i)};
}

/// Green of the ground at a place.
int ground_at(Simulator& world, double north_m, double east_m) {
  world.vehicles().set_vehicle_pose(pose(static_cast<float>(north_m), static_cast<float>(east_m), -12), true, "");
  return middle(world, "bottom_center")[1];
}

/// Length of the shadow of the eastern wall, 40 m high, to the west.
double shadow_m(const render::SunPosition& sun) { return 40.0 * sun.direction.x() / sun.direction.z(); }

render::SunPosition sun_at(const char* utc) {
  const geometry::Geodetic place{kLatitude_deg, kLongitude_deg, {2800.0}};
  return render::sun_position(*base::parse_iso_time_s(utc), place, render::standard_air(2800.0));
}

TEST(ApiOutdoors, ShadowsAreWhereTheSunIsAtThePlacesTime) {
  const auto world = simulator(kQuito);
  // Zone time of 78.5 degrees west is UTC - 5; in summer time, an hour later is the same.
  for (const auto& [start, is_summer_time] : {std::pair("2018-02-12 10:00:00", false),
                                              {"2018-02-12 11:00:00", true},
                                              {"2018-2-12 10:0:0", false},
                                              {"2018-02-12T15:00:00Z", false},
                                              {"2018-02-12T15:00:00Z", true}}) {
    world->environment().set_time_of_day(true, start, is_summer_time, 1, 60, true);
    const double edge_east_m = kWallEast_m - shadow_m(sun_at("2018-02-12T15:00:00Z"));
    ASSERT_NEAR(edge_east_m, 5.0, 6.0);
    EXPECT_LT(ground_at(*world, -20, edge_east_m + 0.7), 100);
    EXPECT_GT(ground_at(*world, -20, edge_east_m - 0.7), 130);
  }
}

TEST(ApiOutdoors, TheSunMovesWithTheSimulationsClock) {
  const auto world = simulator(kQuito);
  world->environment().set_time_of_day(true, "2018-02-12 10:00:00", false, 600, 2, true);
  const double first_m = kWallEast_m - shadow_m(sun_at("2018-02-12T15:00:00Z"));
  const double later_m = kWallEast_m - shadow_m(sun_at("2018-02-12T15:20:00Z"));
  ASSERT_GT(later_m, first_m + 2.0);
  const double between_m = 0.5 * (first_m + later_m);
  EXPECT_LT(ground_at(*world, -20, between_m), 100);
  world->clock().continue_for_time(1.8);
  EXPECT_LT(ground_at(*world, -20, between_m), 100) << "updated every two seconds";
  world->clock().continue_for_time(0.3);
  EXPECT_GT(ground_at(*world, -20, between_m), 130) << "20 minutes later";
  EXPECT_LT(ground_at(*world, -20, later_m + 0.7), 100);
}

TEST(ApiOutdoors, TimesOfTheCelestialClockAreExact) {
  Outdoors outdoors;
  EXPECT_FALSE(outdoors.outlook(0.0, {0, 0, 0}).sunlight);
  outdoors.set_time_of_day({1e9, 10, 20, 30}, 4.0, -50.0, 0.5);
  EXPECT_EQ(outdoors.outlook(4.0, {0, 0, 0}).sunlight->utc_s, 1e9);
  EXPECT_EQ(outdoors.outlook(4.499, {0, 0, 0}).sunlight->utc_s, 1e9);
  EXPECT_EQ(outdoors.outlook(4.5, {0, 0, 0}).sunlight->utc_s, 1e9 - 25.0);
  EXPECT_EQ(outdoors.outlook(7.2, {0, 0, 0}).sunlight->utc_s, 1e9 - 150.0);
  outdoors.set_time_of_day({1e9, 10, 20, 30}, 4.0, 2.0, 0.0);
  EXPECT_NEAR(outdoors.outlook(4.25, {0, 0, 0}).sunlight->utc_s, 1e9 + 0.5, 1e-6);
  outdoors.set_time_of_day({1e9, 10, 20, 30}, 4.0, 1e7, 0.0);
  EXPECT_LT(outdoors.outlook(1e6, {0, 0, 0}).sunlight->utc_s, 4102444800.0) << "the end of what is known";
}

TEST(ApiOutdoors, OffAgainThereIsThePlainLight) {
  const auto world = simulator(kQuito);
  world->vehicles().set_vehicle_pose(pose(-20, 0, -12), true, "");
  const auto plain = picture(*world);
  world->environment().set_time_of_day(true, "2018-02-12 10:00:00", false, 1, 60, true);
  const auto lit = picture(*world);
  EXPECT_NE(lit, plain);
  EXPECT_EQ(lit, picture(*world));
  world->environment().set_time_of_day(false, "", false, 1, 60, true);
  EXPECT_EQ(picture(*world), plain);
  world->environment().set_time_of_day(true, "2018-02-12 10:00:00", false, 1, 60, false);
  EXPECT_EQ(picture(*world), plain) << "the sun is not to be moved";
  world->environment().set_time_of_day(true, "", false, 1, 60, true);
  const auto night_or_day = picture(*world);
  EXPECT_EQ(night_or_day, picture(*world)) << "the simulation's own time";
}

TEST(ApiOutdoors, NightIsDark) {
  const auto world = simulator(kQuito);
  const int plain = ground_at(*world, -20, 0);
  world->environment().set_time_of_day(true, "2018-02-12 0:20:00", true, 1, 60, true);
  EXPECT_LT(ground_at(*world, -20, 0), plain / 4);
  EXPECT_GT(ground_at(*world, -20, 0), 0);
}

TEST(ApiOutdoors, WhatCannotBeSaysSoInOneLine) {
  LoggedLines lines;
  const auto nowhere = simulator(kComputerVision, {}, lines.log());
  const auto plain = picture(*nowhere);
  for (int i = 0; i < 3; ++i) nowhere->environment().set_time_of_day(true, "2018-02-12 10:00:00", false, 1, 60, true);
  EXPECT_EQ(lines.count("simSetTimeOfDay has no effect: the place has no georeference; give OriginGeopoint"), 1U);
  EXPECT_EQ(picture(*nowhere), plain);
  const auto world = simulator(kQuito, {}, lines.log());
  const auto refused = [&](const std::string& start, float speed, float interval_s) {
    return tests::message_of(
        [&] { world->environment().set_time_of_day(true, start, false, speed, interval_s, true); });
  };
  EXPECT_THAT(refused("yesterday", 1, 60), HasSubstr("'yesterday' is no date and time; give one such as 2018-02-12"));
  EXPECT_EQ(refused("2022-11-03 24:00:00", 1, 60), "no error");
  EXPECT_THAT(refused("2022-11-03 25:00:00", 1, 60), HasSubstr("is no date and time"));
  EXPECT_THAT(refused(std::string(100000, '1'), 1, 60), HasSubstr("is no date and time"));
  EXPECT_THAT(refused("2018-02-30 10:00:00", 1, 60), HasSubstr("is no date and time"));
  EXPECT_THAT(refused("2218-02-12 10:00:00", 1, 60), HasSubstr("1900"));
  EXPECT_THAT(refused("2018-02-12 10:00:00", NAN, 60), HasSubstr("the clock's speed"));
  EXPECT_THAT(refused("2018-02-12 10:00:00", 1, -1), HasSubstr("the update interval must lie between 0 and 86400 s"));
  EXPECT_THAT(tests::message_of([&] { world->environment().set_weather_parameter(9, 1); }),
              HasSubstr("parameter 9 is unknown; use 0"));
  EXPECT_THAT(tests::message_of([&] { world->environment().set_weather_parameter(-1, 1); }),
              HasSubstr("parameter -1 is unknown"));
  EXPECT_THAT(tests::message_of([&] { world->environment().set_weather_parameter(kFog, NAN); }),
              HasSubstr("the value is not a number"));
  for (int i = 0; i < 3; ++i) world->environment().set_weather_parameter(kMapleLeaf, 0.5);
  EXPECT_EQ(lines.count("simSetWeatherParameter has no effect: snow and leaves on the ground"), 1U);
}

TEST(ApiOutdoors, FogOfAParameterDimsAWallByItsVisibility) {
  const auto world = simulator(kComputerVision);
  world->vehicles().set_vehicle_pose(pose(0, 0, -10), true, "");
  const auto clear = picture(*world);
  const auto depth = world->cameras().get_images({{"0", 1, true, false}}, "", false).at(0).image_data_float;
  world->environment().set_weather_parameter(kFog, 0.5F);
  EXPECT_EQ(picture(*world), clear) << "not enabled yet";
  world->environment().enable_weather(true);
  const double visibility_m = 5000.0 * std::pow(20.0 / 5000.0, 0.5), left = std::pow(0.02, kWallNorth_m / visibility_m);
  const double air = 0.2126 * render::srgb_decode(135) + 0.7152 * render::srgb_decode(180) +
                     0.0722 * render::srgb_decode(225);  // the sky, without its colour
  const std::array<int, 3> seen = middle(*world);
  for (std::size_t c = 0; c < 3; ++c)
    EXPECT_NEAR(seen[c], render::srgb_encode(left * render::srgb_decode(kWallColour[c]) + (1.0 - left) * air), 1.0);
  EXPECT_EQ(world->cameras().get_images({{"0", 1, true, false}}, "", false).at(0).image_data_float, depth);
  world->environment().set_weather_parameter(kFog, 7.0F);
  EXPECT_NEAR(middle(*world)[2], render::srgb_encode(0.02 * render::srgb_decode(50) + 0.98 * air), 1.0) << "as 1";
  world->environment().set_weather_parameter(kEnabled, 0.0F);
  EXPECT_EQ(picture(*world), clear);
  world->environment().set_weather_parameter(kEnabled, 1.0F);
  EXPECT_NE(picture(*world), clear);
  world->environment().set_weather_parameter(kFog, 0.0F);
  EXPECT_EQ(picture(*world), clear);
}

TEST(ApiOutdoors, ParametersMapToPhysicalQuantities) {
  const render::WeatherOptions none = weather_of_parameters(0, 0, 0, 0, 0), all = weather_of_parameters(1, 1, 1, 1, 1);
  EXPECT_TRUE(none.is_clear());
  EXPECT_NEAR(all.fog_visibility_m, 20.0, 1e-9);
  EXPECT_NEAR(all.dust_visibility_m, 50.0, 1e-9);
  EXPECT_EQ(all.rain_mm_per_h, 100.0);
  EXPECT_EQ(all.snow_mm_per_h, 10.0);
  EXPECT_EQ(all.wetness, 1.0);
  EXPECT_NEAR(weather_of_parameters(0.25, 0, 0, 0, 0).fog_visibility_m, 1257.4, 0.1);
  EXPECT_EQ(weather_of_parameters(0, 0, 0.5, 0, 0).rain_mm_per_h, 25.0);
  for (const double least : {1e-6, 1e-3})
    EXPECT_NO_THROW(validate_weather(weather_of_parameters(least, least, least, least, least)));
  EXPECT_NO_THROW(validate_weather(all));
}

TEST(ApiOutdoors, EachParameterShows) {
  const auto world = simulator(kComputerVision);
  world->vehicles().set_vehicle_pose(pose(0, 0, -3), true, "");
  world->environment().enable_weather(true);
  const auto clear = picture(*world, "bottom_center");
  for (const int parameter : {kRain, kRoadWetness, kSnow, kDust, kFog}) {
    world->environment().set_weather_parameter(parameter, 0.6F);
    EXPECT_NE(picture(*world, "bottom_center"), clear) << parameter;
    world->environment().set_weather_parameter(parameter, 0.0F);
    EXPECT_EQ(picture(*world, "bottom_center"), clear) << parameter;
  }
  world->environment().set_weather_parameter(kRoadWetness, 1.0F);
  EXPECT_LT(middle(*world, "bottom_center")[1], 125) << "dry: 140";
}

TEST(ApiOutdoors, RainIsTheSameInEachRunAndGoesOnWithTheClock) {
  const auto start = [] {
    auto world = simulator(kComputerVision);
    world->vehicles().set_vehicle_pose(pose(0, 0, -10), true, "");
    world->environment().enable_weather(true);
    world->environment().set_weather_parameter(kRain, 0.7F);
    return world;
  };
  const auto one = start(), other = start();
  const auto first = picture(*one);
  EXPECT_EQ(first, picture(*other));
  EXPECT_EQ(first, picture(*one)) << "time stands still";
  one->clock().continue_for_time(0.09);
  EXPECT_NE(first, picture(*one));
  other->clock().continue_for_time(0.09);
  EXPECT_EQ(picture(*other), picture(*one));
  const auto still = picture(*one);
  one->environment().set_wind({5, 0, 0});
  EXPECT_NE(picture(*one), still);
}

}  // namespace
}  // namespace tileflight::simulator::environment_test
