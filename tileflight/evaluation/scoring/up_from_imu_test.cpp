#include "tileflight/evaluation/scoring/up_from_imu.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/data/dataset/sensor_files.h"

namespace tileflight::scoring::up_from_imu_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

/// A camera that looks 40 degrees down and flies straight on, in a map whose up is y, 0.1 units a metre.
class UpByInertialUnit : public testing::Test {
 protected:
  UpByInertialUnit() {
    for (int k = 0; k < 40; ++k) path_.poses.push_back({0.1 * k, SE3(R_map_camera_, Vec3(0.05 * k, 0.0, 0.0))});
    dataset_.folder = folder_.path();
    dataset_.imu = folder_ / "imu.csv";
  }

  /// IMU readings at rest, in the axes that R_cam_imu maps to the camera's.
  void write_imu(const Eigen::Quaterniond& R_cam_imu) {
    std::vector<geometry::ImuSample> readings;
    const Vec3 force = R_cam_imu.conjugate() * (R_map_camera_.conjugate() * Vec3(0.0, 9.81, 0.0));
    for (int k = 0; k < 400; ++k) readings.push_back({0.01 * k, Vec3::Zero(), force});
    dataset::write_imu_csv(folder_ / "imu.csv", readings);
  }

  const Eigen::Quaterniond R_map_camera_{Eigen::AngleAxisd(std::numbers::pi + 0.7, Vec3::UnitX())};
  const Eigen::Quaterniond R_cam_body_{Eigen::AngleAxisd(0.5 * std::numbers::pi, Vec3(1, 2, 3).normalized())};
  tests::TemporaryFolder folder_;
  geometry::Trajectory path_;
  dataset::Dataset dataset_;
};

TEST_F(UpByInertialUnit, ReadingsAreTurnedIntoTheCamerasAxes) {
  write_imu(R_cam_body_);
  dataset_.calibration.T_cam_imu.rotation = R_cam_body_;
  const auto up = up_from_imu(dataset_, path_);
  ASSERT_TRUE(up);
  EXPECT_LT((up->up_map - Vec3::UnitY()).norm(), 1e-6);
  EXPECT_FALSE(up->given);
}

TEST_F(UpByInertialUnit, NoFileIsNoUpAndABrokenOneIsSaid) {
  dataset_.imu.clear();
  EXPECT_FALSE(up_from_imu(dataset_, path_));
  dataset_.imu = folder_ / "imu.csv";
  base::write_file(folder_ / "imu.csv", "1,2,3\n");
  EXPECT_THAT([&] { up_from_imu(dataset_, path_); },
              ThrowsMessage<InputError>(HasSubstr("expected a time and 6 numbers, found 3 fields")));
  EXPECT_FALSE(up_from_imu(dataset_, {}));  // no rotation known
}

}  // namespace
}  // namespace tileflight::scoring::up_from_imu_test
