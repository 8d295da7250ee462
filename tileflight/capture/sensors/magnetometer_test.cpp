#include "tileflight/capture/sensors/magnetometer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tileflight/capture/flight_path/path.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::sensors::magnetometer_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

Vec3 northern_field(const Vec3&) { return magnetic_field_from_angles_ut(0.0, 60.0, 40.0); }

// A camera that looks level along a heading: the level part of the field lies `heading` to its left.
TEST(Magnetometer, TheHeadingCanBeReadFromIt) {
  const auto turning = [](double t) { return SE3(flight_path::camera_orientation(20.0 * t, 0, 0), Vec3(0, 0, 10)); };
  const auto samples = simulate_magnetometer(turning, northern_field, 0.0, 8.0, {.rate_hz = 10.0, .noise_ut = 0.0});
  ASSERT_EQ(samples.size(), 81U);
  for (const MagnetometerSample& sample : samples) {
    const double heading_deg = std::atan2(-sample.field_ut.x(), sample.field_ut.z()) * 180.0 / M_PI;
    EXPECT_NEAR(heading_deg, 20.0 * sample.time_s, 1e-9);
    EXPECT_NEAR(sample.field_ut.y(), 40.0 * std::sin(M_PI / 3), 1e-9);  // the camera's y points down
  }
}

TEST(Magnetometer, TheVehiclesOwnFieldIsAdded) {
  MagnetometerOptions options{.noise_ut = 0.0};
  options.soft_iron(0, 1) = 0.1;
  options.hard_iron_ut = Vec3(5, 0, -3);
  options.T_camera_sensor = SE3(Eigen::Quaterniond(Eigen::AngleAxisd(M_PI / 2, Vec3::UnitX())), Vec3(1, 2, 3));
  const auto level = [](double) { return SE3(flight_path::camera_orientation(0, 0, 0), Vec3::Zero()); };
  const Vec3 field = simulate_magnetometer(level, northern_field, 0.0, 0.0, options).at(0).field_ut;
  // Camera axes: (0, down, north); a quarter turn about x brings (y, z) to (z, -y).
  const double down = 40.0 * std::sin(M_PI / 3), north = 20.0;
  EXPECT_LT((field - Vec3(0.1 * north + 5, north, -down - 3)).norm(), 1e-9);
}

TEST(Magnetometer, NoiseHasItsSize) {
  const auto still = [](double) { return SE3(); };
  const auto samples = simulate_magnetometer(still, northern_field, 0.0, 1000.0, {.rate_hz = 50.0, .noise_ut = 0.4});
  double squares = 0.0;
  for (const MagnetometerSample& sample : samples) squares += (sample.field_ut - northern_field({})).squaredNorm();
  EXPECT_NEAR(std::sqrt(squares / (3.0 * static_cast<double>(samples.size()))), 0.4, 0.005);
  EXPECT_THAT([&] { simulate_magnetometer(still, northern_field, 0, 1, {.noise_ut = -1.0}); },
              ThrowsMessage<InputError>(HasSubstr("magnetometer noise: must be 0 or more")));
}

}  // namespace
}  // namespace tileflight::sensors::magnetometer_test

namespace tileflight::sensors::geomagnetic_field_test {
namespace {

using geometry::LocalFrame;
using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

// WMM2025_TEST_VALUES.txt as NOAA publishes it with the model: year, height, latitude, longitude; north, east, down.
TEST(GeomagneticField, IsThePublishedOne) {
  struct Row {
    double year, height_km, latitude_deg, longitude_deg;
    double north_nt, east_nt, down_nt;
  };
  for (const Row& row : {Row{2025.0, 0, 80, 0, 6521.6, 145.9, 54791.5},
                         {2025.0, 0, 0, 120, 39677.8, -109.6, -10580.2},
                         {2025.0, 0, -80, 240, 6117.5, 15751.9, -52022.5},
                         {2025.0, 100, 80, 0, 6216.0, 92.4, 52598.8},
                         {2025.0, 100, 0, 120, 37688.6, -96.2, -10152.1},
                         {2025.0, 100, -80, 240, 5907.6, 14780.3, -49540.7},
                         {2027.5, 0, 80, 0, 6500.8, 294.5, 54869.4},
                         {2027.5, 0, 0, 120, 39701.6, -167.4, -10381.8},
                         {2027.5, 0, -80, 240, 6200.7, 15730.3, -51783.7},
                         {2027.5, 100, 80, 0, 6196.7, 233.8, 52670.5},
                         {2027.5, 100, 0, 120, 37711.5, -148.7, -9969.8}}) {
    const LocalFrame frame({row.latitude_deg, row.longitude_deg, {1000.0 * row.height_km}});
    const Vec3 field_nt = 1000.0 * geomagnetic_field_ut(frame, Vec3::Zero(), row.year);
    EXPECT_LT((field_nt - Vec3(row.east_nt, row.north_nt, -row.down_nt)).cwiseAbs().maxCoeff(), 0.06)
        << row.latitude_deg << " " << row.year << ": " << field_nt.transpose();
  }
}

TEST(GeomagneticField, APointAwayFromTheOriginIsTakenWhereItIs) {
  const LocalFrame below({-0.2, -78.5, {0.0}}), above({-0.2, -78.5, {5000.0}});
  EXPECT_LT(
      (geomagnetic_field_ut(below, Vec3(0, 0, 5000), 2026) - geomagnetic_field_ut(above, Vec3::Zero(), 2026)).norm(),
      1e-9);
}

TEST(GeomagneticField, AnglesAreACompasss) {
  EXPECT_LT((magnetic_field_from_angles_ut(90, 0, 50) - Vec3(50, 0, 0)).norm(), 1e-12);
  EXPECT_LT((magnetic_field_from_angles_ut(0, 90, 50) - Vec3(0, 0, -50)).norm(), 1e-12);
}

TEST(GeomagneticField, HoldsForItsYearsOnly) {
  const LocalFrame frame({0, 0, {0}});
  EXPECT_THAT([&] { geomagnetic_field_ut(frame, Vec3::Zero(), 2024.9); },
              ThrowsMessage<InputError>(HasSubstr("is valid from 2025 to 2030")));
  EXPECT_THAT([&] { geomagnetic_field_ut(frame, Vec3::Zero(), 2031.0); },
              ThrowsMessage<InputError>(HasSubstr("is valid from 2025 to 2030")));
}

}  // namespace
}  // namespace tileflight::sensors::geomagnetic_field_test
