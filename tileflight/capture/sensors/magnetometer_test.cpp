#include "tileflight/capture/sensors/magnetometer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tileflight/core/base/input_error.h"
#include "tileflight/capture/flight_path/path.h"
#include "tileflight/capture/sensors/geomagnetic_field.h"

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
