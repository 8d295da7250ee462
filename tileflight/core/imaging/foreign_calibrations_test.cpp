// Calibrations of other programs: each file is written by the program's documentation, and each lens is compared with
// that documentation's formula.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/core/imaging/calibration_files.h"

namespace tileflight::imaging::foreign_calibrations_test {
namespace {

using geometry::Vec2;
using geometry::Vec3;
using testing::HasSubstr;

const std::vector<Vec3> kPoints{{0.1, 0.2, 1}, {-0.4, 0.3, 1.2}, {0.35, -0.3, 1}, {-0.3, -0.25, 0.9}};

class ForeignCalibrations : public testing::Test {
 protected:
  Calibration read(const std::string& content, const std::string& camera_id = "") const {
    base::write_file(folder_ / "lens.dat", content);
    return read_calibration(folder_ / "lens.dat", camera_id);
  }
  std::string fault(const std::string& content) const {
    return tests::refusal_of([&] { read(content); });
  }
  void expect_pixels(const Calibration& calibration, const std::function<Vec2(const Vec3&)>& pixel_of) const {
    for (const Vec3& point : kPoints) {
      const auto pixel = calibration.camera.project(point);
      ASSERT_TRUE(pixel);
      EXPECT_LT((*pixel - pixel_of(point)).norm(), 1e-6) << pixel->transpose() << " for " << point.transpose();
    }
  }
  tests::TemporaryFolder folder_;
};

/// OpenSfM: x = X/Z, Brown; a pixel is share * larger side + centre, pixel centres at integers.
TEST_F(ForeignCalibrations, OpenSfmsBrownCameraIsRelativeToTheLargerSide) {
  const std::string text =
      R"({"dji fc6310 5472 3648 brown 0.6666": {"projection_type": "brown", "width": 5472, "height": 3648,
          "focal_x": 0.66, "focal_y": 0.67, "c_x": 0.001, "c_y": -0.002,
          "k1": 0.01, "k2": -0.02, "p1": 0.0001, "p2": 0.0002, "k3": 0.015}})";
  expect_pixels(read(text), [](const Vec3& p) {
    const double x = p.x() / p.z(), y = p.y() / p.z(), r2 = x * x + y * y;
    const double radial = 1 + 0.01 * r2 - 0.02 * r2 * r2 + 0.015 * r2 * r2 * r2;
    const double u = x * radial + 2 * 0.0001 * x * y + 0.0002 * (r2 + 2 * x * x);
    const double v = y * radial + 2 * 0.0002 * x * y + 0.0001 * (r2 + 2 * y * y);
    return Vec2((0.66 * u + 0.001) * 5472 + 0.5 * 5471, (0.67 * v - 0.002) * 5472 + 0.5 * 3647);
  });
  EXPECT_TRUE(read(text).assumes_T_cam_imu);
}

TEST_F(ForeignCalibrations, OpenSfmsOldCamerasHaveOneFocalLength) {
  const auto camera = read(R"({"a": {"projection_type": "fisheye", "width": 400, "height": 300, "focal": 0.5,
                               "k1": 0.02, "k2": -0.01}})");
  expect_pixels(camera, [](const Vec3& p) {
    const double r = std::hypot(p.x(), p.y()), t = std::atan2(r, p.z());
    const double d = t * (1 + 0.02 * t * t - 0.01 * t * t * t * t);
    return Vec2(200 * d * p.x() / r + 199.5, 200 * d * p.y() / r + 149.5);
  });
}

TEST_F(ForeignCalibrations, OneOfSeveralOpenSfmCamerasIsChosenByName) {
  const std::string text = R"({"a": {"projection_type": "perspective", "width": 400, "height": 300, "focal": 0.5},
                               "b": {"projection_type": "perspective", "width": 640, "height": 480, "focal": 0.9}})";
  EXPECT_THAT(fault(text), HasSubstr("holds 2 cameras (a, b): choose the one that took the images (--camera-id)"));
  EXPECT_EQ(read(text, "b").camera.width(), 640);
}

