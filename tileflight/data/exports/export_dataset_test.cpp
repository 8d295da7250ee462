#include "tileflight/data/exports/export_dataset.h"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <map>
#include <sstream>

#include "tests/moving_picture.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/lidar_files.h"
#include "tileflight/data/dataset/sensor_files.h"
#include "tileflight/data/exports/mcap.h"

namespace tileflight::exports::export_dataset_test {
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
  dataset::Dataset written(const imaging::Camera& camera, bool truth = true) {
    imaging::Calibration calibration;
    calibration.camera = camera;
    calibration.T_cam_imu = kCamImu;
    dataset::DatasetWriter writer(folder_ / "data", calibration, {.replace = true, .png = true});
    for (int i = 0; i < kFrames; ++i) writer.add_frame(i, time_of(i), 5.0 + i, tests::moving_picture(64, 48, i));
    if (truth) writer.set_groundtruth(poses());
    dataset::write_imu_csv(writer.temporary_folder() / "imu.csv", {{2.5, Vec3(1, 2, 3), Vec3(4, 5, 6)}});
    dataset::write_imu_yaml(writer.temporary_folder() / "imu.yaml", {250.0, 1e-3, 2e-3, 3e-3, 4e-3});
    writer.finish();
    return dataset::read_dataset(folder_ / "data");
  }
  /// Exported and read again.
  dataset::Dataset round_trip(const imaging::Camera& camera, const std::string& layout) {
    export_dataset(written(camera), layout, folder_ / layout, false);
    return dataset::read_dataset(folder_ / layout);
  }
  tileflight::tests::TemporaryFolder folder_;
};

void expect_same_frames(const dataset::Dataset& read, double first_s) {
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
  const dataset::Dataset read = round_trip(fisheye(), "euroc");
  expect_same_frames(read, 2.5);
  expect_same_lens(read.calibration.camera, fisheye());
  EXPECT_LT((read.calibration.T_cam_imu.matrix() - kCamImu.matrix()).norm(), 1e-12);
  ASSERT_TRUE(read.groundtruth.has_value());
  for (int i = 0; i < kFrames; ++i) {
    EXPECT_NEAR(read.groundtruth->poses[i].time_s, time_of(i), 1e-9);
    EXPECT_LT((read.groundtruth->poses[i].T_local_camera.matrix() - poses().poses[i].T_local_camera.matrix()).norm(),
              1e-12);
  }
  EXPECT_EQ(dataset::read_imu_csv(folder_ / "euroc/mav0/imu0/data.csv").at(0).specific_force_m_s2, Vec3(4, 5, 6));
  const std::string imu = base::read_text(folder_ / "euroc/mav0/imu0/sensor.yaml");
  EXPECT_THAT(imu, HasSubstr("rate_hz: 250\n"));
  EXPECT_THAT(imu, HasSubstr("gyroscope_noise_density: 0.003\n"));
  EXPECT_THAT(base::read_text(folder_ / "euroc/mav0/cam0/sensor.yaml"), HasSubstr("rate_hz: 20\n"));
}

TEST_F(Export, EveryLayoutKeepsTheWarningsOfTheDataset) {
  dataset::Rig rig = dataset::rig_of(written(pinhole()));
  rig.cameras.front().dataset.warnings.emplace_back("1 of 5 frames have no image");
  const auto names_it = testing::Contains("1 of 5 frames have no image");
  for (const std::string& layout : export_layouts())
    EXPECT_THAT(export_rig(rig, layout, folder_ / layout, false).notes, names_it) << layout;
  EXPECT_THAT(export_mcap(rig, folder_ / "flight.mcap", false).notes, names_it);
}

/// A dataset of `frames` frames with this truth and these files beside it.
dataset::Dataset with_path(const fs::path& folder, const imaging::Calibration& calibration,
                           const geometry::Trajectory& truth, const std::map<std::string, std::string>& about,
                           const std::function<void(const fs::path&)>& add) {
  dataset::DatasetWriter writer(folder, calibration, {});
  for (std::size_t i = 0; i < truth.size(); ++i)
    writer.add_frame(i, truth.poses[i].time_s, 0.0, tests::moving_picture(64, 48, static_cast<int>(i)));
  writer.set_groundtruth(truth);
  for (const auto& [key, value] : about) writer.describe(key, value);
  add(writer.temporary_folder());
  writer.finish();
  return dataset::read_dataset(folder);
}

