#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/imaging/calibration_files.h"

namespace tileflight::imaging::vslam_lab_file_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using testing::ElementsAre;
using testing::HasSubstr;
using tests::refusal_of;

const std::string kT_BS =
    "[0, -1, 0, 0.5, 1, 0, 0, -0.25, 0, 0, 1, 2, 0, 0, 0, 1]";  // a quarter turn about z, and a shift

/// The present form, with the places of comments and line breaks as its own writer leaves them.
std::string present(const std::string& distortion, const std::string& more = "") {
  return "%YAML 1.2\n---\ncameras:\n  - {cam_name: rgb_0,\n     cam_type: gray,\n     cam_model: pinhole,\n" +
         distortion +
         "     focal_length: [458.5, 457.25],\n     principal_point: [367.0, 248.5],\n"
         "     image_dimension: [752, 480],\n     fps: 20,\n     T_BS: " +
         kT_BS + " # Sensor extrinsics wrt. the body-frame.\n    }\n\n" + more;
}

class VslamLabFile : public testing::Test {
 protected:
  std::filesystem::path written(const std::string& text) {
    base::write_file(folder_ / "calibration.yaml", text);
    return folder_ / "calibration.yaml";
  }
  std::string refused(const std::string& text) {
    const auto file = written(text);
    return refusal_of([&] { read_calibration(file, ""); });
  }
  tests::TemporaryFolder folder_;
};

TEST_F(VslamLabFile, ThePresentFormIsRead) {
  const auto file =
      written(present("     distortion_type: radtan4,\n"
                      "     distortion_coefficients: [-0.28, 0.07, 0.0002, 1.8e-05], \n",
                      "imus:\n  - {imu_name: imu_0,\n     a_max: 176.0, # saturation\n"
                      "     T_BS: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0.5, 0, 0, 0, 1]\n    }\n"));
  EXPECT_EQ(detect_calibration_format(base::read_text(file)), CalibrationFormat::kVslamLab);
  EXPECT_THAT(camera_ids(file), ElementsAre("rgb_0"));
  const VslamLabCamera camera = read_vslam_lab_camera(file);
  const auto& lens = std::get<PinholeRadtan>(camera.calibration.camera.model());
  EXPECT_EQ(lens.fx, 458.5);
  EXPECT_EQ(lens.cy, 248.5);
  EXPECT_THAT(lens.d, ElementsAre(-0.28, 0.07, 0.0002, 1.8e-05));
  EXPECT_EQ(camera.calibration.camera.height(), 480);
  EXPECT_EQ(camera.depth_units_per_m, 0.0);
  // A point of the camera is turned and moved into the body, and from there into the unit half a metre above.
  EXPECT_LT((camera.T_body_cam * Vec3(1, 2, 3) - Vec3(-2 + 0.5, 1 - 0.25, 5)).norm(), 1e-12);
  EXPECT_LT((camera.calibration.T_cam_imu.inverse() * Vec3(1, 2, 3) - Vec3(-1.5, 0.75, 4.5)).norm(), 1e-12);
  EXPECT_EQ(std::get<PinholeRadtan>(read_calibration(file).camera.model()).fx, 458.5);
}

TEST_F(VslamLabFile, LensesAreThoseOfTheirNames) {
  const auto model = [&](const std::string& type, const std::string& numbers) {
    const auto file =
        written(present("     distortion_type: " + type + ",\n     distortion_coefficients: " + numbers + ",\n"));
    return read_calibration(file, "rgb_0").camera.model();
  };
  EXPECT_THAT(std::get<KannalaBrandt>(model("equid4", "[0.1, 0.02, 0.003, 0.0004]")).k,
              ElementsAre(0.1, 0.02, 0.003, 0.0004));
  EXPECT_EQ(std::get<PinholeRational>(model("radtan5", "[0.26, -0.95, -0.005, 0.002, 1.16]")).d[4], 1.16);
  EXPECT_EQ(std::get<PinholeRational>(model("radtan8", "[1, 2, 3, 4, 5, 6, 7, 8]")).d[7], 8.0);
  EXPECT_THAT(std::get<PinholeRadtan>(model("radtan5", "[0.1, 0.2, 0, 0, 0]")).d, ElementsAre(0.1, 0.2, 0, 0));
  const auto file = written(present("     depth_name: depth_0,\n     depth_factor: 5000.0,\n"));
  EXPECT_THAT(std::get<PinholeRadtan>(read_calibration(file).camera.model()).d, ElementsAre(0, 0, 0, 0));
  EXPECT_EQ(read_vslam_lab_camera(file).depth_units_per_m, 5000.0);
}

