#include "tileflight/capture/render/solar_position.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::render::solar_position_test {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr double kDegrees = 180.0 / std::numbers::pi;

double time_s(const char* text) { return *base::parse_iso_time_s(text); }

geometry::Geodetic at(double latitude_deg, double longitude_deg, double height_m = 0.0) {
  return {latitude_deg, longitude_deg, {height_m}};
}

/// Reda and Andreas, "Solar position algorithm for solar radiation applications" (NREL/TP-560-34302), table A5.1.
TEST(SolarPosition, AgreesWithTheExampleOfNrel) {
  const SunPosition sun =
      sun_position(time_s("2003-10-17T12:30:30-07:00"), at(39.742476, -105.1786, 1830.14), {820.0, 11.0});
  EXPECT_NEAR(90.0 - sun.elevation_rad * kDegrees, 50.11162, 0.005);
  EXPECT_NEAR(sun.azimuth_rad * kDegrees, 194.34024, 0.01);
  EXPECT_NEAR(sun.distance_au, 0.9965422974, 1e-4);
}

/// Meeus, example 25.a: 1992 October 13 at 0 h dynamical time; right ascension 198.38083, declination -7.78507 degrees.
/// At noon the sun is in the zenith at the latitude equal to its declination.
TEST(SolarPosition, AgreesWithTheExampleOfMeeus) {
  constexpr double kDeltaT_s = 69.0, kEquationOfEquinoxes_deg = 0.0044;
  const double T = (2448908.5 - 2451545.0) / 36525.0;  // sidereal time as Aoki et al. 1982 give it, seconds
  const double sidereal_s = 24110.54841 + 8640184.812866 * T + 0.093104 * T * T - 1.00273790935 * kDeltaT_s;
  const double sidereal_deg = sidereal_s / 240.0 + kEquationOfEquinoxes_deg;
  const geometry::Geodetic below = at(-7.78507, std::remainder(198.38083 - sidereal_deg, 360.0));
  const SunPosition sun = sun_position(time_s("1992-10-13T00:00:00Z") - kDeltaT_s, below, {0.0, 15.0});
  EXPECT_GT(sun.elevation_rad * kDegrees, 89.998);
  EXPECT_NEAR(sun.distance_au, 0.99766, 1e-5);
}

TEST(SolarPosition, StandsInTheZenithOfTheEquatorAtEquinoxNoon) {
  // The centre crosses the equator on 2024-03-20 at 03:06 UTC; it is noon then near 135 degrees east.
  double highest = 0.0;
  for (int minute = -30; minute <= 30; ++minute) {
    const SunPosition sun = sun_position(time_s("2024-03-20T03:06:00Z") + 60.0 * minute, at(0.0, 135.0), {});
    highest = std::max(highest, sun.elevation_rad * kDegrees);
  }
  EXPECT_GT(highest, 89.87);
  EXPECT_LE(highest, 90.01);
}

TEST(SolarPosition, RisesAndSetsAlikeAboutNoonAtTheSolstice) {
  // The declination changes least then, so that forenoon and afternoon are symmetric.
  const geometry::Geodetic place = at(48.0, 11.0);
  double noon_s = 0.0, highest = -1.0;
  for (int s = 0; s < 7200; s += 5) {
    const double t = time_s("2024-06-20T10:20:00Z") + s;
    const double elevation = sun_position(t, place, {}).elevation_rad;
    if (elevation > highest) highest = elevation, noon_s = t;
  }
  EXPECT_NEAR(highest * kDegrees, 90.0 - 48.0 + 23.437, 0.02);  // culmination: 90 - latitude + declination
  for (const double hours : {2.0, 5.0, 7.9}) {
    const SunPosition before = sun_position(noon_s - 3600.0 * hours, place, {});
    const SunPosition after = sun_position(noon_s + 3600.0 * hours, place, {});
    EXPECT_NEAR(before.elevation_rad * kDegrees, after.elevation_rad * kDegrees, 0.05);
    EXPECT_NEAR(before.azimuth_rad * kDegrees, 360.0 - after.azimuth_rad * kDegrees, 0.05);
    EXPECT_GT(before.direction.x(), 0.0);  // east in the morning
    EXPECT_LT(after.direction.x(), 0.0);
  }
}

TEST(SolarPosition, IsInTheNorthAtNoonSouthOfTheTropics) {
  const SunPosition sun = sun_position(time_s("2024-06-20T02:00:00Z"), at(-35.0, 150.0), {});
  EXPECT_GT(sun.direction.y(), 0.5);
  EXPECT_NEAR(sun.elevation_rad * kDegrees, 90.0 - 35.0 - 23.44, 0.1);
}

TEST(SolarPosition, RefractionLiftsTheSettingSun) {
  const geometry::Geodetic place = at(0.0, 0.0);
  const auto lift_deg = [&](double t) {
    return (sun_position(t, place, {1010.0, 10.0}).elevation_rad - sun_position(t, place, {0.0, 10.0}).elevation_rad) *
           kDegrees;
  };
  double horizon_s = time_s("2024-03-20T17:00:00Z");
  while (sun_position(horizon_s, place, {0.0, 10.0}).elevation_rad > 0.0) horizon_s += 1.0;
  EXPECT_NEAR(lift_deg(horizon_s) * 60.0, 29.0, 0.5);                // minutes of arc, Meeus chapter 16
  EXPECT_NEAR(lift_deg(horizon_s - 3.0 * 3600.0) * 60.0, 1.0, 0.1);  // at 45 degrees: cot(45 deg)
  EXPECT_EQ(lift_deg(horizon_s + 3600.0), 0.0);                      // below the horizon there is none
}

TEST(SolarPosition, DirectionIsThatOfTheAngles) {
  for (int hour = 0; hour < 24; ++hour) {
    const SunPosition sun =
        sun_position(time_s("2024-09-01T00:00:00Z") + 3600.0 * hour, at(-0.2, -78.5, 2800.0), standard_air(2800.0));
    EXPECT_NEAR(sun.direction.norm(), 1.0, 1e-12);
    EXPECT_NEAR(std::asin(sun.direction.z()), sun.elevation_rad, 1e-9);
    EXPECT_NEAR(
        std::remainder(std::atan2(sun.direction.x(), sun.direction.y()) - sun.azimuth_rad, 2.0 * std::numbers::pi), 0.0,
        1e-9);
  }
}

TEST(SolarPosition, StandardAirHasItsPublishedPoints) {
  EXPECT_DOUBLE_EQ(standard_air(0.0).pressure_hpa, 1013.25);
  EXPECT_NEAR(standard_air(5000.0).pressure_hpa, 540.2, 0.1);
  EXPECT_NEAR(standard_air(5000.0).temperature_c, -17.5, 1e-9);
}

TEST(SolarPosition, RefusesWhatItDoesNotKnow) {
  EXPECT_THAT([&] { sun_position(-3e9, at(0, 0), {}); },
              ThrowsMessage<InputError>(HasSubstr("its position is defined from 1900 to 2099 only")));
  EXPECT_THAT([&] { sun_position(5e9, at(0, 0), {}); },
              ThrowsMessage<InputError>(HasSubstr("its position is defined from 1900 to 2099 only")));
  EXPECT_THAT([&] { sun_position(0.0, at(91.0, 0), {}); },
              ThrowsMessage<InputError>(HasSubstr("the place is not georeferenced")));
  EXPECT_THAT([&] { sun_position(std::nan(""), at(0, 0), {}); },
              ThrowsMessage<InputError>(HasSubstr("its position is defined from 1900 to 2099 only")));
}

}  // namespace
}  // namespace tileflight::render::solar_position_test