TEST_F(ForeignCalibrations, OpenSfmsModelsWithoutCounterpartAreRefusedByName) {
  EXPECT_THAT(fault(R"({"a": {"projection_type": "dual", "width": 400, "height": 300, "focal": 0.5}})"),
              HasSubstr("projection_type \"dual\" is not supported"));
  EXPECT_THAT(fault(R"({"a": {"projection_type": "fisheye62", "width": 400, "height": 300, "focal": 0.5, "k5": 0.1}})"),
              HasSubstr("\"k5\" of the model \"fisheye62\" is not 0"));
}

TEST_F(ForeignCalibrations, BasaltsCamerasHaveTheirPoseOnTheImu) {
  const std::string text =
      R"({"value0": {"T_imu_cam": [{"px": 0.1, "py": -0.2, "pz": 0.3, "qx": 0, "qy": 0, "qz": 1, "qw": 0},
                                   {"px": 0, "py": 0, "pz": 0, "qx": 0, "qy": 0, "qz": 0, "qw": 1}],
          "intrinsics": [{"camera_type": "ds", "intrinsics": {"fx": 158, "fy": 159, "cx": 319, "cy": 239, "xi": -0.17,
                          "alpha": 0.59}},
                         {"camera_type": "kb4", "intrinsics": {"fx": 158, "fy": 159, "cx": 319, "cy": 239, "k1": 0.01,
                          "k2": 0.002, "k3": 0, "k4": 0}}],
          "resolution": [[640, 480], [640, 480]]}})";
  const Calibration first = read(text, "cam0");
  EXPECT_FALSE(first.assumes_T_cam_imu);
  // A half turn about z: the IMU's origin is (0.1, -0.2, -0.3) in the camera's frame.
  EXPECT_LT((first.T_cam_imu.translation - Vec3(0.1, -0.2, -0.3)).norm(), 1e-12);
  expect_pixels(first, [](const Vec3& p) {
    const double d1 = p.norm(), z = -0.17 * d1 + p.z();
    const double d2 = std::sqrt(p.x() * p.x() + p.y() * p.y() + z * z), w = 0.59 * d2 + 0.41 * z;
    return Vec2(158 * p.x() / w + 319, 159 * p.y() / w + 239);
  });
  EXPECT_EQ(camera_ids(folder_ / "lens.dat"), (std::vector<std::string>{"cam0", "cam1"}));
}

TEST_F(ForeignCalibrations, BasaltsUnifiedModelHasAlpha) {
  const auto camera =
      read(R"({"value0": {"T_imu_cam": [{"px": 0, "py": 0, "pz": 0, "qx": 0, "qy": 0, "qz": 0, "qw": 1}], "intrinsics":
               [{"camera_type": "ucm", "intrinsics": {"fx": 158, "fy": 158, "cx": 319, "cy": 239, "alpha": 0.6}}],
               "resolution": [[640, 480]]}})");
  expect_pixels(camera, [](const Vec3& p) {
    const double w = 0.6 * p.norm() + 0.4 * p.z();
    return Vec2(158 * p.x() / w + 319, 158 * p.y() / w + 239);
  });
}

TEST_F(ForeignCalibrations, NerfstudiosPixelCentresAreAtHalves) {
  const auto camera = read(R"({"camera_model": "OPENCV", "fl_x": 500, "fl_y": 501, "cx": 320, "cy": 240, "w": 640,
                               "h": 480, "k1": 0.01, "k2": -0.02, "p1": 0.001, "p2": 0.002, "frames": []})");
  expect_pixels(camera, [](const Vec3& p) {
    const double x = p.x() / p.z(), y = p.y() / p.z(), r2 = x * x + y * y, radial = 1 + 0.01 * r2 - 0.02 * r2 * r2;
    return Vec2(500 * (x * radial + 0.002 * x * y + 0.002 * (r2 + 2 * x * x)) + 319.5,
                501 * (y * radial + 0.004 * x * y + 0.001 * (r2 + 2 * y * y)) + 239.5);
  });
  EXPECT_THAT(fault(R"({"w": 4, "h": 4, "frames": [{"fl_x": 6}], "fl_x": 5})"),
              HasSubstr("states the lens for each image"));
}

