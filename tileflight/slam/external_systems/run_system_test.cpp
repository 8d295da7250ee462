#include "tileflight/slam/external_systems/run_system.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/run_program.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/core/imaging/calibration_files.h"
#include "tileflight/data/dataset/rig.h"
#include "tileflight/slam/external_systems/handed_dataset.h"
#include "tileflight/slam/external_systems/lens_support.h"
#include "tileflight/slam/external_systems/test_adapters.h"

namespace tileflight::external_systems::run_system_test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using test_support::write_adapter;
using test_support::write_dataset;
using ::testing::HasSubstr;

constexpr const char* kMap = "echo '0 0 1' > \"$OUT/map.xyz\"; echo '0 1 1' >> \"$OUT/map.xyz\"\n";

const imaging::Camera kCamera(imaging::PinholeRadtan{.fx = 32, .fy = 33, .cx = 31.5, .cy = 23.5, .d = {}}, 64, 48);

class RunSystem : public ::testing::Test {
 protected:
  void SetUp() override { write_dataset(folder_ / "data", kCamera); }
  json run(const std::string& manifest, const std::string& script,
           const SystemRunOptions& options = {.replace = true}) {
    const Adapter adapter = write_adapter(folder_ / "mine", manifest, script);
    return run_system(adapter, folder_ / "data", folder_ / "out", options);
  }
  geometry::Trajectory path() const { return geometry::read_tum(folder_ / "out/trajectory.txt"); }

  tests::TemporaryFolder folder_;
};

TEST_F(RunSystem, RunsTheCommandOfAnExperiment) {
  fs::create_directories(folder_ / "a folder");
  std::ofstream(folder_ / "a folder/map.xyz") << "0 0 1\n0 1 1\n";
  const SystemRunOptions options{.limits = {}, .program = {}, .replace = true};
  const std::string command = "cp {dataset}/groundtruth.txt {out}/trajectory.txt && cp map.xyz {out}/map.ply";
  const json about =
      run_system(command_adapter(command, folder_ / "a folder"), folder_ / "data", folder_ / "the output", options);
  EXPECT_EQ(about["system"]["completed"], false);
  EXPECT_THAT(about["system"]["reason"].get<std::string>(), HasSubstr("map.ply")) << "its content is no PLY";
  geometry::PointCloud cloud;
  cloud.positions = {{0, 0, 1}, {0, 1, 1}};
  geometry::write_cloud(folder_ / "a folder/map.ply", cloud);
  const json whole = run_system(
      command_adapter("cp {dataset}/groundtruth.txt {out}/trajectory.txt; cp map.ply {out}", folder_ / "a folder"),
      folder_ / "data", folder_ / "the output", options);
  EXPECT_EQ(whole["system"]["reason"], "");
  EXPECT_EQ(whole["frames_tracked"], 4);
  EXPECT_EQ(geometry::read_cloud(folder_ / "the output/map.ply").size(), 2U);
  const json none =
      run_system(command_adapter("true", folder_.path()), folder_ / "data", folder_ / "the output", options);
  EXPECT_EQ(none["system"]["reason"], "the command: left no trajectory.txt");
}

TEST_F(RunSystem, LeavesAnOdometryFolderWithItsMeasurements) {
  const json about =
      run("leaves: {map: map.xyz}\n",
          "cp \"$DATASET/groundtruth.txt\" \"$OUT/trajectory.txt\"\necho hello $SEED\n" + std::string(kMap),
          {.seed = 7, .replace = true});
  EXPECT_EQ(about["frames"], 4);
  EXPECT_EQ(about["frames_tracked"], 4);
  EXPECT_EQ(about["points"], 2);
  EXPECT_EQ(about["lost"], false);
  EXPECT_EQ(about["system"]["completed"], true);
  EXPECT_EQ(about["system"]["applicable"], true);
  EXPECT_EQ(about["system"]["reason"], "");
  EXPECT_GT(about["system"]["seconds"], 0.0);
  EXPECT_EQ(json::parse(tests::file_text(folder_ / "out/odometry.json")), about);
  EXPECT_EQ(tests::file_text(folder_ / "out/system.log"), "hello 7\n");
  EXPECT_EQ(geometry::read_cloud(folder_ / "out/map.ply").size(), 2U);
  EXPECT_EQ(path().size(), 4U);
  EXPECT_FALSE(fs::exists(folder_ / "out/scratch"));
}

