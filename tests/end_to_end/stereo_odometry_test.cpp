// `odometry --mode stereo` on a rig whose truth is known: what it writes, and what it refuses.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/refused_command.h"
#include "tests/run_program.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/core/imaging/calibration_files.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/evaluation/metrics/metrics.h"
#include "tileflight/slam/odometry/synthetic_flight.h"

namespace tileflight::stereo_odometry_test {
namespace {

namespace fs = std::filesystem;
namespace flights = odometry::test_support;
using geometry::SE3;
using nlohmann::json;
using ::testing::HasSubstr;
using tests::ProgramResult;
using tests::run_tileflight;

constexpr int kFrames = 20;
const SE3 kT_left_right({Eigen::Quaterniond::Identity(), geometry::Vec3(0.5, 0, 0)});

struct Pair {
  flights::Sequence left, right;
};

const Pair& pictures() {
  static const Pair kPair = [] {
    const imaging::Camera camera = imaging::make_pinhole(320, 240, 80.0);
    std::vector<SE3> left, right;
    for (const SE3& pose : flights::path_over_ground(2 * kFrames)) {
      if (left.size() > right.size()) {
        right.push_back(left.back() * kT_left_right);
        continue;
      }
      left.push_back(pose);
    }
    return Pair{flights::render_sequence(camera, flights::hilly_ground(), left),
                flights::render_sequence(camera, flights::hilly_ground(), right)};
  }();
  return kPair;
}

void write_camera(const fs::path& folder, const flights::Sequence& sequence, double late_s) {
  dataset::DatasetWriter writer(folder, sequence.calibration, {});
  geometry::Trajectory truth;
  for (int i = 0; i < kFrames; ++i) {
    const double time_s = i / 15.0 + late_s;
    writer.add_frame(i, time_s, 0.0, sequence.images[i]);
    truth.poses.push_back({time_s, sequence.truth[i]});
  }
  writer.set_groundtruth(truth);
  writer.finish();
}

/// A rig as `render` writes it; the right camera's times are later by `late_s`.
void write_rig(const fs::path& folder, double late_s = 0.0) {
  write_camera(folder, pictures().left, 0.0);
  fs::create_directories(folder / "cameras");
  write_camera(folder / "cameras/right", pictures().right, late_s);
  const imaging::Calibration& calibration = pictures().left.calibration;
  imaging::Calibration of_right = pictures().right.calibration;
  of_right.T_cam_imu = kT_left_right.inverse() * calibration.T_cam_imu;
  imaging::write_camchain(folder / "camchain.yaml", {{"left", ".", calibration, {}, 0.0},
                                                     {"right", "cameras/right", of_right, kT_left_right, 0.0}});
}

class StereoOdometryCommand : public ::testing::Test {
 protected:
  ProgramResult call(const std::string& out, const std::vector<std::string>& more) const {
    std::vector<std::string> words{"odometry", dataset_.string(), "--out",  (folder_ / out).string(),
                                   "--json",   "--no-check",      "--mode", "stereo"};
    words.insert(words.end(), more.begin(), more.end());
    return run_tileflight(words);
  }
  json run(const std::string& out, const std::vector<std::string>& more) const {
    const ProgramResult result = call(out, more);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result.exit_code == 0 ? json::parse(result.out) : json::object();
  }
  void expect_metric(const std::string& out, const fs::path& groundtruth) const {
    const auto path = geometry::read_tum(folder_ / out / "trajectory.txt"), truth = geometry::read_tum(groundtruth);
    EXPECT_EQ(path.size(), static_cast<std::size_t>(kFrames));
    const auto scaled = metrics::evaluate_trajectory(path, truth, {.alignment = metrics::TrajectoryAlignment::kSim3});
    EXPECT_NEAR(scaled.scale, 1.0, 0.01) << out;
  }
  void expect_refused(const std::vector<std::string>& more, const std::string& message) const {
    tests::expect_one_line_refusal(call("refused", more), message);
    EXPECT_FALSE(fs::exists(folder_ / "refused"));
  }

  tests::TemporaryFolder folder_;
  fs::path dataset_ = folder_ / "rig";
};

TEST_F(StereoOdometryCommand, MapAndPathAreMetricInBothDirectionsAndFromEitherCamera) {
  write_rig(dataset_);
  const json about = run("forwards", {});
  EXPECT_EQ(about["mode"], "stereo");
  EXPECT_EQ(about["scale"], "metric");
  EXPECT_EQ(about["stereo"]["cameras"][0]["name"], "right");
  EXPECT_EQ(about["stereo"]["cameras"][0]["frames"], kFrames);
  EXPECT_EQ(about["frames_before_start"], 0);
  EXPECT_EQ(about["intrinsics"]["estimated"], false);
  expect_metric("forwards", dataset_ / "groundtruth.txt");
  EXPECT_EQ(run("backwards", {"--reverse"})["scale"], "metric");
  expect_metric("backwards", dataset_ / "groundtruth.txt");
  EXPECT_EQ(run("right", {"--camera", "right"})["stereo"]["cameras"][0]["name"], "left");
  expect_metric("right", dataset_ / "cameras/right/groundtruth.txt");
}

TEST_F(StereoOdometryCommand, BrokenPicturesOfTheOtherCameraAreCounted) {
  write_rig(dataset_);
  const fs::path broken = dataset::read_dataset(dataset_ / "cameras/right").frames[5].image;
  std::ofstream(broken, std::ios::trunc) << "no picture";
  const json about = run("broken", {});
  EXPECT_EQ(about["scale"], "metric");
  EXPECT_EQ(about["frames_skipped"], 0);
  EXPECT_EQ(about["stereo"]["cameras"][0]["frames"], kFrames - 1);
  EXPECT_THAT(about["warnings"].dump(), HasSubstr("1 images of the other cameras could not be decoded"));
}

TEST_F(StereoOdometryCommand, WhatCannotBeIsRefusedInOneLine) {
  write_rig(dataset_, 0.005);
  expect_refused({}, "camera right has no image within 0.1 ms of one of camera left (the nearest: 5 ms)");
  expect_refused({"--camera", "middle"}, "\"middle\" is none of the rig's cameras (left, right)");
  expect_refused({"--init-from", (dataset_ / "groundtruth.txt").string()},
                 "--init-from: and --mode stereo both decide on frame and scale");
  fs::remove_all(dataset_ / "cameras");
  fs::remove(dataset_ / "camchain.yaml");
  expect_refused({}, "has one camera; --mode stereo needs several on one body");
}

}  // namespace
}  // namespace tileflight::stereo_odometry_test
