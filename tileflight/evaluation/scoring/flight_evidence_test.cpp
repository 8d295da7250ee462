#include "tileflight/evaluation/scoring/flight_evidence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>
#include <random>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/data/dataset/sensor_files.h"

namespace tileflight::scoring::flight_evidence_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

dataset::Dataset frames_at(const std::vector<double>& times_s) {
  dataset::Dataset dataset;
  for (const double t : times_s) dataset.frames.push_back({std::to_string(t), "absent.png", t});
  return dataset;
}

/// Looks down from 10 over the plane z = 0, and turns by `turn_rad` a picture.
geometry::Trajectory path_of(int poses, double turn_rad) {
  geometry::Trajectory path;
  const Eigen::Quaterniond down(Eigen::AngleAxisd(-0.75 * std::numbers::pi, Vec3::UnitX()));  // 45 degrees ahead
  for (int k = 0; k < poses; ++k)
    path.poses.push_back({0.5 * k, SE3(Eigen::Quaterniond(Eigen::AngleAxisd(turn_rad * k, Vec3::UnitZ())) * down,
                                       Vec3(0.5 * k, 0.0, 10.0))});
  return path;
}

/// Level ground with noise.
geometry::PointCloud ground() {
  geometry::PointCloud cloud;
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  for (int k = 0; k < 500; ++k)
    cloud.positions.emplace_back(8.0 * unit(random), 8.0 * unit(random), 0.02 * unit(random));
  return cloud;
}

TEST(FlightEvidence, HasThePicturesThatHaveAPose) {
  const auto evidence = make_flight_evidence(frames_at({0.0, 0.3, 0.5, 1.0, 7.0}), path_of(4, 0.1), ground());
  ASSERT_EQ(evidence.pictures.T_map_camera.size(), 3U);  // at 0, 0.5 and 1 s
  EXPECT_EQ(evidence.pictures.T_map_camera[1].translation, Vec3(0.5, 0.0, 10.0));
  EXPECT_EQ(evidence.points.size(), 500U);
  EXPECT_THAT([&] { evidence.pictures.picture(0); },
              ThrowsMessage<InputError>(HasSubstr("absent.png: cannot be opened")));  // only now is the file read
}

TEST(FlightEvidence, APictureThatCannotBeDecodedIsLeftOut) {
  const tests::TemporaryFolder folder;
  base::write_file(folder / "torn.jpg", "\xff\xd8\xff\xe0");
  dataset::Dataset dataset = frames_at({0.0, 0.5, 1.0});
  dataset.frames[1].image = folder / "torn.jpg";
  const auto evidence = make_flight_evidence(dataset, path_of(4, 0.1), ground());
  EXPECT_EQ(evidence.pictures.picture(1), std::nullopt);
  geometry::write_tum(folder / "trajectory.txt", path_of(4, 0.1));
  const localization::FlightImages images =
      flight_images(dataset, {.map = folder.path(), .trajectory = folder / "trajectory.txt"});
  EXPECT_EQ(images.read(1), std::nullopt);
  EXPECT_THAT([&] { images.read(0); }, ThrowsMessage<InputError>(HasSubstr("absent.png: cannot be opened")));
}

TEST(FlightEvidence, UpIsGivenElseThePathsElseAcrossTheGround) {
  const dataset::Dataset dataset = frames_at({0.0, 0.5, 1.0, 1.5, 2.0});
  const auto given = make_flight_evidence(dataset, path_of(5, 0.3), ground(),
                                          registration::UpDirection{Vec3(0.0, 3.0, 4.0), 0.05, true});
  ASSERT_EQ(given.up_candidates.size(), 1U);
  EXPECT_LT((given.up_candidates[0] - Vec3(0.0, 0.6, 0.8)).norm(), 1e-12);
  const auto by_path = make_flight_evidence(dataset, path_of(5, 0.3), geometry::PointCloud());
  ASSERT_EQ(by_path.up_candidates.size(), 1U);
  EXPECT_LT((by_path.up_candidates[0] - Vec3::UnitZ()).norm(), 1e-9);
  const auto by_ground = make_flight_evidence(dataset, path_of(5, 0.0), ground());  // a straight path is ambiguous
  ASSERT_FALSE(by_ground.up_candidates.empty());
  EXPECT_GT(by_ground.up_candidates[0].z(), 0.9999);
  EXPECT_TRUE(make_flight_evidence(dataset, path_of(5, 0.0), geometry::PointCloud()).up_candidates.empty());
}

TEST(FlightEvidence, AnInertialUnitsUpIsFirstButNotAlone) {
  // The IMU's axes may be stated wrongly, so others are tried too; a correct direction is not tried twice.
  const dataset::Dataset dataset = frames_at({0.0, 0.5, 1.0, 1.5, 2.0});
  const auto wrong =
      make_flight_evidence(dataset, path_of(5, 0.3), ground(), registration::UpDirection{Vec3::UnitX(), 0.01});
  ASSERT_EQ(wrong.up_candidates.size(), 2U);
  EXPECT_EQ(wrong.up_candidates[0], Vec3::UnitX());
  EXPECT_LT((wrong.up_candidates[1] - Vec3::UnitZ()).norm(), 1e-9);
  const auto right =
      make_flight_evidence(dataset, path_of(5, 0.3), ground(), registration::UpDirection{Vec3::UnitZ(), 0.01});
  EXPECT_EQ(right.up_candidates.size(), 1U);
}

}  // namespace
}  // namespace tileflight::scoring::flight_evidence_test

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