TEST_F(ForeignCalibrations, AgisoftsTangentialCoefficientsStandInItsOwnOrder) {
  const std::string text =
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<calibration>\n  <projection>frame</projection>\n"
      "  <width>4000</width>\n  <height>2250</height>\n  <f>3000.5</f>\n  <cx>10.5</cx>\n  <cy>-5.5</cy>\n"
      "  <b1>2.5</b1>\n  <k1>-0.01</k1>\n  <k2>0.02</k2>\n  <k3>-0.001</k3>\n  <p1>0.0001</p1>\n  <p2>-0.0002</p2>\n"
      "  <date>2024-01-01T00:00:00Z</date>\n</calibration>\n";
  expect_pixels(read(text), [](const Vec3& p) {
    const double x = p.x() / p.z(), y = p.y() / p.z(), r2 = x * x + y * y;
    const double radial = 1 - 0.01 * r2 + 0.02 * r2 * r2 - 0.001 * r2 * r2 * r2;
    const double u = x * radial + 0.0001 * (r2 + 2 * x * x) - 2 * 0.0002 * x * y;
    const double v = y * radial - 0.0002 * (r2 + 2 * y * y) + 2 * 0.0001 * x * y;
    return Vec2(2000 + 10.5 + 3003.0 * u - 0.5, 1125 - 5.5 + 3000.5 * v - 0.5);
  });
  const std::string skewed = std::string(text).replace(text.find("<b1>2.5</b1>"), 12, "<b2>2.5</b2>");
  EXPECT_THAT(fault(skewed), HasSubstr("<b2> of the projection \"frame\" is not 0"));
  EXPECT_THAT(fault("<project><chunk/></project>"), HasSubstr("Agisoft's <calibration>"));
}

TEST_F(ForeignCalibrations, VinssCamerasAreRead) {
  const std::string pinhole =
      "%YAML:1.0\n---\nmodel_type: PINHOLE\ncamera_name: camera\nimage_width: 640\nimage_height: 480\n"
      "distortion_parameters:\n   k1: -0.29\n   k2: 0.08\n   p1: 0.001\n   p2: 0.002\n"
      "projection_parameters:\n   fx: 461\n   fy: 459\n   cx: 330\n   cy: 240\n"
      "estimate_extrinsic: 0\nextrinsicRotation: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n"
      "   data: [0, -1, 0, 1, 0, 0, 0, 0, 1]\nextrinsicTranslation: !!opencv-matrix\n   rows: 3\n   cols: 1\n   dt: d\n"
      "   data: [0.1, 0.2, 0.3]\n";
  const Calibration camera = read(pinhole);
  expect_pixels(camera, [](const Vec3& p) {
    const double x = p.x() / p.z(), y = p.y() / p.z(), r2 = x * x + y * y, radial = 1 - 0.29 * r2 + 0.08 * r2 * r2;
    return Vec2(461 * (x * radial + 0.002 * x * y + 0.002 * (r2 + 2 * x * x)) + 330,
                459 * (y * radial + 0.004 * x * y + 0.001 * (r2 + 2 * y * y)) + 240);
  });
  EXPECT_LT((camera.T_cam_imu * Vec3(0.1, 0.2, 0.3)).norm(), 1e-12) << "the camera's place on the IMU";
  const std::string mei =
      "%YAML:1.0\n---\nmodel_type: MEI\ncamera_name: camera\nimage_width: 640\nimage_height: 480\n"
      "mirror_parameters:\n   xi: 1.8\ndistortion_parameters:\n   k1: 0\n   k2: 0\n   p1: 0\n   p2: 0\n"
      "projection_parameters:\n   gamma1: 1339\n   gamma2: 1340\n   u0: 307\n   v0: 237\n";
  expect_pixels(read(mei), [](const Vec3& p) {
    const double w = p.z() + 1.8 * p.norm();
    return Vec2(1339 * p.x() / w + 307, 1340 * p.y() / w + 237);
  });
  EXPECT_TRUE(read(mei).assumes_T_cam_imu);
  base::write_file(folder_ / "cam0_mei.yaml", mei);
  const Calibration fusion = read(
      "%YAML:1.0\nimu: 1\nnum_of_cam: 1\ncam0_calib: \"cam0_mei.yaml\"\nestimate_extrinsic: 1\nbody_T_cam0: "
      "!!opencv-matrix\n"
      "   rows: 4\n   cols: 4\n   dt: d\n   data: [0, -1, 0, 0.1, 1, 0, 0, 0.2, 0, 0, 1, 0.3, 0, 0, 0, 1]\n");
  EXPECT_LT((fusion.T_cam_imu * Vec3(0.1, 0.2, 0.3)).norm(), 1e-12);
  EXPECT_TRUE(std::holds_alternative<UnifiedModel>(fusion.camera.model()));
  EXPECT_THAT(fusion.notes, testing::Contains(HasSubstr("estimate_extrinsic is 1")));
  EXPECT_THAT(fault("%YAML:1.0\n---\nmodel_type: SCARAMUZZA\nimage_width: 640\nimage_height: 480\n"),
              HasSubstr("model_type \"SCARAMUZZA\" is not supported"));
}

