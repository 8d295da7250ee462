#include "tileflight/core/geometry/geodesy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <cmath>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::geometry::geodesy_test {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr double kSemiMajor_m = 6378137.0;             // WGS84
constexpr double kSemiMinor_m = 6356752.314245179498;  // WGS84

Geodetic place(double latitude_deg, double longitude_deg, double height_m) {
  return {latitude_deg, longitude_deg, {height_m}};
}

TEST(Ecef, AxesOfTheEllipsoid) {
  EXPECT_LT((ecef_from_geodetic(place(0, 0, 0)) - Vec3(kSemiMajor_m, 0, 0)).norm(), 1e-8);
  EXPECT_LT((ecef_from_geodetic(place(0, 90, 10)) - Vec3(0, kSemiMajor_m + 10, 0)).norm(), 1e-8);
  EXPECT_LT((ecef_from_geodetic(place(90, 0, 0)) - Vec3(0, 0, kSemiMinor_m)).norm(), 1e-8);
  EXPECT_LT((ecef_from_geodetic(place(-90, 0, -5)) - Vec3(0, 0, -kSemiMinor_m + 5)).norm(), 1e-8);
}

TEST(Ecef, EqualsTheTextbookFormula) {
  const double e2 = 1.0 - std::pow(kSemiMinor_m / kSemiMajor_m, 2);
  const Geodetic stadium = place(35.310344, -80.740007, 190.0);
  const double latitude = stadium.latitude_deg * M_PI / 180, longitude = stadium.longitude_deg * M_PI / 180;
  const double n = kSemiMajor_m / std::sqrt(1 - e2 * std::pow(std::sin(latitude), 2));
  const Vec3 expected((n + 190.0) * std::cos(latitude) * std::cos(longitude),
                      (n + 190.0) * std::cos(latitude) * std::sin(longitude),
                      (n * (1 - e2) + 190.0) * std::sin(latitude));
  EXPECT_LT((ecef_from_geodetic(stadium) - expected).norm(), 1e-8);
}

TEST(Ecef, RoundTripOverTheGlobe) {
  for (double latitude = -89.5; latitude < 90; latitude += 17.9) {
    for (double longitude = -179.5; longitude < 180; longitude += 33.3) {
      for (const double height : {-400.0, 0.0, 2885.0, 400000.0}) {
        const Geodetic back = geodetic_from_ecef(ecef_from_geodetic(place(latitude, longitude, height)));
        EXPECT_NEAR(back.latitude_deg, latitude, 1e-12);
        EXPECT_NEAR(back.longitude_deg, longitude, 1e-12);
        EXPECT_NEAR(back.height.m, height, 1e-8);
      }
    }
  }
}

TEST(Ecef, RefusesImpossiblePlaces) {
  EXPECT_THAT([&] { ecef_from_geodetic(place(90.1, 0, 0)); },
              ThrowsMessage<InputError>(HasSubstr("the latitude must lie between -90 and 90")));
  EXPECT_THAT([&] { ecef_from_geodetic(place(0, 361, 0)); },
              ThrowsMessage<InputError>(HasSubstr("the longitude must lie between -180 and 180")));
  EXPECT_THAT([&] { ecef_from_geodetic(place(std::nan(""), 0, 0)); },
              ThrowsMessage<InputError>(HasSubstr("is not finite")));
  EXPECT_THAT([&] { geodetic_from_ecef(Vec3(0, std::nan(""), 0)); },
              ThrowsMessage<InputError>(HasSubstr("earth-centred position: is not finite")));
  EXPECT_THAT([&] { LocalFrame(place(0, 0, std::nan(""))); },
              ThrowsMessage<InputError>(HasSubstr("origin: the height is not finite")));
}

