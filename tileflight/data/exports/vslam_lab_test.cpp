// Sequences of VSLAM-LAB, made up here in its present form and in the one of 2025.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/moving_picture.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/data/dataset/frame_layers.h"
#include "tileflight/data/dataset/sensor_files.h"
#include "tileflight/data/exports/export_dataset.h"

namespace tileflight::exports::vslam_lab_layout_test {
namespace {

namespace fs = std::filesystem;
using geometry::SE3;
using geometry::Vec3;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using tests::refusal_of;

constexpr int kFrames = 4;
constexpr float kNone = std::numeric_limits<float>::infinity();

const std::string kCalibration =
    "%YAML 1.2\n---\ncameras:\n  - {cam_name: rgb_0,\n     cam_type: gray,\n     cam_model: pinhole,\n"
    "     distortion_type: radtan4,\n     distortion_coefficients: [0.01, 0, 0, 0], \n     focal_length: [50, 51],\n"
    "     principal_point: [31, 23],\n     image_dimension: [64, 48],\n     fps: 20.0,\n"
    "     T_BS: [0, -1, 0, 0.5, 1, 0, 0, -0.25, 0, 0, 1, 2, 0, 0, 0, 1] # Sensor extrinsics wrt. the body-frame.\n"
    "    }\n\n\nimus:\n  - {imu_name: imu_0,\n     a_max: 176.0, # acceleration saturation [m/s^2]\n"
    "     sigma_g_c: 2.0e-03, # gyro noise density\n     sigma_gw_c: 2.0e-05,\n     sigma_a_c: 3.0e-02,\n"
    "     sigma_aw_c: 3.0e-03,\n     fps: 200.0,\n"
    "     T_BS: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]  # Sensor extrinsics wrt. the body-frame.\n    }\n";
/// T_BS of the camera above.
const SE3 kBodyCamera(Eigen::Quaterniond(std::sqrt(0.5), 0, 0, std::sqrt(0.5)), Vec3(0.5, -0.25, 2));

class VslamLab : public testing::Test {
 protected:
  VslamLab() {
    fs::create_directories(folder_ / "seq/rgb_0");
    for (int i = 0; i < 3; ++i)
      imaging::write_rgb(folder_ / ("seq/rgb_0/" + std::to_string(i) + ".png"), tests::moving_picture(64, 48, i));
    write("calibration.yaml", kCalibration);
    write("rgb.csv",
          "ts_rgb_0 (ns),path_rgb_0,ts_rgb_1 (ns),path_rgb_1\n1403636579763555584,rgb_0/0.png,0,rgb_1/0.png\n"
          "1403636579813555456,rgb_0/1.png,0,rgb_1/1.png\n1403636579863555584,rgb_0/2.png,0,rgb_1/2.png\n");
  }
  void write(const std::string& name, const std::string& text) { base::write_file(folder_ / ("seq/" + name), text); }
  dataset::Dataset read() { return dataset::read_dataset(folder_ / "seq"); }
  std::string refused() {
    return refusal_of([&] { read(); });
  }
  /// What the reader says of this rgb.csv.
  std::string refused_list(const std::string& rows) {
    write("rgb.csv", "ts_rgb_0 (ns),path_rgb_0\n" + rows);
    return refused();
  }

