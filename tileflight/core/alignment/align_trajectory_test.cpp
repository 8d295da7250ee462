#include "tileflight/core/alignment/align_trajectory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <random>
#include <regex>

#include "tests/test_data.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/geodesy.h"

namespace tileflight::alignment::align_trajectory_test {
namespace {

using geometry::Sim3;
using geometry::Trajectory;
using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

Sim3 T_local_map() { return {12.5, geometry::so3_exp({1.6, 0.2, -0.4}), {350.0, -130.0, 2930.0}}; }

/// Camera position at a time, local frame: a winding climb at 6 m/s or more.
Vec3 winding(double t) { return {6.0 * t, 15.0 * std::sin(0.5 * t), 30.0 + 4.0 * std::sin(0.3 * t)}; }
Vec3 straight(double t) { return {6.0 * t, 2.0 * t, 30.0}; }

/// The path as from odometry, at 10 Hz.
template <class Path>
Trajectory odometry(const Path& path, double seconds) {
  Trajectory trajectory;
  for (int k = 0; k <= 10 * seconds; ++k) {
    const Vec3 p = T_local_map().inverse() * path(0.1 * k);
    trajectory.poses.push_back({0.1 * k, {Eigen::Quaterniond::Identity(), p}});
  }
  return trajectory;
}

/// A receiver at 10 Hz with lag, noise, a slow bias and occasional outliers; each position is repeated for three
/// entries.
template <class Path>
std::vector<PositionFix> receiver(const Path& path, double seconds, double lag_s, double noise_m, double bias_m,
                                  double wild_share) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0.0, noise_m);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::vector<PositionFix> fixes;
  for (int k = 0; k < 30 * seconds; k += 3) {
    const double t = k / 30.0;
    Vec3 p = path(t - lag_s) + bias_m * Vec3(std::sin(0.05 * t), std::cos(0.07 * t), 0.5);
    p += Vec3(noise(random), noise(random), noise(random));
    if (unit(random) < wild_share) p += 200.0 * Vec3(unit(random), unit(random), unit(random));
    for (int held = 0; held < 3; ++held) fixes.push_back({t + held / 30.0, p, 0.3, 0.5});
  }
  return fixes;
}

double rms_apart_m(const Sim3& T, const Trajectory& trajectory) {
  double sum = 0.0;
  for (const auto& pose : trajectory.poses) {
    sum += (T * pose.T_local_camera.translation - T_local_map() * pose.T_local_camera.translation).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(trajectory.size()));
}

TEST(AlignTrajectory, ExactWithoutErrors) {
  const Trajectory trajectory = odometry(winding, 30);
  std::vector<PositionFix> fixes;
  for (const auto& pose : trajectory.poses) fixes.push_back({pose.time_s, winding(pose.time_s), 0, 0});
  const auto result = align_trajectory(trajectory, fixes);
  EXPECT_LT(rms_apart_m(result.T_local_map, trajectory), 1e-3) << "as exact as the time offset";
  EXPECT_NEAR(result.T_local_map.scale, 12.5, 1e-4);
  EXPECT_NEAR(result.time_offset_s, 0.0, 1e-4);
  EXPECT_GE(result.pairs + 1, trajectory.size());
  EXPECT_EQ(result.note, "");
}

TEST(AlignTrajectory, FindsTheLagOfTheReceiver) {
  const Trajectory trajectory = odometry(winding, 40);
  for (const double lag_s : {-0.9, 0.0, 0.37, 1.6}) {
    const auto result = align_trajectory(trajectory, receiver(winding, 40, lag_s, 0.25, 1.0, 0.0));
    EXPECT_NEAR(result.time_offset_s, -lag_s, 0.05) << result.note;
    EXPECT_LT(rms_apart_m(result.T_local_map, trajectory), 1.3);
    EXPECT_GT(result.time_offset_sigma_s, 0.0);
  }
}

