#include "tileflight/dataset/export_dataset.h"

#include <gmock/gmock.h>

#include <map>

#include "tests/temporary_folder.h"
#include "tileflight/dataset/imu_files.h"
#include "tileflight/dataset/test_pictures.h"
#include "tileflight/geometry/files.h"
#include "tileflight/geometry/input_error.h"
#include "tileflight/imaging/image_files.h"

namespace tileflight::dataset {
namespace {

namespace fs = std::filesystem;
using geometry::SE3;
using geometry::Vec3;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr int kFrames = 4;
const SE3 kCamImu(Eigen::Quaterniond(0.7, 0.1, -0.7, 0.1), Vec3(0.1, -0.02, 0.3));

imaging::Camera fisheye() { return imaging::make_fisheye(64, 48, 120.0, {0.01, -0.002, 0, 0}); }
imaging::Camera pinhole() { return imaging::make_pinhole(64, 48, 90.0); }

double time_of(int i) { return 2.5 + 0.05 * i; }

geometry::Trajectory poses() {
  geometry::Trajectory trajectory;
  for (int i = 0; i < kFrames; ++i)
    trajectory.poses.push_back({time_of(i), SE3(geometry::so3_exp(Vec3(0.1 * i, 0.2, -0.05 * i)), Vec3(i, 2, 3))});
  return trajectory;
}

class Export : public testing::Test {
 protected:
  Dataset written(const imaging::Camera& camera, bool truth = true) {
    imaging::Calibration calibration;
    calibration.camera = camera;
    calibration.T_cam_imu = kCamImu;
    DatasetWriter writer(folder_ / "data", calibration, {.replace = true, .png = true});
    for (int i = 0; i < kFrames; ++i) writer.add_frame(i, time_of(i), 5.0 + i, tests::moving_picture(64, 48, i));
    if (truth) writer.set_groundtruth(poses());
    write_imu_csv(writer.temporary_folder() / "imu.csv", {{2.5, Vec3(1, 2, 3), Vec3(4, 5, 6)}});
    write_imu_yaml(writer.temporary_folder() / "imu.yaml", {250.0, 1e-3, 2e-3, 3e-3, 4e-3});
    writer.finish();
    return read_dataset(folder_ / "data");
  }
  /// Exported and read again.
  Dataset round_trip(const imaging::Camera& camera, const std::string& layout) {
    export_dataset(written(camera), layout, folder_ / layout, false);
    return read_dataset(folder_ / layout);
  }
  tileflight::tests::TemporaryFolder folder_;
};

void expect_same_frames(const Dataset& read, double first_s) {
  ASSERT_EQ(read.frames.size(), static_cast<std::size_t>(kFrames));
  for (int i = 0; i < kFrames; ++i) {
    EXPECT_NEAR(read.frames[i].time_s, first_s + 0.05 * i, 1e-9);
    EXPECT_EQ(imaging::read_rgb(read.frames[i].image).pixels, tests::moving_picture(64, 48, i).pixels);
  }
}

void expect_same_lens(const imaging::Camera& a, const imaging::Camera& b) {
  for (const Vec3& ray : {Vec3(0, 0, 1), Vec3(0.3, -0.4, 1), Vec3(-0.5, 0.2, 0.9)})
    EXPECT_LT((*a.project(ray) - *b.project(ray)).norm(), 1e-9);
}

TEST_F(Export, EurocIsReadBack) {
  const Dataset read = round_trip(fisheye(), "euroc");
  expect_same_frames(read, 2.5);
  expect_same_lens(read.calibration.camera, fisheye());
  EXPECT_LT((read.calibration.T_cam_imu.matrix() - kCamImu.matrix()).norm(), 1e-12);
  ASSERT_TRUE(read.groundtruth.has_value());
  for (int i = 0; i < kFrames; ++i) {
    EXPECT_NEAR(read.groundtruth->poses[i].time_s, time_of(i), 1e-9);
    EXPECT_LT((read.groundtruth->poses[i].T_local_camera.matrix() - poses().poses[i].T_local_camera.matrix()).norm(),
              1e-12);
  }
  EXPECT_EQ(read_imu_csv(folder_ / "euroc/mav0/imu0/data.csv").at(0).specific_force_m_s2, Vec3(4, 5, 6));
  const std::string imu = geometry::read_text(folder_ / "euroc/mav0/imu0/sensor.yaml");
  EXPECT_THAT(imu, HasSubstr("rate_hz: 250\n"));
  EXPECT_THAT(imu, HasSubstr("gyroscope_noise_density: 0.003\n"));
  EXPECT_THAT(geometry::read_text(folder_ / "euroc/mav0/cam0/sensor.yaml"), HasSubstr("rate_hz: 20\n"));
}

TEST_F(Export, KittiIsReadBack) {
  const Dataset read = round_trip(pinhole(), "kitti");
  expect_same_frames(read, 0.0);
  expect_same_lens(read.calibration.camera, pinhole());
  const SE3 T_first_local = poses().poses[0].T_local_camera.inverse();
  for (int i = 0; i < kFrames; ++i) {
    const SE3 expected = T_first_local * poses().poses[i].T_local_camera;
    EXPECT_LT((read.groundtruth->poses[i].T_local_camera.matrix() - expected.matrix()).norm(), 1e-9);
  }
}

TEST_F(Export, TumMonoIsReadBack) {
  const Dataset read = round_trip(fisheye(), "tum-mono");
  expect_same_frames(read, 2.5);
  expect_same_lens(read.calibration.camera, fisheye());
  EXPECT_EQ(read.frames[2].exposure_ms, 7.0);
  EXPECT_EQ(geometry::read_tum(folder_ / "tum-mono/groundtruthSync.txt").size(), 4U);
}

TEST_F(Export, ColmapHasThePosesAndTheLens) {
  const ExportResult result = export_dataset(written(fisheye()), "colmap", folder_ / "colmap", false);
  EXPECT_EQ(result.frames, 4U);
  const fs::path model = folder_ / "colmap/sparse/0";
  expect_same_lens(imaging::read_calibration(model / "cameras.txt").camera, fisheye());
  EXPECT_THAT(geometry::read_text(model / "images.txt"), HasSubstr(" 1 000003.png\n"));
  EXPECT_TRUE(fs::is_regular_file(model / "points3D.txt"));
  EXPECT_EQ(imaging::read_rgb(folder_ / "colmap/images/000003.png").pixels, tests::moving_picture(64, 48, 3).pixels);
}

TEST_F(Export, WhatALayoutCannotHoldIsSaid) {
  const auto refusal = [&](const imaging::Camera& camera, const std::string& layout, bool truth = true) {
    const Dataset dataset = written(camera, truth);
    const std::string line = tests::refusal_of([&] { export_dataset(dataset, layout, folder_ / "out", false); });
    EXPECT_FALSE(fs::exists(folder_ / "out"));
    return line;
  };
  const imaging::Camera sphere(imaging::DoubleSphere{30, 30, 31.5, 23.5, -0.2, 0.6}, 64, 48);
  EXPECT_THAT(refusal(fisheye(), "kitti"), HasSubstr("a pinhole's without distortion"));
  EXPECT_THAT(refusal(sphere, "euroc"), HasSubstr("EuRoC's sensor.yaml has no name for this lens"));
  EXPECT_THAT(refusal(sphere, "colmap"), HasSubstr("COLMAP has no model for this lens"));
  EXPECT_THAT(refusal(pinhole(), "colmap", false), HasSubstr("has no groundtruth.txt"));
  EXPECT_THAT(refusal(pinhole(), "eurco"), HasSubstr("did you mean 'euroc'?"));
}

}  // namespace
}  // namespace tileflight::dataset