  tests::TemporaryFolder folder_;
};

TEST_F(VslamLab, ASequenceIsADatasetAsItLies) {
  write("groundtruth.csv",
        "ts (ns),tx (m),ty (m),tz (m),qx,qy,qz,qw\n1403636579763555584,4.5,-1.75,0.5,0,0,0,1\n"
        "1403636579813555456,4.5,-1.75,1.5,0,0,0,1\n");
  write("imu_0.csv",
        "ts (ns),wx (rad s^-1),wy (rad s^-1),wz (rad s^-1),ax (m s^-2),ay (m s^-2),az (m s^-2)\n"
        "1403636579758555392,-0.0994,0.1473,0.0286,8.18,-0.37,-2.4\n");
  const dataset::Dataset dataset = read();
  EXPECT_THAT(dataset.warnings, IsEmpty());
  ASSERT_EQ(dataset.frames.size(), 3U);
  EXPECT_EQ(dataset.frames[1].time_s, 1403636579.813555456);
  EXPECT_EQ(dataset.frames[1].image, folder_ / "seq/rgb_0/1.png");
  EXPECT_EQ(std::get<imaging::PinholeRadtan>(dataset.calibration.camera.model()).fy, 51.0);
  EXPECT_LT((dataset.calibration.T_cam_imu.matrix() - kBodyCamera.inverse().matrix()).norm(), 1e-12);
  ASSERT_TRUE(dataset.groundtruth);
  const SE3 first = SE3(Eigen::Quaterniond::Identity(), Vec3(4.5, -1.75, 0.5)) * kBodyCamera;
  EXPECT_LT((dataset.groundtruth->poses[0].T_local_camera.matrix() - first.matrix()).norm(), 1e-12);
  EXPECT_EQ(dataset.groundtruth->poses[0].time_s, dataset.frames[0].time_s);
  EXPECT_EQ(dataset::read_imu_csv(dataset.imu).at(0).specific_force_m_s2, Vec3(8.18, -0.37, -2.4));
  const dataset::ImuCalibration noise = dataset::read_imu_noise(dataset.imu_noise);
  EXPECT_EQ(noise.gyroscope_noise_density, 2e-3);
  EXPECT_EQ(noise.accelerometer_random_walk, 3e-3);
  EXPECT_EQ(noise.update_rate_hz, 200.0);
}

TEST_F(VslamLab, TheFormOf2025IsRead) {
  write("calibration.yaml",
        "%YAML:1.0\n\nCamera0.model: Pinhole\nCamera0.fx: 50\nCamera0.fy: 51\nCamera0.cx: 31\nCamera0.cy: 23\n\n"
        "Camera0.w: 64\nCamera0.h: 48\nIMU.NoiseGyro: 1.0e-03\nIMU.NoiseAcc: 2.0e-03\nIMU.GyroWalk: 3.0e-05\n"
        "IMU.AccWalk: 4.0e-03\nIMU.Frequency: 2.0e+02\nDepth0.factor: 1.0e+03\n");
  write("rgb.csv",
        "ts_rgb0 (s),path_rgb0,ts_depth0 (s),path_depth0\n1403636579.763556,rgb_0/0.png,1403636579.76,depth_0/0.png\n"
        "1403636579.813555,rgb_0/1.png,1403636579.81,depth_0/1.png\n");
  write("imu.csv",
        "timestamp [s],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],"
        "a_RS_S_z [m s^-2]\n1403636579.758555392,1,2,3,4,5,6\n");
  for (const std::string time : {"1403636579.763556", "1403636579763556000"}) {  // both occur under this name
    write("groundtruth.csv", "ts,tx,ty,tz,qx,qy,qz,qw\n" + time + ",1,2,3,0,0,0,1\n");
    const dataset::Dataset dataset = read();
    EXPECT_NEAR(dataset.groundtruth->poses[0].time_s, 1403636579.763556, 1e-6);
    EXPECT_EQ(dataset.groundtruth->poses[0].T_local_camera.translation, Vec3(1, 2, 3));
    EXPECT_EQ(dataset.frames[0].time_s, 1403636579.763556);
    EXPECT_EQ(dataset.depth_units_per_m, 1000.0);
    EXPECT_TRUE(dataset.frames[0].depth.empty());  // there is no such file
    EXPECT_EQ(dataset::read_imu_csv(dataset.imu).at(0).time_s, 1403636579.758555392);
    EXPECT_EQ(dataset::read_imu_noise(dataset.imu_noise).gyroscope_random_walk, 3e-5);
  }
}

/// A dataset with everything that the layout can hold.
dataset::Dataset full_dataset(const fs::path& folder, const imaging::Camera& camera, double start_s) {
  imaging::Calibration calibration{.camera = camera};
  calibration.T_cam_imu = SE3(Eigen::Quaterniond(0.7, 0.1, -0.7, 0.1), Vec3(0.1, -0.02, 0.3));
  dataset::DatasetWriter writer(folder, calibration, {.png = true});
  geometry::Trajectory truth;
  for (int i = 0; i < kFrames; ++i) {
    const double time_s = start_s + 0.05 * i;
    writer.add_frame(i, time_s, 5.0, tests::moving_picture(64, 48, i));
    truth.poses.push_back({time_s, SE3(geometry::so3_exp(Vec3(0.1 * i, 0.2, -0.05 * i)), Vec3(i / 3.0, 2, 3))});
    imaging::FloatImage depth_m(64, 48, 20.0F + static_cast<float>(i) / 3.0F);
    depth_m(5, 7) = kNone;
    depth_m(6, 7) = std::numeric_limits<float>::quiet_NaN();
    depth_m(7, 7) = -2.0F;
    dataset::write_frame_layers(writer.temporary_folder(), i, {.depth_m = &depth_m});
  }
  writer.set_groundtruth(truth);
  dataset::write_imu_csv(writer.temporary_folder() / "imu.csv", {{start_s, Vec3(1, 2, 3), Vec3(4, 5, 6)},
                                                                 {start_s + 0.005, Vec3(9.5, 0, 0), Vec3(0, 0, 200)}});
  dataset::write_imu_yaml(writer.temporary_folder() / "imu.yaml", {250.0, 1e-3, 2e-3, 3e-3, 4e-3});
  writer.finish();
  return dataset::read_dataset(folder);
}

TEST_F(VslamLab, WhatIsExportedIsReadBack) {
  const std::vector<imaging::Camera> lenses{
      imaging::make_pinhole(64, 48, 90.0),
      imaging::make_fisheye(64, 48, 120.0, {0.01, -0.002, 0, 0}),
      {imaging::PinholeRational{50, 51, 31, 23, {0.1, -0.2, 1e-3, -1e-8, 0.05}}, 64, 48}};
  for (std::size_t k = 0; k < lenses.size(); ++k) {
    const double start_s = k == 0 ? 2.5 : 1403636579.763555456;  // a double's steps are a quarter microsecond there
    const std::string name = std::to_string(k);
    const dataset::Dataset source = full_dataset(folder_ / name, lenses[k], start_s);
    export_dataset(source, "vslamlab", folder_ / (name + "-out"), false);
    const dataset::Dataset read = dataset::read_dataset(folder_ / (name + "-out"));
    EXPECT_THAT(read.warnings, IsEmpty());
    ASSERT_EQ(read.frames.size(), source.frames.size());
    ASSERT_EQ(read.groundtruth->size(), source.groundtruth->size());
    for (std::size_t i = 0; i < read.frames.size(); ++i) {
      EXPECT_EQ(read.frames[i].time_s, source.frames[i].time_s);
      EXPECT_EQ(base::read_text(read.frames[i].image), base::read_text(source.frames[i].image));
      const geometry::StampedPose& pose = source.groundtruth->poses[i];
      EXPECT_EQ(read.groundtruth->poses[i].time_s, pose.time_s);
      EXPECT_LT((read.groundtruth->poses[i].T_local_camera.matrix() - pose.T_local_camera.matrix()).norm(), 1e-9);
      const auto depth_m = dataset::read_depth(read, read.frames[i]);
      ASSERT_TRUE(depth_m);
      EXPECT_NEAR((*depth_m)(0, 0), 20.0 + static_cast<double>(i) / 3.0, 0.5 / 2000.0 + 1e-6);
      for (const int x : {5, 6, 7}) EXPECT_EQ((*depth_m)(x, 7), kNone);
    }
    EXPECT_EQ(read.depth_units_per_m, 2000.0);  // 21 m and 5000 units a metre do not fit into 16 bits
    for (const Vec3& ray : {Vec3(0, 0, 1), Vec3(0.3, -0.4, 1), Vec3(-0.5, 0.2, 0.9)})
      EXPECT_LT((*read.calibration.camera.project(ray) - *lenses[k].project(ray)).norm(), 1e-9);
    EXPECT_LT((read.calibration.T_cam_imu.matrix() - source.calibration.T_cam_imu.matrix()).norm(), 1e-9);
    const auto readings = dataset::read_imu_csv(read.imu), given = dataset::read_imu_csv(source.imu);
    ASSERT_EQ(readings.size(), given.size());
    EXPECT_EQ(readings[1].specific_force_m_s2, given[1].specific_force_m_s2);
    EXPECT_EQ(readings[1].time_s, given[1].time_s);
    EXPECT_EQ(dataset::read_imu_noise(read.imu_noise).gyroscope_noise_density, 3e-3);
  }
}

// What other readers of the layout look for, by name.
TEST_F(VslamLab, TheFilesAreThoseThatItsProgramsRead) {
  const dataset::Dataset source = full_dataset(folder_ / "a", imaging::make_fisheye(64, 48, 120.0), 2.5);
  const ExportResult result = export_dataset(source, "vslamlab", folder_ / "b", false);
  EXPECT_THAT(base::read_text(folder_ / "b/rgb.csv"),
              testing::StartsWith("ts_rgb_0 (ns),path_rgb_0,ts_depth_0 (ns),path_depth_0\n"
                                  "2500000000,rgb_0/000000.png,2500000000,depth_0/000000.png\n"
                                  "2550000000,rgb_0/000001.png,"));
  const std::string calibration = base::read_text(folder_ / "b/calibration.yaml");
  for (const char* text :
       {"%YAML 1.2\n---\ncameras:\n  - {cam_name: rgb_0,\n", "cam_type: rgb+depth,\n", "depth_name: depth_0,\n",
        "distortion_type: equid4,\n", "T_BS: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]", "sigma_a_c: 0.001,\n",
        "a_max: 250,\n", "g_max: 12,\n", "fps: 250,\n"})
    EXPECT_THAT(calibration, HasSubstr(text));
  EXPECT_THAT(base::read_text(folder_ / "b/groundtruth.csv"),
              testing::StartsWith("ts (ns),tx (m),ty (m),tz (m),qx,qy,qz,qw\n2500000000,0,2,3,"));
  EXPECT_THAT(base::read_text(folder_ / "b/imu_0.csv"), HasSubstr("\n2500000000,1,2,3,4,5,6\n"));
  EXPECT_THAT(result.notes, ElementsAre(HasSubstr("16-bit depths in steps of 1/2000 m")));
  const imaging::Camera sphere(imaging::DoubleSphere{30, 30, 31.5, 23.5, -0.2, 0.6}, 64, 48);
  EXPECT_THAT(
      refusal_of([&] { export_dataset(full_dataset(folder_ / "c", sphere, 0.0), "vslamlab", folder_ / "d", false); }),
      HasSubstr("cannot describe this lens"));
  EXPECT_FALSE(fs::exists(folder_ / "d"));
}

// Readings and their noise go from one program's layout to another's.
TEST_F(VslamLab, BecomesEurocsLayoutAndBack) {
  const dataset::Dataset source = full_dataset(folder_ / "a", imaging::make_fisheye(64, 48, 120.0), 1403636579.25);
  export_dataset(source, "vslamlab", folder_ / "b", false);
  export_dataset(dataset::read_dataset(folder_ / "b"), "euroc", folder_ / "c", false);
  export_dataset(dataset::read_dataset(folder_ / "c"), "vslamlab", folder_ / "d", false);
  const dataset::Dataset read = dataset::read_dataset(folder_ / "d");
  for (std::size_t i = 0; i < source.frames.size(); ++i) {
    EXPECT_EQ(read.frames[i].time_s, source.frames[i].time_s);
    EXPECT_LT(
        (read.groundtruth->poses[i].T_local_camera.matrix() - source.groundtruth->poses[i].T_local_camera.matrix())
            .norm(),
        1e-9);
  }
  EXPECT_EQ(dataset::read_imu_csv(read.imu).at(1).angular_rate_rad_s, Vec3(9.5, 0, 0));
  EXPECT_EQ(dataset::read_imu_noise(read.imu_noise).accelerometer_random_walk, 2e-3);
  EXPECT_LT((read.calibration.T_cam_imu.matrix() - source.calibration.T_cam_imu.matrix()).norm(), 1e-9);
}

TEST_F(VslamLab, MissingPicturesAreLeftOutAndSaid) {
  fs::remove(folder_ / "seq/rgb_0/1.png");
  const dataset::Dataset dataset = read();
  EXPECT_EQ(dataset.frames.size(), 2U);
  EXPECT_THAT(dataset.warnings, ElementsAre(HasSubstr("rgb.csv: 1 of 3 frames have no image")));
  fs::remove_all(folder_ / "seq/rgb_0");
  EXPECT_THAT(refused(), HasSubstr("rgb.csv: none of its frames has an image"));
}

TEST_F(VslamLab, AnotherCalibrationReplacesItsOwn) {
  write("camera.yaml",
        "cam0:\n  camera_model: pinhole\n  intrinsics: [40, 40, 31.5, 23.5]\n  distortion_model: none\n"
        "  distortion_coeffs: []\n  resolution: [64, 48]\n");
  dataset::Dataset dataset = dataset::read_dataset(folder_ / "seq", {folder_ / "seq/camera.yaml", ""});
  EXPECT_EQ(std::get<imaging::PinholeRadtan>(dataset.calibration.camera.model()).fx, 40.0);
  EXPECT_LT((dataset.calibration.T_cam_imu.matrix() - kBodyCamera.inverse().matrix()).norm(), 1e-12);
  std::string unknown = kCalibration;
  unknown.replace(unknown.find("radtan4"), 7, "unknown");
  write("calibration.yaml", unknown);
  EXPECT_THAT(refused(), HasSubstr("give a calibration (--camera)"));
  dataset = dataset::read_dataset(folder_ / "seq", {folder_ / "seq/camera.yaml", ""});
  EXPECT_THAT(dataset.warnings, ElementsAre(HasSubstr("unknown")));
  fs::remove(folder_ / "seq/calibration.yaml");
  EXPECT_THAT(refused(), HasSubstr("has no calibration.yaml; name a calibration (--camera)"));
  EXPECT_EQ(dataset::read_dataset(folder_ / "seq", {folder_ / "seq/camera.yaml", ""}).frames.size(), 3U);
}

TEST_F(VslamLab, BrokenListsAreOneClearLine) {
  EXPECT_THAT(refused_list(""), HasSubstr("rgb.csv: none of its frames has an image"));
  EXPECT_THAT(refused_list("1\n"), HasSubstr("rgb.csv: line 2: has 1 fields, but the first line names 2"));
  EXPECT_THAT(refused_list("1,rgb_0/0.png,3\n"), HasSubstr("has 3 fields"));
  EXPECT_THAT(refused_list("x,rgb_0/0.png\n"), HasSubstr("line 2: \"x\" is not a finite number"));
  EXPECT_THAT(refused_list("nan,rgb_0/0.png\n"), HasSubstr("\"nan\" is not a finite number"));
  EXPECT_THAT(refused_list("1e999,rgb_0/0.png\n"), HasSubstr("is not a finite number"));
  EXPECT_THAT(refused_list("5,rgb_0/0.png\n\n5,rgb_0/1.png\n"), HasSubstr("is not after the one before it"));
  for (const std::string path : {"/etc/passwd", "../seq2/0.png", "rgb_0/../../0.png", "..", ""})
    EXPECT_THAT(refused_list("1," + path + "\n"),
                HasSubstr("line 2: \"" + path + "\" is not a file within the dataset"));
  write("rgb.csv", "");
  EXPECT_THAT(refused(), HasSubstr("rgb.csv: is empty"));
  write("rgb.csv", "time,path_rgb_0\n");
  EXPECT_THAT(refused(), HasSubstr("has no column \"ts_rgb_0\", only time, path_rgb_0"));
  write("rgb.csv", "\xEF\xBB\xBFts_rgb_0 (ns), path_rgb_0\r\n 1 , rgb_0/./0.png \r\n");  // as spreadsheets leave it
  EXPECT_EQ(read().frames.size(), 1U);
}

TEST_F(VslamLab, BrokenPosesAreOneClearLine) {
  const auto refused_poses = [&](const std::string& rows) {
    write("groundtruth.csv", "ts (ns),tx (m),ty (m),tz (m),qx,qy,qz,qw\n" + rows);
    return refused();
  };
  EXPECT_THAT(refused_poses("1,0,0,0,0,0,0,0\n"), HasSubstr("line 2: is not a position and a unit quaternion"));
  EXPECT_THAT(refused_poses("1,inf,0,0,0,0,0,1\n"), HasSubstr("\"inf\" is not a finite number"));
  EXPECT_THAT(refused_poses("2,0,0,0,0,0,0,1\n1,0,0,0,0,0,0,1\n"), HasSubstr("line 3: the time is not after"));
  EXPECT_THAT(refused_poses("1,0,0,0\n"), HasSubstr("has 4 fields"));
  write("groundtruth.csv", "ts (ns),x,y,z\n");
  EXPECT_THAT(refused(), HasSubstr("has no column \"tx\""));
}

}  // namespace
}  // namespace tileflight::exports::vslam_lab_layout_test