TEST(AlignTrajectory, WithoutTheLagItIsWorse) {
  const Trajectory trajectory = odometry(winding, 40);
  const auto fixes = receiver(winding, 40, 0.5, 0.1, 0.0, 0.0);
  const auto with = align_trajectory(trajectory, fixes);
  const auto without = align_trajectory(trajectory, fixes, {.estimate_time_offset = false});
  EXPECT_EQ(without.time_offset_s, 0.0);
  EXPECT_LT(rms_apart_m(with.T_local_map, trajectory), 0.2);
  EXPECT_GT(rms_apart_m(without.T_local_map, trajectory), 2.0);
}

TEST(AlignTrajectory, WildPositionsDoNotPull) {
  const Trajectory trajectory = odometry(winding, 40);
  const auto result = align_trajectory(trajectory, receiver(winding, 40, 0.3, 0.25, 0.0, 0.2));
  EXPECT_LT(rms_apart_m(result.T_local_map, trajectory), 0.3);
  EXPECT_NEAR(result.time_offset_s, -0.3, 0.05);
  EXPECT_LT(result.inliers, result.pairs);
}

TEST(AlignTrajectory, HeldPositionsCountOnce) {
  const Trajectory trajectory = odometry(winding, 20);
  const auto result =
      align_trajectory(trajectory, receiver(winding, 20, 0.0, 0.1, 0.0, 0.0), {.estimate_time_offset = false});
  EXPECT_EQ(result.pairs, 200u);
}

TEST(AlignTrajectory, StraightFlightTellsNeitherOffsetNorRoll) {
  const Trajectory trajectory = odometry(straight, 30);
  const auto result = align_trajectory(trajectory, receiver(straight, 30, 0.5, 0.25, 0.5, 0.0));
  EXPECT_EQ(result.time_offset_s, 0.0);
  EXPECT_NE(result.note.find("time offset"), std::string::npos) << result.note;
  EXPECT_NE(result.note.find("nearly straight"), std::string::npos) << result.note;
}

TEST(AlignTrajectory, RefusesBadInput) {
  const Trajectory trajectory = odometry(winding, 20);
  auto fixes = receiver(winding, 20, 0.0, 0.1, 0.0, 0.0);
  EXPECT_THAT([&] { align_trajectory({}, fixes); }, ThrowsMessage<InputError>(HasSubstr("trajectory: has no poses")));
  EXPECT_THAT([&] { align_trajectory(trajectory, {}); },
              ThrowsMessage<InputError>(HasSubstr("telemetry: has no positions")));
  auto later = fixes;
  for (auto& fix : later) fix.time_s += 1000.0;
  EXPECT_THAT([&] { align_trajectory(trajectory, later); },
              ThrowsMessage<InputError>(HasSubstr("only 0 of its positions lie within the trajectory's time")))
      << "no time in common";
  fixes[3].position.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT([&] { align_trajectory(trajectory, fixes); },
              ThrowsMessage<InputError>(HasSubstr("telemetry: a position is not finite")));
  const auto still = odometry([](double) { return Vec3(1, 2, 3); }, 20);
  EXPECT_THAT([&] { align_trajectory(still, receiver(winding, 20, 0.0, 0.1, 0.0, 0.0)); },
              ThrowsMessage<InputError>(HasSubstr("the camera does not move")))
      << "a camera that does not move";
}

// ------------------------------------------------------------------------------------------------ a real log's shape

/// Positions of a DJI subtitle file in the tileset's frame; entry k is frame k of the 30 Hz video.
std::vector<PositionFix> read_positions(const std::filesystem::path& srt) {
  const geometry::LocalFrame frame({-0.2400, -78.5200, {0.0}});
  const std::regex entry(
      R"(latitude: ([-0-9.]+)\] \[longitude: ([-0-9.]+)\] \[rel_alt: [-0-9.]+ abs_alt: ([-0-9.]+)\])");
  std::ifstream file(srt);
  std::vector<PositionFix> fixes;
  for (std::string line; std::getline(file, line);) {
    std::smatch m;
    if (!std::regex_search(line, m, entry)) continue;
    const geometry::Geodetic place{std::stod(m[1]), std::stod(m[2]), {std::stod(m[3])}};
    fixes.push_back({static_cast<double>(fixes.size()) / 30.0, frame.local_from_geodetic(place), 0.25, 0.4});
  }
  return fixes;
}