TEST_F(RunSystem, TellsTheScriptLensAndSize) {
  run("", "echo $LENS $WIDTH $HEIGHT $FX $FY $CX $CY $FPS $FRAMES $THREADS \"[$DISTORTION]\"; exit 1",
      {.threads = 2, .replace = true});
  EXPECT_EQ(tests::file_text(folder_ / "out/system.log"), "pinhole 64 48 32 33 31.5 23.5 10 4 2 [0,0,0,0]\n");
}

TEST_F(RunSystem, FailuresAreResultsWithTheirReason) {
  const auto reason = [&](const std::string& manifest, const std::string& script) {
    const json about = run(manifest, script);
    EXPECT_EQ(about["system"]["completed"], false);
    EXPECT_EQ(about["frames_tracked"].get<int>() == 0, !fs::exists(folder_ / "out/trajectory.txt"));
    return about["system"]["reason"].get<std::string>();
  };
  EXPECT_EQ(reason("", "echo one; echo all is lost; exit 4"), "exit status 4: all is lost");
  EXPECT_THAT(reason("", "kill -ABRT $$"), HasSubstr("killed by signal 6"));
  EXPECT_THAT(reason("", ""), HasSubstr("left no trajectory.txt"));
  EXPECT_THAT(reason("", "touch \"$OUT/trajectory.txt\""), HasSubstr("tracked no frame"));
  EXPECT_THAT(reason("", "echo 1 2 3 > \"$OUT/trajectory.txt\""), HasSubstr("trajectory.txt"));
  EXPECT_THAT(reason("leaves: {map: m.ply}\n", "cp $DATASET/groundtruth.txt $OUT/trajectory.txt"),
              HasSubstr("left no m.ply"));
  EXPECT_THAT(reason("needs: {programs: [no-such-program]}\n", ""), HasSubstr("is not in PATH"));
  const json limited = run("", "sleep 60", {.limits = {.seconds = 0.2}, .replace = true});
  EXPECT_THAT(limited["system"]["reason"].get<std::string>(), HasSubstr("the time limit"));
}

/// What a system leaves is hostile: it fails, and the program and a study go on.
TEST_F(RunSystem, WhatCannotBeReadIsAFailure) {
  const auto reason = [&](const std::string& script) {
    const std::string truth = "cp \"$DATASET/groundtruth.txt\" \"$OUT/trajectory.txt\"; cd \"$OUT\"; ";
    const json about = run("leaves: {map: map.ply}\n", truth + script);
    EXPECT_EQ(about["system"]["completed"], false);
    return about["system"]["reason"].get<std::string>();
  };
  EXPECT_THAT(reason("echo 5 nan 0 0 0 0 0 1 > trajectory.txt"), HasSubstr("'nan' is not a finite number"));
  EXPECT_THAT(reason("rm trajectory.txt; mkdir trajectory.txt"), HasSubstr("left trajectory.txt, which is no file"));
  EXPECT_THAT(reason("mkfifo map.ply"), HasSubstr("left map.ply, which is no file"));
  EXPECT_THAT(reason("truncate -s 5G map.ply"), HasSubstr("left map.ply of 5 GB; at most 4 GB are read"));
  EXPECT_THAT(reason("truncate -s 20G map.ply"), HasSubstr("File size limit exceeded"));
  EXPECT_THAT(reason("printf 'nan 0 0\\n1 2 3\\n' > map.ply"), HasSubstr("map.ply"));
}

TEST_F(RunSystem, WithoutWhatItNeedsItIsNotApplicableAndNotRun) {
  const Adapter adapter = write_adapter(folder_ / "mine", "", "echo ran");
  Adapter inertial = adapter;
  inertial.inputs.push_back(Input::kImu);
  const json about = run_system(inertial, folder_ / "data", folder_ / "out", {});
  EXPECT_EQ(about["system"]["applicable"], false);
  EXPECT_EQ(about["system"]["reason"], "needs an inertial unit, and the dataset has no imu.csv");
  EXPECT_FALSE(fs::exists(folder_ / "out/system.log"));
  EXPECT_FALSE(about["system"].contains("seconds")) << "no made-up number";
}