TEST(LocalFrame, AxesAreEastNorthUp) {
  const Geodetic origin = place(35.310344, -80.740007, 190.0);
  const LocalFrame frame(origin);
  EXPECT_LT(frame.local_from_geodetic(origin).norm(), 1e-8);
  const Vec3 up = frame.local_from_geodetic(place(35.310344, -80.740007, 290.0));
  EXPECT_LT((up - Vec3(0, 0, 100)).norm(), 1e-6);
  const Vec3 north = frame.local_from_geodetic(place(35.310344 + 1e-4, -80.740007, 190.0));
  EXPECT_NEAR(north.y(), 11.0946, 1e-3);  // length of a meridian's degree at this latitude: 110 946 m
  EXPECT_NEAR(north.x(), 0.0, 1e-6);
  const Vec3 east = frame.local_from_geodetic(place(35.310344, -80.740007 + 1e-4, 190.0));
  EXPECT_GT(east.x(), 9.0);
  EXPECT_NEAR(east.y(), 0.0, 1e-3);
}

TEST(LocalFrame, IsRigidAndRoundTripsToTheMicrometre) {
  const LocalFrame frame(place(-0.2, -78.5, 2885.0));
  const Vec3 local(400.0, -250.0, 30.0);
  EXPECT_LT((frame.local_from_geodetic(frame.geodetic_from_local(local)) - local).norm(), 1e-8);
  EXPECT_LT((frame.T_local_ecef() * (frame.T_ecef_local() * local) - local).norm(), 1e-8);
  EXPECT_EQ(frame.origin().height.m, 2885.0);
}

TEST(Geoid, KnownUndulations) {
  // EGM96 at four positions, from the model's published table (WW15MGH.GRD nodes).
  EXPECT_NEAR(ellipsoidal_from_orthometric(0.0, 0.0, {0.0}).m, 17.16, 0.02);
  EXPECT_NEAR(ellipsoidal_from_orthometric(90.0, 0.0, {0.0}).m, 13.61, 0.02);
  EXPECT_NEAR(ellipsoidal_from_orthometric(-90.0, 0.0, {0.0}).m, -29.53, 0.02);
  EXPECT_NEAR(ellipsoidal_from_orthometric(38.6281550, 269.7791550, {100.0}).m, 100.0 - 31.628, 0.02);
}

TEST(Geoid, BadInputIsRefused) {
  EXPECT_THAT([&] { ellipsoidal_from_orthometric(100.0, 0.0, {0.0}); },
              ThrowsMessage<InputError>(HasSubstr("the latitude must lie between -90 and 90")));
  EXPECT_THAT([&] { ellipsoidal_from_orthometric(0.0, 0.0, {std::nan("")}); },
              ThrowsMessage<InputError>(HasSubstr("height above sea level: is not finite")));
}

TEST(Geoid, HeightsAboveSeaLevelGoThereAndBack) {
  for (const auto& [lat, lon] : {std::pair(0.0, 0.0), {-0.24, -78.52}, {34.76, 32.41}, {89.9, -170.0}}) {
    const EllipsoidalHeight height = ellipsoidal_from_orthometric(lat, lon, {123.4});
    EXPECT_NEAR(orthometric_from_ellipsoidal({lat, lon, height}).m, 123.4, 1e-9);
  }
  EXPECT_THAT(
      [&] {
        orthometric_from_ellipsoidal({0.0, 0.0, {std::nan("")}});
      },
      ThrowsMessage<InputError>(HasSubstr("height above the ellipsoid: is not finite")));
}

TEST(Geoid, AMissingGridIsRefusedNeverTakenAsZero) {
  const tests::TemporaryFolder empty;
  const char* before = getenv("PROJ_LIB");
  const std::string restored = before == nullptr ? "" : before;
  setenv("PROJ_LIB", empty.path().c_str(), 1);
  EXPECT_THAT([] { ellipsoidal_from_orthometric(35.0, -80.0, {0.0}); },
              ThrowsMessage<InputError>(HasSubstr("egm96_15.gtx: is not installed")));
  before == nullptr ? unsetenv("PROJ_LIB") : setenv("PROJ_LIB", restored.c_str(), 1);
}

}  // namespace
}  // namespace tileflight::geometry::geodesy_test
