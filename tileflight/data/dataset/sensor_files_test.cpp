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