TEST(AlignTrajectory, FlightOverMachangara) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "flights/machangara-a");
  const Trajectory truth = geometry::read_tum(folder / "groundtruth.txt");
  const auto fixes = read_positions(folder / "telemetry.srt");
  ASSERT_EQ(fixes.size(), 600u);
  const Trajectory map = geometry::transformed(T_local_map().inverse(), truth);
  const auto result = align_trajectory(map, fixes);
  // The log's bias is a metre or two, which limits the position of the path but not its shape.
  EXPECT_LT(rms_apart_m(result.T_local_map, map), 3.0) << result.note;
  EXPECT_NEAR(result.T_local_map.scale, 12.5, 0.02 * 12.5);
  EXPECT_LT(result.time_offset_s, -0.05) << "the receiver lags";
  EXPECT_GT(result.time_offset_s, -1.0);
  EXPECT_LT(result.rmse_m, 1.0);
  RecordProperty("time_offset_s", std::to_string(result.time_offset_s));
  RecordProperty("rms_apart_m", std::to_string(rms_apart_m(result.T_local_map, map)));
}

}  // namespace
}  // namespace tileflight::alignment::align_trajectory_test

namespace tileflight::alignment::gravity_test {
namespace {

using geometry::Mat3;
using geometry::Trajectory;
using geometry::Vec3;

/// Camera to a level world (z up): heading, pitch (up positive), roll, radians.
Eigen::Quaterniond camera(double heading, double pitch, double roll) {
  Mat3 level;        // columns: the camera's x, y, z, looking to +x of the world
  level << 0, 0, 1,  //
      -1, 0, 0,      //
      0, -1, 0;
  return Eigen::Quaterniond(Eigen::AngleAxisd(heading, Vec3::UnitZ())) *
         Eigen::Quaterniond(Eigen::AngleAxisd(-pitch, Vec3::UnitY())) *
         Eigen::Quaterniond(Eigen::AngleAxisd(roll, Vec3::UnitX())) * Eigen::Quaterniond(level);
}

Trajectory turning(double turn_rad, double roll_rad) {
  const Eigen::Quaterniond map_of_world(Eigen::AngleAxisd(1.1, Vec3(0.3, -0.5, 0.81).normalized()));
  Trajectory trajectory;
  for (int k = 0; k < 100; ++k) {
    const double phase = 0.0628 * k;
    const auto r =
        camera(turn_rad * std::sin(phase), -0.6 + 0.3 * std::cos(2.0 * phase), roll_rad * std::cos(3.0 * phase));
    trajectory.poses.push_back({0.1 * k, {map_of_world * r, Vec3::Zero()}});
  }
  return trajectory;
}

const Vec3 kUpInMap = Eigen::Quaterniond(Eigen::AngleAxisd(1.1, Vec3(0.3, -0.5, 0.81).normalized())) * Vec3::UnitZ();

TEST(UpFromTrajectory, AnUprightCameraThatTurnsTellsIt) {
  const auto up = estimate_up_from_trajectory(turning(1.0, 0.0));
  ASSERT_TRUE(up);
  EXPECT_LT((*up - kUpInMap).norm(), 1e-9);
}

TEST(UpFromTrajectory, SomeRollDoesLittle) {
  const auto up = estimate_up_from_trajectory(turning(1.0, 0.1));
  ASSERT_TRUE(up);
  EXPECT_LT(std::acos(up->dot(kUpInMap)), 0.05);
}

TEST(UpFromTrajectory, WithoutTurnsItIsNotKnown) {
  EXPECT_FALSE(estimate_up_from_trajectory(turning(0.02, 0.0)));
  EXPECT_FALSE(estimate_up_from_trajectory(turning(0.3, 0.3))) << "rolls as much as it turns";
  EXPECT_FALSE(estimate_up_from_trajectory({}));
}

}  // namespace
}  // namespace tileflight::alignment::gravity_test
