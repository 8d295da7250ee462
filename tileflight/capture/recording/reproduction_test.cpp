// Repeating a scored flight, whose folder is created by hand.
#include "tileflight/capture/recording/reproduction.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/capture/flight_path/path.h"
#include "tileflight/capture/vehicle/flight_plan.h"
#include "tileflight/core/alignment/transform_file.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/imaging/camera.h"

namespace tileflight::recording::followed_flight_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using testing::HasSubstr;

constexpr double kSigma_m = 0.05;

/// A wide turn, camera down.
SE3 true_pose(double t) {
  return {geometry::so3_exp(Vec3(0, 0, 0.1 * t)) * geometry::so3_exp(Vec3(3.0, 0, 0)),
          Vec3(30 * std::cos(0.2 * t), 30 * std::sin(0.2 * t), 100 + t)};
}

/// Ten poses a second, each with an error of kSigma_m along each axis.
geometry::Trajectory measured(int count) {
  std::mt19937 random(5);
  std::normal_distribution<double> noise_m(0.0, kSigma_m);
  geometry::Trajectory poses;
  for (int i = 0; i < count; ++i) {
    SE3 pose = true_pose(0.1 * i);
    pose.translation += Vec3(noise_m(random), noise_m(random), noise_m(random));
    poses.poses.push_back({0.1 * i, pose});
  }
  return poses;
}

/// A map at half the scale, turned and moved, as odometry and alignment leave it.
const geometry::Sim3& T_local_map() {
  static const geometry::Sim3 kT{2.0, Eigen::Quaterniond(geometry::so3_exp(Vec3(0.3, -0.2, 1.0))), Vec3(5, -7, 90)};
  return kT;
}

class FollowedFlight : public testing::Test {
 protected:
  /// The path of the repeated flight if odometry estimated `poses`.
  flight_path::Path followed(const geometry::Trajectory& poses,
                             const std::optional<flight_path::SmoothingOptions>& smoothing) {
    const auto real = folder_ / "real";
    std::filesystem::create_directories(real / "odometry");
    std::filesystem::create_directories(real / "dataset");
    geometry::write_tum(real / "odometry/trajectory.txt", geometry::transformed(T_local_map().inverse(), poses));
    alignment::IcpResult aligned;
    aligned.T_target_source = T_local_map();
    base::write_file(real / "transform.json", alignment::to_json(aligned).dump());
    imaging::Calibration calibration;
    calibration.camera = imaging::make_fisheye(64, 48, 120.0);
    imaging::write_kalibr(real / "dataset/camera.yaml", calibration);
    write_followed_flight(real, smoothing, folder_ / "flight");
    const vehicle::FlightPlan plan = vehicle::read_flight_plan(folder_ / "flight/flight.yaml");
    EXPECT_EQ(imaging::read_calibration(plan.camera).camera.width(), 64);
    return vehicle::build_path(plan);
  }
  std::string plan_text() const { return base::read_text(folder_ / "flight/flight.yaml"); }

  tests::TemporaryFolder folder_;
};

double rms_from_truth_m(const flight_path::Path& path, int count) {
  double squares = 0.0;
  for (int i = 0; i < count; ++i) {
    squares += (path.pose(0.1 * i).translation - true_pose(0.1 * i).translation).squaredNorm() / count;
  }
  return std::sqrt(squares);
}

TEST_F(FollowedFlight, WithoutSmoothingGoesThroughEveryPose) {
  const geometry::Trajectory poses = measured(60);
  const flight_path::Path path = followed(poses, std::nullopt);
  EXPECT_THAT(plan_text(), HasSubstr("smooth: none\n"));
  for (const geometry::StampedPose& pose : poses.poses) {
    EXPECT_LT((path.pose(pose.time_s).translation - pose.T_local_camera.translation).norm(), 1e-6);
    EXPECT_LT(path.pose(pose.time_s).rotation.angularDistance(pose.T_local_camera.rotation), 1e-6);
  }
  EXPECT_NEAR(rms_from_truth_m(path, 60), kSigma_m * std::sqrt(3.0), 0.015);  // the full noise
}

TEST_F(FollowedFlight, SmoothedIsNearerToTheTruthThanThePosesAre) {
  const flight_path::Path path = followed(measured(60), flight_path::SmoothingOptions{});
  EXPECT_THAT(plan_text(), HasSubstr("smooth: auto\n"));
  EXPECT_LT(rms_from_truth_m(path, 60), 0.6 * kSigma_m * std::sqrt(3.0));
  followed(measured(60), flight_path::SmoothingOptions{.knot_spacing_s = 0.75});
  EXPECT_THAT(plan_text(), HasSubstr("smooth: 0.75\n"));
}

TEST_F(FollowedFlight, LocatedPosesAreFlownInPlaceOfTheEstimate) {
  followed(measured(60), std::nullopt);
  geometry::Trajectory exact;
  for (int i = 0; i < 60; ++i) exact.poses.push_back({0.1 * i, true_pose(0.1 * i)});
  std::filesystem::create_directories(folder_ / "located");
  geometry::write_tum(folder_ / "located/trajectory.txt", exact);
  write_followed_flight(folder_ / "real", std::nullopt, folder_ / "flight", folder_ / "located/trajectory.txt");
  const flight_path::Path path = vehicle::build_path(vehicle::read_flight_plan(folder_ / "flight/flight.yaml"));
  EXPECT_LT(rms_from_truth_m(path, 60), 1e-6);
}

TEST_F(FollowedFlight, TooFewPosesAreFlownThroughOrRefused) {
  const geometry::Trajectory poses = measured(5);
  const flight_path::Path path = followed(poses, flight_path::SmoothingOptions{});
  EXPECT_THAT(plan_text(), HasSubstr("smooth: none\n"));
  EXPECT_LT((path.pose(0.2).translation - poses.poses[2].T_local_camera.translation).norm(), 1e-6);
  EXPECT_THAT(tests::refusal_of([&] { followed(measured(1), std::nullopt); }), HasSubstr("no path to follow"));
}

}  // namespace
}  // namespace tileflight::recording::followed_flight_test
