#include "tileflight/data/dataset/sensor_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <limits>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::dataset::imu_files_test {
namespace {

using geometry::Vec3;
using testing::HasSubstr;

class ImuFiles : public testing::Test {
 protected:
  std::string fault(const std::string& text) {
    std::ofstream(folder_ / "imu.csv") << text;
    return tests::refusal_of([&] { read_imu_csv(folder_ / "imu.csv"); });
  }
  tests::TemporaryFolder folder_;
};

TEST_F(ImuFiles, ReadingsComeBackAsTheyWere) {
  const std::vector<geometry::ImuSample> written{{0.0, Vec3(1e-9, -2.5, 0), Vec3(0.1, 0.2, 9.80665)},
                                                 {1403636579.763555584, Vec3(1.0 / 3, 0, 0), Vec3(-1e5, 1e-300, 4)}};
  write_imu_csv(folder_ / "imu.csv", written);
  const std::vector<geometry::ImuSample> read = read_imu_csv(folder_ / "imu.csv");
  ASSERT_EQ(read.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_NEAR(read[i].time_s, written[i].time_s, 1e-6);
    EXPECT_EQ(read[i].angular_rate_rad_s, written[i].angular_rate_rad_s);
    EXPECT_EQ(read[i].specific_force_m_s2, written[i].specific_force_m_s2);
  }
}

// The first lines of EuRoC's V1_01_easy.
TEST_F(ImuFiles, EurocsOwnLinesAreRead) {
  std::ofstream(folder_ / "imu.csv")
      << "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],a_RS_S_y [m "
         "s^-2],a_RS_S_z [m s^-2]\r\n"
      << "1403715273262142976,-0.0020943951023931952,0.017453292519943295,0.07749261878854824,9.0874956666666655,"
         "0.13075533333333333,-3.6938381666666662\r\n";
  const std::vector<geometry::ImuSample> read = read_imu_csv(folder_ / "imu.csv");
  ASSERT_EQ(read.size(), 1U);
  EXPECT_DOUBLE_EQ(read[0].angular_rate_rad_s.y(), 0.017453292519943295);
  EXPECT_DOUBLE_EQ(read[0].specific_force_m_s2.x(), 9.0874956666666655);
}

// Several programs name the same columns and units in their own words.
TEST_F(ImuFiles, TheHeaderDecidesWhichColumnIsWhich) {
  const std::vector<std::string> files{
      "#timestamp [ns],a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2],w_RS_S_x [rad s^-1],w_RS_S_y [rad "
      "s^-1],w_RS_S_z [rad s^-1]\n5000000,1,2,9.5,0.1,0.2,0.3\n",
      "t,ax,ay,az,gx,gy,gz\n5000000,1,2,9.5,0.1,0.2,0.3\n",
      "timestamp (s),gyro_z,gyro_y,gyro_x,accel_x,accel_y,accel_z\n0.005,0.3,0.2,0.1,1,2,9.5\n",
      "time linear_acceleration.x linear_acceleration.y linear_acceleration.z temperature angular_velocity.x "
      "angular_velocity.y angular_velocity.z\n5000000 1 2 9.5 21 0.1 0.2 0.3\n"};
  for (const std::string& text : files) {
    std::ofstream(folder_ / "imu.csv") << text;
    const std::vector<geometry::ImuSample> read = read_imu_csv(folder_ / "imu.csv");
    ASSERT_EQ(read.size(), 1U);
    EXPECT_EQ(read[0].time_s, 0.005) << text;
    EXPECT_EQ(read[0].angular_rate_rad_s, Vec3(0.1, 0.2, 0.3)) << text;
    EXPECT_EQ(read[0].specific_force_m_s2, Vec3(1, 2, 9.5)) << text;
  }
}

/// `rostopic echo -p` of sensor_msgs/Imu, whose frame may have no name.
TEST_F(ImuFiles, RosTablesMayHaveEmptyFields) {
  std::ofstream(folder_ / "imu.csv")
      << "%time,field.header.seq,field.header.stamp,field.header.frame_id,field.orientation.x,"
         "field.angular_velocity.x,field.angular_velocity.y,field.angular_velocity.z,"
         "field.angular_velocity_covariance0,field.linear_acceleration.x,field.linear_acceleration.y,"
         "field.linear_acceleration.z,field.linear_acceleration_covariance0\n"
         "5000000,1,4000000,,0,0.1,0.2,0.3,-1,1,2,9.5,-1\n";
  const std::vector<geometry::ImuSample> read = read_imu_csv(folder_ / "imu.csv");
  ASSERT_EQ(read.size(), 1U);
  EXPECT_EQ(read[0].time_s, 0.005);
  EXPECT_EQ(read[0].angular_rate_rad_s, Vec3(0.1, 0.2, 0.3));
  EXPECT_EQ(read[0].specific_force_m_s2, Vec3(1, 2, 9.5));
}

TEST_F(ImuFiles, UnitsOfTheHeaderAreConverted) {
  std::ofstream(folder_ / "imu.csv")
      << "t [s],gyro_x [deg/s],gyro_y [deg/s],gyro_z [deg/s],acc_x [g],acc_y [g],acc_z [g]\n0,180,0,0,0,0,1\n";
  const std::vector<geometry::ImuSample> read = read_imu_csv(folder_ / "imu.csv");
  EXPECT_NEAR(read.at(0).angular_rate_rad_s.x(), 3.14159265358979, 1e-12);
  EXPECT_NEAR(read.at(0).specific_force_m_s2.z(), 9.80665, 1e-12);
  EXPECT_THAT(fault("t,gyro_x [rpm],gyro_y,gyro_z,acc_x,acc_y,acc_z\n"), HasSubstr("the unit \"rpm\" of its header"));
}

TEST_F(ImuFiles, WhatAHeaderDoesNotSayIsNoted) {
  std::ofstream(folder_ / "imu.csv") << "t,gx,gy,gz,ax,ay,az,temperature\n0,0,0,0,0,0,9.8,20\n";
  std::vector<std::string> notes;
  read_imu_csv(folder_ / "imu.csv", notes);
  EXPECT_THAT(notes, testing::ElementsAre(HasSubstr("radians a second and metres a second squared are assumed"),
                                          HasSubstr("columns that are not used: temperature")));
}

TEST_F(ImuFiles, AHeaderThatLacksAReadingIsRefused) {
  EXPECT_THAT(fault("t,gx,gy,ax,ay,az\n0,0,0,0,0,0\n"), HasSubstr("must name a time, three angular rates"));
  EXPECT_THAT(fault("t,ax,ay,az,accel_x,gx,gy,gz\n"), HasSubstr("names the same reading twice: ax and accel_x"));
  EXPECT_THAT(fault("t,q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0,0\n"), HasSubstr("but it names t, q1"));
}

TEST_F(ImuFiles, WithoutAHeaderGravityTellsTheAccelerometer) {
  EXPECT_THAT(fault("0,0,0.2,9.8,0.01,0,0.02\n5,0,0.1,9.7,0.01,0,0\n"),
              HasSubstr("the first three numbers have the length of gravity (9.75 on average"));
}

TEST_F(ImuFiles, DamageIsNamedWithItsLine) {
  EXPECT_THAT(fault("1,2,3\n"), HasSubstr("imu.csv: line 1: expected a time and 6 numbers"));
  EXPECT_THAT(fault("#h\n0,0,0,0,0,0,nan\n"), HasSubstr("line 2: \"nan\" is not a finite number"));
  EXPECT_THAT(fault("0.5,0,0,0,0,0,0\n"), HasSubstr("is not a time in whole nanoseconds"));
  EXPECT_THAT(fault("5,0,0,0,0,0,0\n5,0,0,0,0,0,0\n"), HasSubstr("line 2: the time is not after"));
}

TEST_F(ImuFiles, TheCalibrationIsKalibrs) {
  write_imu_yaml(folder_ / "imu.yaml", {400.0, 2e-3, 3e-3, 1.7e-4, 1.9e-5});
  EXPECT_THAT(base::read_text(folder_ / "imu.yaml"), HasSubstr("update_rate: 400\n"));
  const ImuCalibration read = read_imu_noise(folder_ / "imu.yaml");
  EXPECT_EQ(read.update_rate_hz, 400.0);
  EXPECT_EQ(read.accelerometer_noise_density, 2e-3);
  EXPECT_EQ(read.gyroscope_random_walk, 1.9e-5);
  std::ofstream(folder_ / "short.yaml") << "update_rate: 200\n";
  EXPECT_THAT(tests::refusal_of([&] { read_imu_noise(folder_ / "short.yaml"); }),
              HasSubstr("accelerometer_noise_density"));
}

TEST_F(ImuFiles, NoiseIsFoundWhereOtherProgramsWriteIt) {
  const std::string values =
      "accelerometer_noise_density: 0.01, accelerometer_random_walk: 0.0002, gyroscope_noise_density: 0.005, "
      "gyroscope_random_walk: 4.0e-06, update_rate: 200.0, time_offset: 0.0";
  base::write_file(folder_ / "kalibr.yaml",
                   "imu0: {T_i_b: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], " + values + "}\n");
  base::write_file(folder_ / "basalt.json",
                   R"({"value0": {"imu_update_rate": 200.0, "accel_noise_std": [0.01, 0.01, 0.009], "gyro_noise_std":
                       [0.005, 0.004, 0.005], "accel_bias_std": [0.0002, 0.0002, 0.0002],
                       "gyro_bias_std": [4e-06, 4e-06, 4e-06]}})");
  for (const char* name : {"kalibr.yaml", "basalt.json"}) {
    const ImuCalibration noise = read_imu_noise(folder_ / name);
    EXPECT_EQ(noise.update_rate_hz, 200.0) << name;
    EXPECT_EQ(noise.accelerometer_noise_density, 0.01) << name;
    EXPECT_EQ(noise.gyroscope_noise_density, 0.005) << name;
    EXPECT_EQ(noise.accelerometer_random_walk, 2e-4) << name;
    EXPECT_EQ(noise.gyroscope_random_walk, 4e-6) << name;
  }
  base::write_file(folder_ / "vins.yaml", "acc_n: 0.08\ngyr_n: 0.004\nacc_w: 0.00004\ngyr_w: 2.0e-6\n");
  EXPECT_THAT(tests::refusal_of([&] { read_imu_noise(folder_ / "vins.yaml"); }),
              HasSubstr("VINS's \"acc_n\", \"gyr_n\", which are deviations of single readings"));
}

}  // namespace
}  // namespace tileflight::dataset::imu_files_test