// A camera on a circle, always looking the same way along it: position and velocity of the body in closed form.
TEST_F(Export, EurocHasTheBodysVelocityAndBiases) {
  constexpr double kRate = 0.8, kRadius_m = 20.0, kClimb_m_s = 1.5;
  const auto camera_at = [&](double t) {
    return SE3(geometry::so3_exp(Vec3(0, 0, kRate * t)),
               Vec3(kRadius_m * std::cos(kRate * t), kRadius_m * std::sin(kRate * t), kClimb_m_s * t));
  };
  imaging::Calibration calibration;
  calibration.camera = fisheye();
  calibration.T_cam_imu = kCamImu;
  geometry::Trajectory truth;
  for (int i = 0; i < 12; ++i) {
    const double t = 7.0 + 0.05 * i + (i % 3 == 0 ? 0.004 : 0.0);  // not quite uniform
    truth.poses.push_back({t, camera_at(t)});
  }
  const dataset::Dataset dataset = with_path(folder_ / "circle", calibration, truth, {}, [](const fs::path& out) {
    dataset::NumberTable biases{{"t [s]", "a", "b", "c", "d", "e", "f"}, {}};
    for (const double t : {7.0, 8.0}) biases.rows.push_back({t, t, 0, 0, 0, 0, -2 * t});
    dataset::write_number_table(out / "imu_bias.csv", biases);
  });
  export_dataset(dataset, "euroc", folder_ / "euroc", false);
  const dataset::NumberTable table =
      dataset::read_number_table(folder_ / "euroc/mav0/state_groundtruth_estimate0/data.csv");
  ASSERT_EQ(table.columns.size(), 17U);
  EXPECT_EQ(table.columns[8], "v_RS_R_x [m s^-1]");
  EXPECT_EQ(table.columns[16], "b_a_RS_S_z [m s^-2]");
  ASSERT_EQ(table.rows.size(), 12U);
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    const auto& row = table.rows[i];
    const double t = truth.poses[i].time_s;
    const Vec3 arm = truth.poses[i].T_local_camera.rotation * kCamImu.translation;
    const Vec3 circle = truth.poses[i].T_local_camera.translation + arm;
    const Vec3 velocity(-kRate * circle.y(), kRate * circle.x(), kClimb_m_s);  // omega x r, and the climb
    EXPECT_LT((Vec3(row[1], row[2], row[3]) - circle).norm(), 1e-9);
    EXPECT_LT((Vec3(row[8], row[9], row[10]) - velocity).norm(), 1e-4) << i;
    EXPECT_NEAR(row[11], t, 1e-9);
    EXPECT_NEAR(row[16], -2 * t, 1e-9);
  }
  EXPECT_EQ(dataset::read_dataset(folder_ / "euroc").groundtruth->size(), 12U);  // the reader ignores the other columns
}

// Points of the world seen by a lidar that turns and moves; whatever its scans are corrected for, KITTI's files put the
// points where they are.
TEST_F(Export, KittiHasScansAtTheFramesTimes) {
  const SE3 kCamLidar(Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5), Vec3(0.1, -0.2, 0.05));
  const auto camera_at = [](double t) {
    return SE3(geometry::so3_exp(Vec3(0, 0, 0.5)), Vec3(3.0 * t, -1.0 * t, 10.0));  // straight: interpolation is exact
  };
  geometry::Trajectory truth;
  for (int i = 0; i < 5; ++i) truth.poses.push_back({2.0 + 0.25 * i, camera_at(2.0 + 0.25 * i)});
  imaging::Calibration calibration;
  calibration.camera = pinhole();
  const auto world_point = [](int i) { return Vec3(i, 0.3 * i * i, -2.0 + 0.1 * i); };
  constexpr int kPoints = 9, kScans = 7;
  constexpr double kPeriod_s = 0.125;
  for (const std::string motion : {"distorted", "corrected", "frozen"}) {
    const auto add_scans = [&](const fs::path& out) {
      fs::create_directories(out / "lidar");
      geometry::Trajectory starts;
      for (int k = 0; k < kScans; ++k) {
        const double start_s = 2.0 + kPeriod_s * k;
        starts.poses.push_back({start_s, camera_at(start_s) * kCamLidar});
        std::vector<dataset::ScanPoint> points;
        for (int i = 0; i < kPoints; ++i) {
          const double after_s = kPeriod_s * i / kPoints;
          const double frame_s = motion == "distorted" ? start_s + after_s : start_s;
          const Vec3 p = (camera_at(frame_s) * kCamLidar).inverse() * world_point(i);
          points.push_back({p.cast<float>(), 0.1F * static_cast<float>(i), static_cast<float>(after_s), 3});
        }
        dataset::write_scan_ply(out / "lidar" / ("00000" + std::to_string(k) + ".ply"), points);
      }
      geometry::write_tum(out / "lidar/poses.txt", starts);
    };
    const dataset::Dataset dataset =
        with_path(folder_ / ("of-" + motion), calibration, truth, {{"sensors.lidar.motion", motion}}, add_scans);
    const fs::path out = folder_ / ("kitti-" + motion);
    const ExportResult result = export_dataset(dataset, "kitti", out, false);
    const std::string calib = base::read_text(out / "calib.txt");
    std::istringstream numbers(calib.substr(calib.find("Tr: ") + 4));
    geometry::Mat4 T_cam_velo = geometry::Mat4::Identity();
    for (int i = 0; i < 12; ++i) numbers >> T_cam_velo(i / 4, i % 4);
    EXPECT_LT((T_cam_velo - kCamLidar.matrix()).norm(), 1e-9);
    for (int frame = 0; frame < 5; ++frame) {
      const auto points = dataset::read_scan(out / "velodyne" / ("00000" + std::to_string(frame) + ".bin"));
      if (frame == 4) {  // the last scan ended an eighth of a second before
        EXPECT_THAT(points, IsEmpty());
        continue;
      }
      ASSERT_EQ(points.size(), static_cast<std::size_t>(kPoints));
      for (int i = 0; i < kPoints; ++i) {
        const Vec3 p =
            T_cam_velo.topLeftCorner<3, 3>() * points[i].position.cast<double>() + T_cam_velo.topRightCorner<3, 1>();
        EXPECT_LT((truth.poses[frame].T_local_camera * p - world_point(i)).norm(), 1e-5) << motion << frame << i;
        EXPECT_EQ(points[i].intensity, 0.1F * static_cast<float>(i));
      }
    }
    EXPECT_THAT(result.notes, testing::Contains(HasSubstr("1 of 5 frames have an empty scan")));
    EXPECT_EQ(dataset::read_dataset(out).frames.size(), 5U);
  }
}