/// World-to-camera, of the inertial unit, with times in nanoseconds or indices: always the same path comes out.
TEST_F(RunSystem, ConventionsOfPathsAreUndone) {
  // Camera k at (k, 0, 0), turned by 90 degrees about z; times 5, 5.1, …
  const char* kTum = "for k in 0 1 2 3; do echo 5.$k $k 0 0 0 0 0.70710678118654757 0.70710678118654757; done";
  run("", std::string(kTum) + " > \"$OUT/trajectory.txt\"");
  const geometry::Trajectory expected = path();
  ASSERT_EQ(expected.size(), 4U);
  const auto same = [&](const std::string& manifest, const std::string& script) {
    run(manifest, script);
    const geometry::Trajectory found = path();
    ASSERT_EQ(found.size(), 4U) << manifest;
    for (std::size_t k = 0; k < 4; ++k) {
      EXPECT_NEAR(found.poses[k].time_s, expected.poses[k].time_s, 1e-9) << manifest;
      EXPECT_LT((found.poses[k].T_local_camera.translation - expected.poses[k].T_local_camera.translation).norm(), 1e-9)
          << manifest;
      EXPECT_LT(found.poses[k].T_local_camera.rotation.angularDistance(expected.poses[k].T_local_camera.rotation), 1e-7)
          << manifest;
    }
  };
  same("leaves: {trajectory: {times: nanoseconds}}\n",
       "for k in 0 1 2 3; do echo 5${k}00000000 $k 0 0 0 0 0.70710678118654757 0.70710678118654757; done"
       " > \"$OUT/trajectory.txt\"");
  same("leaves: {trajectory: {times: frame-indices}}\n",
       "for k in 0 1 2 3; do echo $k $k 0 0 0 0 0.70710678118654757 0.70710678118654757; done > "
       "\"$OUT/trajectory.txt\"");
  // The inverse: rotation by -90 degrees, translation -R^T t = (0, k, 0).
  same("leaves: {trajectory: {pose: world-to-camera}}\n",
       "for k in 0 1 2 3; do echo 5.$k 0 $k 0 0 0 -0.70710678118654757 0.70710678118654757; done"
       " > \"$OUT/trajectory.txt\"");
  same("leaves: {trajectory: {file: poses.txt}}\n",  // KITTI's format has no times
       "for k in 0 1 2 3; do echo 0 -1 0 $k 1 0 0 0 0 0 1 0; done > \"$OUT/poses.txt\"");
  same(
      "leaves: {trajectory: {file: images.txt, format: colmap, pose: world-to-camera}}\n",
      "printf '\\357\\273\\277# COLMAP\\n' > \"$OUT/images.txt\"; for k in 0 1 2 3; do echo $k 0.70710678118654757 0 0 "
      "-0.70710678118654757 "
      "0 $k 0 1 00000$k.png; echo; done >> \"$OUT/images.txt\"");
}

TEST_F(RunSystem, AnIndexBeyondTheFramesIsAFault) {
  const json about =
      run("leaves: {trajectory: {times: frame-indices}}\n", "echo 9 0 0 0 0 0 0 1 > $OUT/trajectory.txt");
  EXPECT_THAT(about["system"]["reason"].get<std::string>(), HasSubstr("has a pose for frame 9"));
}

/// A rig of two cameras, the second in `cameras/right`, 0.2 m beside the first.
dataset::Dataset write_rig(const fs::path& folder, const imaging::Camera& right) {
  write_dataset(folder, kCamera);
  write_dataset(folder / "cameras/right", right);
  std::vector<imaging::ChainCamera> chain(2);
  chain[0].name = "left";
  chain[0].folder = ".";
  chain[0].calibration.camera = kCamera;
  chain[1].name = "right";
  chain[1].folder = "cameras/right";
  chain[1].calibration.camera = right;
  chain[1].T_body_cam.translation.x() = 0.2;
  chain[1].calibration.T_cam_imu = chain[1].T_body_cam.inverse();
  imaging::write_camchain(folder / "camchain.yaml", chain);
  imaging::write_kalibr(folder / "cameras/right/camera.yaml", chain[1].calibration);
  return dataset::read_dataset(folder);
}