namespace tileflight::dataset::attitude_csv_test {
namespace {

using testing::HasSubstr;

constexpr const char* kHeader = "t,qx,qy,qz,qw,tilt_sigma_deg,yaw_sigma_deg\n";

TEST(AttitudeCsv, ComesBackAsItWas) {
  const tests::TemporaryFolder folder;
  const std::vector<CameraAttitude> attitudes = {{0.0, geometry::so3_exp({0.1, -2.0, 0.4}), 0.5, 3.0},
                                                 {0.1, geometry::so3_exp({0.2, -2.0, 0.4}), 2.0, 6.0}};
  write_attitude_csv(folder.path() / "attitude.csv", attitudes);
  const auto read = read_attitude_csv(folder.path() / "attitude.csv");
  ASSERT_EQ(read.size(), 2U);
  EXPECT_LT(read[1].R_enu_camera.angularDistance(attitudes[1].R_enu_camera), 1e-8);
  EXPECT_EQ(read[1].time_s, 0.1);
  EXPECT_EQ(read[0].yaw_sigma_deg, 3.0);
}

TEST(AttitudeCsv, BrokenFilesAreNamedWithTheirRow) {
  const tests::TemporaryFolder folder;
  const auto file = folder.path() / "attitude.csv";
  const auto refused = [&](const std::string& text) {
    base::write_file(file, text);
    return tests::refusal_of([&] { read_attitude_csv(file); });
  };
  EXPECT_THAT(refused("a,b\n1,2\n"), HasSubstr("columns"));
  EXPECT_THAT(refused(std::string(kHeader) + "0,0,0,0,1,1,1\n0,0,0,0,1,1,1\n"), HasSubstr("row 2"));
  EXPECT_THAT(refused(std::string(kHeader) + "0,0,0,0,0.5,1,1\n"), HasSubstr("length"));
  EXPECT_THAT(refused(std::string(kHeader) + "0,0,0,0,1,0,1\n"), HasSubstr("above zero"));
  EXPECT_THAT(refused(std::string(kHeader) + "0,inf,0,0,1,1,1\n"), HasSubstr("finite"));
}

}  // namespace
}  // namespace tileflight::dataset::attitude_csv_test