TEST_F(VslamLabFile, EarlierFormsAreRead) {
  const std::string of_2024 =
      "%YAML:1.0\n\n# Camera calibration and distortion parameters\nCamera.model: OPENCV\n\nCamera.fx: 517.3\n"
      "Camera.fy: 516.5\nCamera.cx: 318.6\nCamera.cy: 255.3\n\nCamera.k1: 0.2624\nCamera.k2: -0.9531\n"
      "Camera.p1: -0.0054\nCamera.p2: 0.0026\nCamera.k3: 1.1633\n\nCamera.w: 640\nCamera.h: 480\n\n"
      "Camera.fps: 30.0\n\n# Depth map factor\ndepth_factor: 5000.0\n";
  VslamLabCamera camera = read_vslam_lab_camera(written(of_2024));
  EXPECT_EQ(std::get<PinholeRational>(camera.calibration.camera.model()).d[4], 1.1633);
  EXPECT_EQ(camera.calibration.camera.width(), 640);
  EXPECT_EQ(camera.depth_units_per_m, 5000.0);

  const std::string of_2025 =
      "%YAML:1.0\n\n\n# Camera0 calibration\nCamera0.model: Pinhole\n\nCamera0.fx: 436.25\nCamera0.fy: 436.25\n"
      "Camera0.cx: 364.5\nCamera0.cy: 256.75\n\nCamera0.w: 752\nCamera0.h: 480\nCamera0.fps: 20.0\n"
      "Camera1.fx: 436.5\n\n# IMU parameters\nIMU.T_b_c1: !!opencv-matrix\n  rows: 4\n  cols: 4\n  dt: f\n"
      "  data: [0, -1, 0, 0.5,\n         1, 0, 0, -0.25,\n         0, 0, 1, 2,\n         0, 0, 0, 1]\n"
      "Depth0.factor: 1.000000e+03\n";
  const auto file = written(of_2025);
  EXPECT_THAT(camera_ids(file), ElementsAre("rgb_0", "rgb_1"));
  camera = read_vslam_lab_camera(file);
  EXPECT_EQ(std::get<PinholeRadtan>(camera.calibration.camera.model()).cx, 364.5);
  EXPECT_LT((camera.calibration.T_cam_imu.inverse() * Vec3(1, 2, 3) - Vec3(-1.5, 0.75, 5)).norm(), 1e-12);
  EXPECT_EQ(camera.depth_units_per_m, 1000.0);
}

TEST_F(VslamLabFile, WhatIsWrittenIsReadBack) {
  const std::vector<Camera> lenses{
      make_pinhole(64, 48, 80.0),
      make_fisheye(64, 48, 150.0, {0.01, -1e-8, 0, 1e-3}),
      {PinholeRadtan{50.25, 51, 31.5, 23, {-0.1, 1e-12, 0.001, 0.2}}, 64, 48},
      {PinholeRational{50, 51, 31.5, 23, {0.1, 0.2, 0.001, 0.002, 1.0 / 3}}, 64, 48},
      {PinholeRational{50, 51, 31.5, 23, {0.1, 0.2, 0.001, 0.002, 0.3, 0.01, 0.02, 0.03}}, 64, 48}};
  for (const Camera& lens : lenses) {
    const auto text = vslam_lab_lens_text(lens);
    ASSERT_TRUE(text);
    const Camera read = read_calibration(written("cameras:\n  - {cam_name: rgb_0,\n     " + *text + "}\n")).camera;
    EXPECT_EQ(read.model().index(), lens.model().index());
    for (const Vec3& ray : {Vec3(0, 0, 1), Vec3(0.3, -0.2, 1), Vec3(-0.1, 0.2, 0.9)})
      EXPECT_EQ((*read.project(ray) - *lens.project(ray)).norm(), 0.0) << *text;
  }
  EXPECT_FALSE(vslam_lab_lens_text({DoubleSphere{30, 30, 31.5, 23.5, -0.2, 0.6}, 64, 48}));
  EXPECT_FALSE(vslam_lab_lens_text({PinholeRational{50, 51, 31, 23, {0, 0, 0, 0, 0, 0, 0, 0, 0.1}}, 64, 48}));
}

TEST_F(VslamLabFile, BadFilesAreOneClearLine) {
  const std::string plain = present("");
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = plain;
    text.replace(text.find(from), from.size(), to);
    return refused(text);
  };
  EXPECT_THAT(with("cam_model: pinhole", "cam_model: unknown"), HasSubstr("give a calibration (--camera)"));
  EXPECT_THAT(with("[752, 480]", "[0, 0]"), HasSubstr("\"image_dimension\" must be two whole numbers from 1 to"));
  EXPECT_THAT(with("[752, 480]", "[1e12, 480]"), HasSubstr("\"image_dimension\" must be two whole numbers from 1 to"));
  EXPECT_THAT(with("[752, 480]", "752"), HasSubstr("\"image_dimension\" must be a list of numbers"));
  EXPECT_THAT(with("focal_length", "focal"), HasSubstr("has no key \"focal_length\""));
  EXPECT_THAT(with("[458.5, 457.25]", "[458.5]"), HasSubstr("\"focal_length\" must have 2 numbers"));
  EXPECT_THAT(with("[458.5, 457.25]", "[.nan, 4]"), HasSubstr("intrinsics must be finite"));
  EXPECT_THAT(with(kT_BS, "[1, 2]"), HasSubstr("\"T_BS\" must have 4 rows of 4 numbers"));
  EXPECT_THAT(with(kT_BS, "[2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]"), HasSubstr("is not a rigid motion"));
  EXPECT_THAT(refused(present("     distortion_type: radtan5,\n     distortion_coefficients: [1, 2],\n")),
              HasSubstr("of radtan5 must have 5 numbers, not 2"));
  EXPECT_THAT(refused(present("     distortion_type: fov,\n")), HasSubstr("\"fov\" is unknown: use radtan4"));
  EXPECT_THAT(refused(present("     depth_factor: 0,\n")), HasSubstr("\"depth_factor\" must be above 0"));
  EXPECT_THAT(refused("cameras: 5\n"), HasSubstr("has no camera \"rgb_0\""));
  EXPECT_THAT(refused("cameras:\n- 5\n"), HasSubstr("has no camera \"rgb_0\""));
  EXPECT_THAT(refused("Camera.fx: 5\n"), HasSubstr("has no key \"Camera.fy\""));
  EXPECT_THAT(refused("cameras: [\n"), HasSubstr("not valid YAML"));
}

}  // namespace
}  // namespace tileflight::imaging::vslam_lab_file_test
