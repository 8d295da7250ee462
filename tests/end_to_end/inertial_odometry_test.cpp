// `odometry --mode inertial` on a flight whose truth is known: what it writes, and what it refuses.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/refused_command.h"
#include "tests/run_program.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/data/dataset/sensor_files.h"
#include "tileflight/evaluation/metrics/metrics.h"
#include "tileflight/slam/odometry/test_inertial_flight.h"

namespace tileflight::inertial_odometry_test {
namespace {

namespace fs = std::filesystem;
namespace flights = odometry::test_support;
using nlohmann::json;
using tests::ProgramResult;
using tests::run_tileflight;

void write_readings(const fs::path& folder, std::vector<geometry::ImuSample> samples, double per_m_s2 = 1.0) {
  for (geometry::ImuSample& sample : samples) sample.specific_force_m_s2 *= per_m_s2;
  dataset::write_imu_csv(folder / "imu.csv", samples);
}

/// Times begin at 1 s, so that no reading is before 0.
void write_flight(const fs::path& folder, int frames) {
  flights::InertialFlight flight = flights::fly(flights::lively_camera, frames);
  imaging::Calibration calibration = flight.sequence.calibration;
  calibration.T_cam_imu = flights::kT_imu_camera.inverse();
  dataset::DatasetWriter writer(folder, calibration, {});
  geometry::Trajectory truth;
  for (int i = 0; i < frames; ++i) {
    const double time_s = 1.0 + i / flights::kInertialFps;
    writer.add_frame(i, time_s, 0.0, flight.sequence.images[i]);
    truth.poses.push_back({time_s, flight.sequence.truth[i]});
  }
  writer.set_groundtruth(truth);
  for (geometry::ImuSample& sample : flight.readings.samples) sample.time_s += 1.0;
  write_readings(writer.temporary_folder(), flight.readings.samples);
  const inertial::ImuNoise noise;
  dataset::write_imu_yaml(writer.temporary_folder() / "imu.yaml",
                          {200.0, noise.accelerometer_noise_density, noise.accelerometer_random_walk,
                           noise.gyroscope_noise_density, noise.gyroscope_random_walk});
  writer.finish();
}

class InertialOdometry : public ::testing::Test {
 protected:
  ProgramResult call(const std::string& out, const std::vector<std::string>& more) const {
    std::vector<std::string> words{"odometry", dataset_.string(), "--out", (folder_ / out).string(),
                                   "--json",   "--no-check"};
    words.insert(words.end(), more.begin(), more.end());
    return run_tileflight(words);
  }
  json run(const std::string& out, const std::vector<std::string>& more) const {
    const ProgramResult result = call(out, more);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result.exit_code == 0 ? json::parse(result.out) : json::object();
  }
  /// Scale that is still missing, and error without it.
  void expect_metric(const std::string& out) const {
    const auto path = geometry::read_tum(folder_ / out / "trajectory.txt"),
               truth = geometry::read_tum(dataset_ / "groundtruth.txt");
    const auto rigid = metrics::evaluate_trajectory(path, truth, {.alignment = metrics::TrajectoryAlignment::kSE3});
    const auto scaled = metrics::evaluate_trajectory(path, truth, {.alignment = metrics::TrajectoryAlignment::kSim3});
    EXPECT_NEAR(scaled.scale, 1.0, 0.015) << out;
    EXPECT_LT(rigid.ate_rmse_m, 0.01 * rigid.path_length_m) << out;
    // Level: what the camera sees of the vertical is the truth's.
    const auto up = [](const geometry::SE3& T) {
      return geometry::Vec3(T.rotation.conjugate() * geometry::Vec3::UnitZ());
    };
    EXPECT_GT(up(path.poses[20].T_local_camera).dot(up(*geometry::interpolate(truth, path.poses[20].time_s))),
              std::cos(0.02))
        << out;
  }
  void expect_refused(const std::vector<std::string>& more, const std::string& message) const {
    tests::expect_one_line_refusal(call("refused", more), message);
    EXPECT_FALSE(fs::exists(folder_ / "refused"));
  }

  tests::TemporaryFolder folder_;
  fs::path dataset_ = folder_ / "dataset";
};

TEST_F(InertialOdometry, MapAndPathAreMetricAndLevelInBothDirections) {
  write_flight(dataset_, 150);
  const json about = run("forwards", {"--mode", "inertial"});
  EXPECT_EQ(about["mode"], "inertial");
  ASSERT_EQ(about["scale"], "metric") << about["inertial"];
  EXPECT_LE(about["inertial"]["sigma_log_scale"], 0.02);
  EXPECT_NEAR(about["inertial"]["time_offset_s"], 0.0, 0.01);
  expect_metric("forwards");
  const std::string table = base::read_text(folder_ / "forwards/inertial.csv");
  EXPECT_EQ(std::count(table.begin(), table.end(), '\n'), 1 + about["keyframes"].get<int>());
  const json reversed = run("backwards", {"--mode", "inertial", "--reverse"});
  ASSERT_EQ(reversed["scale"], "metric") << reversed["inertial"];
  expect_metric("backwards");
}

TEST_F(InertialOdometry, WithReadingsInTheWindowMapAndPathAreMetricAndLevelToo) {
  write_flight(dataset_, 150);
  const json about = run("tight", {"--mode", "inertial", "--tight"});
  ASSERT_EQ(about["scale"], "metric") << about["inertial"];
  EXPECT_GT(about["inertial"]["coupled_since_s"], 0.0);
  expect_metric("tight");
}

TEST_F(InertialOdometry, WithoutTheModeTheReadingsAreNotUsed) {
  write_flight(dataset_, 45);
  const json about = run("mono", {});
  EXPECT_EQ(about["mode"], "mono");
  EXPECT_EQ(about["scale"], "unknown");
  EXPECT_FALSE(about.contains("inertial"));
  EXPECT_FALSE(fs::exists(folder_ / "mono/inertial.csv"));
}

TEST_F(InertialOdometry, WhatCannotBeIsRefusedInOneLine) {
  write_flight(dataset_, 3);
  expect_refused({"--mode", "stereo"}, "has one camera; --mode stereo needs several on one body");
  expect_refused({"--mode", "stereo-inertial"}, "has one camera; --mode stereo needs several on one body");
  expect_refused({"--mode", "lidar"}, "--mode: \"lidar\" is no mode; use mono, inertial, stereo or stereo-inertial");
  expect_refused({"--mode", "mono", "--tight"}, "--tight: puts an inertial unit's readings into the window");
  expect_refused({"--mode", "inertial", "--init-from", (dataset_ / "groundtruth.txt").string()},
                 "--init-from: and --mode inertial both decide on frame and scale");
  const auto samples = flights::fly(flights::lively_camera, 2).readings.samples;
  write_readings(dataset_, samples, 1.0 / 9.80665);
  expect_refused({"--mode", "inertial"}, "imu.csv: the specific force is");
  fs::remove(dataset_ / "imu.csv");
  expect_refused({"--mode", "inertial"}, "has no readings of an inertial unit (imu.csv)");
}

}  // namespace
}  // namespace tileflight::inertial_odometry_test