/// ORB-SLAM3's Examples/Monocular/TUM1.yaml has one image size and one model for all cameras.
TEST_F(ForeignCalibrations, OrbSlam3sSettingsAreRead) {
  const std::string head = "%YAML:1.0\nFile.version: \"1.0\"\n";
  const std::string size = "Camera.width: 640\nCamera.height: 480\nCamera.fps: 30\nCamera.RGB: 1\n";
  const std::string text = head +
                           "Camera.type: \"PinHole\"\nCamera1.fx: 517.3\nCamera1.fy: 516.5\nCamera1.cx: 318.6\n"
                           "Camera1.cy: 255.3\nCamera1.k1: 0.26\nCamera1.k2: -0.95\nCamera1.p1: -0.005\n"
                           "Camera1.p2: 0.002\nCamera1.k3: 1.16\n" +
                           size;
  expect_pixels(read(text), [](const Vec3& p) {
    const double x = p.x() / p.z(), y = p.y() / p.z(), r2 = x * x + y * y;
    const double radial = 1 + 0.26 * r2 - 0.95 * r2 * r2 + 1.16 * r2 * r2 * r2;
    return Vec2(517.3 * (x * radial - 0.01 * x * y + 0.002 * (r2 + 2 * x * x)) + 318.6,
                516.5 * (y * radial + 0.004 * x * y - 0.005 * (r2 + 2 * y * y)) + 255.3);
  });
  const std::string fisheye = head +
                              "Camera.type: \"KannalaBrandt8\"\nCamera1.fx: 190\nCamera1.fy: 190\nCamera1.cx: 254\n"
                              "Camera1.cy: 256\nCamera1.k1: 0.003\nCamera1.k2: 0.0007\nCamera1.k3: -0.002\n"
                              "Camera1.k4: 0.0002\nCamera2.fx: 191\nCamera2.fy: 191\nCamera2.cx: 252\nCamera2.cy: 255\n"
                              "Camera2.k1: 0\nCamera2.k2: 0\nCamera2.k3: 0\nCamera2.k4: 0\n" +
                              size;
  EXPECT_THAT(fault(fisheye), HasSubstr("holds 2 cameras (rgb_0, rgb_1)"));
  const Calibration right = read(fisheye, "rgb_1");
  ASSERT_TRUE(std::holds_alternative<KannalaBrandt>(right.camera.model()));
  EXPECT_EQ(std::get<KannalaBrandt>(right.camera.model()).fx, 191);
  EXPECT_THAT(fault(head + "Camera1.fx: 1\nCamera1.fy: 1\nCamera1.cx: 1\nCamera1.cy: 1\n"),
              HasSubstr("has no image size: add the lines \"Camera.width\""));
}