namespace tileflight::dataset::number_table_test {
namespace {

using testing::HasSubstr;

TEST(NumberTable, NumbersComeBackAsTheyWere) {
  const tests::TemporaryFolder folder;
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const NumberTable written{{"t [s]", "range [m]"}, {{0.1, kInfinity}, {1.0 / 3, -kInfinity}, {1e9 + 0.001, 1e-20}}};
  write_number_table(folder / "range.csv", written);
  const NumberTable read = read_number_table(folder / "range.csv");
  EXPECT_EQ(read.columns, written.columns);
  EXPECT_EQ(read.rows, written.rows);
}

TEST(NumberTable, DamageIsNamedWithItsLine) {
  const tests::TemporaryFolder folder;
  const auto fault = [&](const char* text) {
    std::ofstream(folder / "t.csv") << text;
    return tests::refusal_of([&] { read_number_table(folder / "t.csv"); });
  };
  EXPECT_THAT(fault(""), HasSubstr("t.csv: is empty"));
  EXPECT_THAT(fault("a,b\n1,2\n1\n"), HasSubstr("line 3: has 1 numbers, but the header has 2"));
  EXPECT_THAT(fault("a,b\n1,x\n"), HasSubstr("line 2: \"x\" is not a number"));
}

}  // namespace
}  // namespace tileflight::dataset::number_table_test