TEST(HandedDataset, ASystemForSeveralCamerasGetsThoseOfARenderedRig) {
  const tests::TemporaryFolder folder;
  const dataset::Dataset data = write_rig(folder / "data", kCamera);
  Adapter adapter = write_adapter(folder / "mine", "", "");
  adapter.layout = "euroc";
  const auto second_camera_of = [&](const char* scratch) {
    fs::create_directory(folder / scratch);
    return hand_over(adapter, data, folder / scratch).folder / "mav0/cam1/data.csv";
  };
  EXPECT_FALSE(fs::exists(second_camera_of("mono"))) << "what it does not take";
  adapter.inputs.push_back(Input::kStereo);
  EXPECT_EQ(why_not_applicable(adapter, data), "");
  EXPECT_TRUE(fs::exists(second_camera_of("stereo")));
  const dataset::Rig rig = dataset::read_rig(folder / "stereo/euroc");
  ASSERT_EQ(rig.cameras.size(), 2U);
  EXPECT_EQ(rig.cameras[1].dataset.frames.size(), data.frames.size());
  const geometry::SE3 T_left_right = rig.cameras[0].T_body_camera.inverse() * rig.cameras[1].T_body_camera;
  EXPECT_NEAR((T_left_right.translation - geometry::Vec3(0.2, 0, 0)).norm(), 0.0, 1e-9);
}

TEST(HandedDataset, SeveralCamerasThatItCannotHandOverAreNotApplicable) {
  const tests::TemporaryFolder folder;
  Adapter adapter = write_adapter(folder / "mine", "", "");
  adapter.inputs.push_back(Input::kStereo);
  adapter.lenses = {"pinhole"};
  EXPECT_EQ(why_not_applicable(adapter, write_dataset(folder / "one", kCamera)),
            "needs a second camera, and the dataset has none");
  EXPECT_EQ(why_not_applicable(adapter, write_rig(folder / "two", imaging::make_fisheye(64, 48, 150.0))),
            "does not know the lens pinhole-equi, and the images of several cameras are not rectified");
}

TEST(HandedDataset, AnUnknownLensIsRectifiedToItsPinholeVisibly) {
  const tests::TemporaryFolder folder;
  const dataset::Dataset data = write_dataset(folder / "data", imaging::make_fisheye(80, 60, 150.0));
  Adapter adapter = write_adapter(folder / "mine", "", "");
  adapter.lenses = {"pinhole"};
  fs::create_directory(folder / "scratch");
  const HandedDataset handed = hand_over(adapter, data, folder / "scratch");
  EXPECT_TRUE(handed.rectified);
  EXPECT_EQ(lens_name(handed.calibration.camera), "pinhole");
  EXPECT_LT(handed.visible_share, 0.9);
  EXPECT_GT(handed.visible_share, 0.2);
  ASSERT_EQ(handed.notes.size(), 1U);
  EXPECT_THAT(handed.notes[0], HasSubstr("the images were rectified: mine does not know the lens pinhole-equi"));
  const dataset::Dataset read = dataset::read_dataset(handed.folder);
  EXPECT_EQ(read.frames.size(), data.frames.size());
  EXPECT_EQ(read.frames[2].time_s, data.frames[2].time_s);
  ASSERT_TRUE(read.groundtruth);
}

TEST(LensSupport, TheRectifiedPinholeKeepsTheScaleAtTheAxis) {
  const imaging::Camera fisheye = imaging::make_fisheye(800, 600, 155.0);
  const imaging::Camera pinhole = rectified_pinhole(fisheye);
  const geometry::Vec3 near_axis(0.01, -0.02, 1.0);
  EXPECT_LT((*fisheye.project(near_axis) - *pinhole.project(near_axis)).norm(), 0.01);
  EXPECT_EQ(visible_share(pinhole, pinhole), 1.0);
}

}  // namespace
}  // namespace tileflight::external_systems::run_system_test