/// ORB-SLAM3's Examples/Stereo/EuRoC.yaml: fx to cy are of 752x480, and ORB-SLAM3 scales them with the images.
TEST_F(ForeignCalibrations, OrbSlam3sNewSizeIsNamedAndNotUsed) {
  const std::string text =
      "%YAML:1.0\nFile.version: \"1.0\"\nCamera.type: \"PinHole\"\nCamera1.fx: 458.7\nCamera1.fy: 457.3\n"
      "Camera1.cx: 367.2\nCamera1.cy: 248.4\nCamera1.k1: 0\nCamera1.k2: 0\nCamera1.p1: 0\nCamera1.p2: 0\n"
      "Camera.width: 752\nCamera.height: 480\n";
  const Calibration resized = read(text + "Camera.newWidth: 600\nCamera.newHeight: 350\n");
  EXPECT_EQ(resized.camera.width(), 752);
  EXPECT_EQ(resized.camera.height(), 480);
  EXPECT_EQ(std::get<PinholeRadtan>(resized.camera.model()).fx, 458.7);
  EXPECT_THAT(resized.notes, testing::ElementsAre(HasSubstr(
                                 "Camera.newHeight (600x350) are not used: Camera1.fx to cy are of images as recorded, "
                                 "Camera.width x Camera.height (752x480)")));
  EXPECT_THAT(read(text + "Camera.newWidth: 752\nCamera.newHeight: 480\n").notes, testing::IsEmpty());
  EXPECT_THAT(read(text).notes, testing::IsEmpty());
}

/// ORB-SLAM3's Examples_old/Stereo/EuRoC.yaml: OpenCV accepts keys without a blank behind the colon.
TEST_F(ForeignCalibrations, OrbSlamsStereoSettingsAreOfRectifiedImages) {
  const Calibration calibration = read(
      "%YAML:1.0\n\nCamera.type: \"PinHole\"\nCamera.fx: 435.2\nCamera.fy: 435.3\nCamera.cx: 367.4\nCamera.cy: 252.2\n"
      "Camera.k1: 0.0\nCamera.k2: 0.0\nCamera.p1: 0.0\nCamera.p2: 0.0\nCamera.width: 752\nCamera.height: 480\n"
      "LEFT.K: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data:[458.6, 0.0, 367.2, 0.0, 457.2, 248.3, 0.0, "
      "0.0, "
      "1.0]\nViewer.PointSize:2\n");
  EXPECT_EQ(std::get<PinholeRadtan>(calibration.camera.model()).fx, 435.2);
  EXPECT_THAT(calibration.notes, testing::ElementsAre(HasSubstr("Camera.fx to cy are those of images rectified")));
}

std::string binary_camera(std::int32_t model, const std::vector<double>& parameters) {
  std::string bytes;
  base::append_raw(bytes, std::uint64_t{1});
  base::append_raw(bytes, std::uint32_t{7});
  base::append_raw(bytes, model);
  base::append_raw(bytes, std::uint64_t{640});
  base::append_raw(bytes, std::uint64_t{480});
  for (const double parameter : parameters) base::append_raw(bytes, parameter);
  return bytes;
}

TEST_F(ForeignCalibrations, ColmapsBinaryCamerasAreThoseOfItsText) {
  const Calibration binary = read(binary_camera(4, {500.25, 501, 320, 240, 0.1, -0.2, 0.001, 0.002}));
  EXPECT_EQ(camera_ids(folder_ / "lens.dat"), std::vector<std::string>{"7"});
  const Calibration text = read("7 OPENCV 640 480 500.25 501 320 240 0.1 -0.2 0.001 0.002\n");
  for (const Vec3& point : kPoints) EXPECT_EQ(*binary.camera.project(point), *text.camera.project(point));
  std::string cut = binary_camera(4, {500.25, 501, 320});
  EXPECT_THAT(fault(cut), HasSubstr("ends within a camera"));
}

