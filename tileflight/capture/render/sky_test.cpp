#include "tileflight/capture/render/sky.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace tileflight::render::sky_test {
namespace {

using geometry::Vec3;

constexpr double kPi = std::numbers::pi;
constexpr double kRadians = kPi / 180.0;

Vec3 direction(double elevation_deg, double azimuth_deg) {
  const double e = elevation_deg * kRadians, a = azimuth_deg * kRadians;
  return {std::cos(e) * std::sin(a), std::cos(e) * std::cos(a), std::sin(e)};
}

struct Zenith {
  double sun_zenith_deg, turbidity;
  double x, y, luminance_kcd_m2;
};

// Computed from the appendix's matrices independently of the code.
TEST(Sky, ZenithHasThePublishedColour) {
  const Zenith cases[] = {{0, 3, 0.27068, 0.28236, 29.477313},   {30, 3, 0.253434, 0.259793, 10.413087},
                          {60, 3, 0.244929, 0.252573, 5.139156}, {45, 6, 0.261448, 0.275450, 14.893327},
                          {85, 2, 0.269004, 0.285803, 2.221547}, {90, 10, 0.315283, 0.344172, 0.264200}};
  for (const Zenith& expected : cases) {
    const SkyColor formula = zenith_color(expected.sun_zenith_deg * kRadians, expected.turbidity);
    const Sky sky(direction(90.0 - expected.sun_zenith_deg, 123.0), expected.turbidity);
    for (const SkyColor& color : {formula, sky.color(Vec3::UnitZ())}) {
      EXPECT_NEAR(color.x, expected.x, 1e-6);
      EXPECT_NEAR(color.y, expected.y, 1e-6);
      EXPECT_NEAR(color.luminance_kcd_m2, expected.luminance_kcd_m2, 1e-5);
    }
  }
}

/// Perez' formula written out for one direction: turbidity 3, sun at 40 degrees elevation in the south, view at 20
/// degrees elevation to the east.
TEST(Sky, FollowsPerezAwayFromTheZenith) {
  const double A = 0.1787 * 3 - 1.4630, B = -0.3554 * 3 + 0.4275, C = -0.0227 * 3 + 5.3251, D = 0.1206 * 3 - 2.5771,
               E = -0.0670 * 3 + 0.3703;
  const auto perez = [&](double theta, double gamma) {
    return (1 + A * std::exp(B / std::cos(theta))) * (1 + C * std::exp(D * gamma) + E * std::pow(std::cos(gamma), 2));
  };
  const double sun_zenith = 50 * kRadians;
  const double gamma = std::acos(std::sin(20 * kRadians) * std::sin(40 * kRadians));  // at a right angle in azimuth
  const double zenith = zenith_color(sun_zenith, 3.0).luminance_kcd_m2;
  const Sky sky(direction(40.0, 180.0), 3.0);
  EXPECT_NEAR(sky.color(direction(20.0, 90.0)).luminance_kcd_m2,
              zenith * perez(70 * kRadians, gamma) / perez(0.0, sun_zenith), 1e-9);
}

TEST(Sky, IsBlueBrightestByTheSunAndPaleAtTheHorizon) {
  const Sky sky(direction(35.0, 200.0), 2.5);
  const PhotometricRgb zenith = sky.radiance(Vec3::UnitZ());
  EXPECT_GT(zenith[2], 1.5 * zenith[0]);
  EXPECT_NEAR(luminance(zenith), sky.color(Vec3::UnitZ()).luminance_kcd_m2, 1e-2 * luminance(zenith));
  const PhotometricRgb horizon = sky.radiance(direction(1.0, 20.0));
  EXPECT_LT(horizon[2] / horizon[0], zenith[2] / zenith[0]);
  const double by_sun = luminance(sky.radiance(direction(35.0, 200.0)));
  for (int azimuth = 0; azimuth < 360; azimuth += 15) {
    for (int elevation = 0; elevation <= 90; elevation += 5)
      EXPECT_LE(luminance(sky.radiance(direction(elevation, azimuth))), 1.0001 * by_sun);
  }
}

TEST(Sky, IsALightEverywhereForEveryTurbidityAndSun) {
  for (double turbidity = kMinTurbidity; turbidity <= kMaxTurbidity; turbidity += 1.0) {
    for (int sun = 0; sun <= 90; sun += 5) {
      const Sky sky(direction(sun, 77.0), turbidity);
      for (int elevation = -10; elevation <= 90; elevation += 5) {
        for (int azimuth = 0; azimuth < 360; azimuth += 30) {
          const PhotometricRgb light = sky.radiance(direction(elevation, azimuth));
          EXPECT_TRUE(std::isfinite(luminance(light)) && luminance(light) > 0.0)
              << turbidity << " " << sun << " " << elevation << " " << azimuth;
        }
      }
    }
  }
}

TEST(Sky, AirMassHasItsPublishedPoints) {
  EXPECT_NEAR(air_mass(kPi / 2), 1.0, 1e-3);  // Kasten and Young 1989, table II
  EXPECT_NEAR(air_mass(30.0 * kRadians), 1.9939, 1e-3);
  EXPECT_NEAR(air_mass(10.0 * kRadians), 5.5841, 5e-3);
  EXPECT_NEAR(air_mass(0.0), 38.0, 0.3);
}

/// A single optical depth for the eye's sensitivity would leave exp(-m tau(555 nm)); for a high sun the spectrum is
/// close to that.
TEST(Sky, SunIsDimmedAndReddenedOnItsWay) {
  const double outside = luminance(sun_illuminance(kPi / 2, 1.0, 2.0, 0.0));
  EXPECT_LT(outside, 133.3);
  const double tau = 0.008735 * std::pow(0.555, -4.08) + (0.04608 * 3.0 - 0.04586) * std::pow(0.555, -1.3);
  EXPECT_NEAR(luminance(sun_illuminance(60.0 * kRadians, 1.0, 3.0, 1013.25)),
              133.3 * std::exp(-tau * air_mass(60.0 * kRadians)), 2.0);
  double last_klx = 1e9, last_blue = 1e9;
  for (const double elevation_deg : {80.0, 40.0, 20.0, 10.0, 5.0, 2.0}) {
    const PhotometricRgb sun = sun_illuminance(elevation_deg * kRadians, 1.0, 3.0, 1013.25);
    EXPECT_LT(luminance(sun), last_klx);
    EXPECT_LT(sun[2] / sun[0], last_blue);
    last_klx = luminance(sun);
    last_blue = sun[2] / sun[0];
  }
  EXPECT_NEAR(luminance(sun_illuminance(kPi / 2, 2.0, 3.0, 900.0)) * 4.0,
              luminance(sun_illuminance(kPi / 2, 1.0, 3.0, 900.0)), 1e-9);  // inverse square of the distance
  EXPECT_GT(luminance(sun_illuminance(0.5, 1.0, 3.0, 700.0)), luminance(sun_illuminance(0.5, 1.0, 3.0, 1013.0)));
}

}  // namespace
}  // namespace tileflight::render::sky_test
