#include "tileflight/capture/sensors/sensor_suite.h"

#include <gmock/gmock.h>

#include <fstream>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"

namespace tileflight::sensors::sensor_suite_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using testing::HasSubstr;

class SensorSuiteFile : public testing::Test {
 protected:
  SensorSuite read(const std::string& text) {
    std::ofstream(folder_ / "flight.yaml") << "camera: camera.yaml\n" << text;
    return read_sensor_suite(folder_ / "flight.yaml", 7, kMount);
  }
  std::string fault(const std::string& text) {
    return tests::refusal_of([&] { read(text); });
  }
  const SE3 kMount{Eigen::Quaterniond(0.5, 0.5, 0.5, 0.5), Vec3(1, 2, 3)};
  tests::TemporaryFolder folder_;
};

TEST_F(SensorSuiteFile, NothingUnlessAskedFor) {
  const SensorSuite suite = read("fps: 5\n");
  EXPECT_FALSE(suite.imu || suite.gnss || suite.barometer || suite.magnetometer || suite.range_finder || suite.lidar);
  EXPECT_FALSE(suite.needs_scene());
}

TEST_F(SensorSuiteFile, EachSensorHasItsKeys) {
  const SensorSuite suite = read(R"(sensors:
  imu: {preset: bmi160, rate_hz: 400, gyroscope_bias: [0.1, 0, 0], gyroscope_scale_misalignment: [1, 2, 3, 4, 5, 6, 7, 8, 9]}
  gnss: {lag_s: 0.2, seed: 3}
  barometer: {noise_pa: 3, origin_above_sea_m: 2800}
  magnetometer: {declination_deg: 0, inclination_deg: 90, strength_ut: 30}
  range_finder: {frame: camera, rays: 5}
  lidar: {preset: vlp-16, rate_hz: 5, motion: corrected, format: kitti, T_cam_lidar: [1, 0, 0, 4, 0, 1, 0, 5, 0, 0, 1, 6, 0, 0, 0, 1]}
)");
  ASSERT_TRUE(suite.imu && suite.gnss && suite.barometer && suite.magnetometer && suite.range_finder && suite.lidar);
  EXPECT_EQ(suite.imu->seed, 7U);
  EXPECT_EQ(suite.imu->rate_hz, 400.0);
  EXPECT_EQ(suite.imu->accelerometer_noise_density, imu_preset("bmi160").accelerometer_noise_density);
  EXPECT_EQ(suite.imu->gyroscope_scale_misalignment(0, 2), 3.0);
  EXPECT_EQ(suite.imu->T_camera_imu.translation, kMount.translation);
  EXPECT_EQ(suite.gnss->seed, 3U);
  EXPECT_EQ(suite.origin_above_sea_m, 2800.0);
  EXPECT_LT((*suite.magnetic_field.fixed_field_ut - Vec3(0, 0, -30)).norm(), 1e-9);
  EXPECT_EQ(suite.range_finder->direction, Vec3(0, 0, 1));
  EXPECT_EQ(std::get<SpinningPattern>(suite.lidar->pattern).rate_hz, 5.0);
  EXPECT_EQ(suite.lidar->motion, ScanMotion::kCorrected);
  EXPECT_EQ(suite.lidar->T_camera_lidar.translation, Vec3(4, 5, 6));
  EXPECT_TRUE(suite.kitti_scans);
}

TEST_F(SensorSuiteFile, ALidarOfOnesOwn) {
  const SensorSuite suite =
      read("sensors: {lidar: {pattern: spinning, channels: 3, elevation_range_deg: [-10, 20], columns: 100}}\n");
  const auto& pattern = std::get<SpinningPattern>(suite.lidar->pattern);
  EXPECT_EQ(pattern.elevations_deg, (std::vector<double>{-10, 5, 20}));
  EXPECT_EQ(pattern.columns, 100);
}

TEST_F(SensorSuiteFile, ASensorWithoutKeysIsTheDefaultOne) {
  const SensorSuite suite = read("sensors:\n  barometer:\n  imu:\n");
  ASSERT_TRUE(suite.barometer);
  ASSERT_TRUE(suite.imu);
  EXPECT_EQ(suite.barometer->rate_hz, BarometerOptions{}.rate_hz);
  EXPECT_FALSE(suite.lidar);
}

TEST_F(SensorSuiteFile, MayBeAFileOfItsOwn) {
  std::ofstream(folder_ / "rig.yaml") << "imu: {rate_hz: 100}\n";
  EXPECT_EQ(read("sensors_file: rig.yaml\n").imu->rate_hz, 100.0);
  EXPECT_THAT(fault("sensors_file: rig.yaml\nsensors: {}\n"), HasSubstr("are both given"));
}

TEST_F(SensorSuiteFile, WhatIsWrongIsNamed) {
  EXPECT_THAT(fault("sensors: {lidra: {}}\n"),
              HasSubstr("flight.yaml:2: 'sensors.lidra' is not a key here; did you mean 'lidar'?"));
  EXPECT_THAT(fault("sensors: {imu: {rate: 5}}\n"), HasSubstr("did you mean 'rate_hz'?"));
  EXPECT_THAT(fault("sensors: {imu: {preset: best}}\n"), HasSubstr("must be one of: adis16448, bmi160, perfect"));
  EXPECT_THAT(fault("sensors: {lidar: {preset: livox-mid-40, columns: 5}}\n"), HasSubstr("'sensors.lidar.columns'"));
  EXPECT_THAT(fault("sensors: {lidar: {pattern: spinning}}\n"), HasSubstr("channels must be 1 or more"));
  EXPECT_THAT(fault("sensors: {magnetometer: {strength_ut: 30}}\n"), HasSubstr("give all three or none"));
  EXPECT_THAT(fault("sensors: {range_finder: {max_range_m: -1}}\n"), HasSubstr("must be more than min_range"));
  EXPECT_THAT(fault("sensors: {barometer: {rate_hz: 0}}\n"), HasSubstr("must lie between 0 and 100000"));
  EXPECT_THAT(fault("sensors: {lidar: {T_cam_lidar: [1,0,0,0, 0,2,0,0, 0,0,1,0, 0,0,0,1]}}\n"),
              HasSubstr("is not a rigid motion"));
}

}  // namespace
}  // namespace tileflight::sensors::sensor_suite_test