// Frame times then lie just between the middles of two scans, and are rounded.
TEST_F(Export, KittiScansOfTheFramesRateAreEachUsedOnce) {
  const auto camera_at = [](double t) { return SE3(Eigen::Quaterniond::Identity(), Vec3(t, 0.0, 10.0)); };
  const auto name = [](int k) { return std::string(k < 10 ? "00000" : "0000") + std::to_string(k); };
  constexpr int kScans = 40;
  geometry::Trajectory truth;
  for (int i = 0; i < kScans; ++i) truth.poses.push_back({0.05 * i, camera_at(0.05 * i)});
  imaging::Calibration calibration;
  calibration.camera = pinhole();
  const auto add_scans = [&](const fs::path& out) {
    fs::create_directories(out / "lidar");
    geometry::Trajectory starts;
    for (int k = 0; k < kScans; ++k) {
      const double start_s = static_cast<double>(k) / 20.0;
      starts.poses.push_back({start_s, camera_at(start_s)});
      dataset::write_scan_ply(out / "lidar" / (name(k) + ".ply"),
                              {{Eigen::Vector3f(1, 2, 3), 0.01F * static_cast<float>(k), 0.0F, 0}});
    }
    geometry::write_tum(out / "lidar/poses.txt", starts);
  };
  const dataset::Dataset dataset = with_path(folder_ / "of-same-rate", calibration, truth, {}, add_scans);
  const ExportResult result = export_dataset(dataset, "kitti", folder_ / "same-rate", false);
  for (int i = 0; i < kScans; ++i) {
    const auto points = dataset::read_scan(folder_ / "same-rate/velodyne" / (name(i) + ".bin"));
    ASSERT_EQ(points.size(), 1U);
    EXPECT_FLOAT_EQ(points[0].intensity, 0.01F * static_cast<float>(i)) << i;
  }
  EXPECT_THAT(result.notes, testing::Not(testing::Contains(HasSubstr("the scan of the frame before"))));
}

TEST_F(Export, KittiIsReadBack) {
  const dataset::Dataset read = round_trip(pinhole(), "kitti");
  expect_same_frames(read, 0.0);
  expect_same_lens(read.calibration.camera, pinhole());
  const SE3 T_first_local = poses().poses[0].T_local_camera.inverse();
  for (int i = 0; i < kFrames; ++i) {
    const SE3 expected = T_first_local * poses().poses[i].T_local_camera;
    EXPECT_LT((read.groundtruth->poses[i].T_local_camera.matrix() - expected.matrix()).norm(), 1e-9);
  }
}

TEST_F(Export, TumMonoIsReadBack) {
  const dataset::Dataset read = round_trip(fisheye(), "tum-mono");
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
  EXPECT_THAT(base::read_text(model / "images.txt"), HasSubstr(" 1 000003.png\n"));
  EXPECT_TRUE(fs::is_regular_file(model / "points3D.txt"));
  EXPECT_EQ(imaging::read_rgb(folder_ / "colmap/images/000003.png").pixels, tests::moving_picture(64, 48, 3).pixels);
}

TEST_F(Export, WhatALayoutCannotHoldIsSaid) {
  const auto refusal = [&](const imaging::Camera& camera, const std::string& layout, bool truth = true) {
    const dataset::Dataset dataset = written(camera, truth);
    const std::string line = tests::refusal_of([&] { export_dataset(dataset, layout, folder_ / "out", false); });
    EXPECT_FALSE(fs::exists(folder_ / "out"));
    return line;
  };
  const imaging::Camera sphere(imaging::DoubleSphere{30, 30, 31.5, 23.5, -0.2, 0.6}, 64, 48);
  EXPECT_THAT(refusal(fisheye(), "kitti"), HasSubstr("pinhole images without distortion"));
  EXPECT_THAT(refusal(sphere, "euroc"), HasSubstr("EuRoC's sensor.yaml cannot describe this lens"));
  EXPECT_THAT(refusal(sphere, "colmap"), HasSubstr("COLMAP has no model for this lens"));
  EXPECT_THAT(refusal(pinhole(), "colmap", false), HasSubstr("has no groundtruth.txt"));
  EXPECT_THAT(refusal(pinhole(), "eurco"), HasSubstr("did you mean 'euroc'?"));
}

}  // namespace
}  // namespace tileflight::exports::export_dataset_test