TEST_F(ForeignCalibrations, AThinPrismIsReadWhereItIsNone) {
  const Calibration plain = read("1 THIN_PRISM_FISHEYE 640 480 300 301 320 240 0.01 0.002 0 0 0.003 0.0004 0 0\n");
  ASSERT_TRUE(std::holds_alternative<KannalaBrandt>(plain.camera.model()));
  EXPECT_EQ(std::get<KannalaBrandt>(plain.camera.model()).k, (std::array<double, 4>{0.01, 0.002, 0.003, 0.0004}));
  EXPECT_THAT(fault("1 THIN_PRISM_FISHEYE 640 480 300 301 320 240 0.01 0.002 0 0 0.003 0.0004 0.1 0\n"),
              HasSubstr("undistort the images (colmap image_undistorter)"));
}

const std::string kCam0 =
    "cam0:\n  camera_model: pinhole\n  intrinsics: [300, 300, 159.5, 119.5]\n  distortion_model: none\n"
    "  distortion_coeffs: []\n  resolution: [320, 240]\n";

TEST_F(ForeignCalibrations, ExtrinsicsUnderOtherProgramsKeysAreRead) {
  const std::string pose = ": [[0, -1, 0, 0.1], [1, 0, 0, 0.2], [0, 0, 1, 0.3], [0, 0, 0, 1]]\n";
  for (const std::string key : {"T_imu_cam", "T_BS", "T_SC", "body_T_cam0"}) {
    const Calibration calibration = read(kCam0 + "  " + key + pose);
    EXPECT_FALSE(calibration.assumes_T_cam_imu) << key;
    EXPECT_LT((calibration.T_cam_imu * Vec3(0.1, 0.2, 0.3)).norm(), 1e-12) << key;
  }
  EXPECT_LT((read(kCam0 + "  T_cam_imu" + pose).T_cam_imu.translation - Vec3(0.1, 0.2, 0.3)).norm(), 1e-12);
  const std::string opencv =
      "image_width: 320\nimage_height: 240\ncamera_matrix: [300, 0, 160, 0, 300, 120, 0, 0, 1]\n"
      "distortion_coefficients: [0, 0, 0, 0, 0]\nTbc: !!opencv-matrix\n  rows: 4\n  cols: 4\n  dt: f\n"
      "  data: [0, -1, 0, 0.1, 1, 0, 0, 0.2, 0, 0, 1, 0.3, 0, 0, 0, 1]\n";
  EXPECT_LT((read(opencv).T_cam_imu * Vec3(0.1, 0.2, 0.3)).norm(), 1e-12);
}

TEST_F(ForeignCalibrations, ExtrinsicsThatAreNotStatedAreAnAssumptionThatIsNotWritten) {
  const Calibration calibration = read(kCam0);
  EXPECT_TRUE(calibration.assumes_T_cam_imu);
  write_kalibr(folder_ / "again.yaml", calibration);
  EXPECT_THAT(base::read_text(folder_ / "again.yaml"), testing::Not(HasSubstr("T_cam_imu")));
  EXPECT_TRUE(read_calibration(folder_ / "again.yaml").assumes_T_cam_imu);
}

TEST_F(ForeignCalibrations, KeysThatAreNotUsedAreNamed) {
  EXPECT_THAT(read(kCam0 + "  imu_to_cam: [1, 2, 3]\n  rolling: yes\n").notes,
              testing::ElementsAre(HasSubstr("keys that are not used: imu_to_cam, rolling")));
  EXPECT_THAT(read(kCam0).notes, testing::IsEmpty());
}

}  // namespace
}  // namespace tileflight::imaging::foreign_calibrations_test
