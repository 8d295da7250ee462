// Calibration files that hold several cameras.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/imaging/calibration_files.h"

namespace tileflight::imaging::camera_ids_test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using tests::refusal_of;
using tests::TemporaryFolder;

// The IMU is a metre below cam0; cam1 is 0.1 m to the right of it and rotated by 90 degrees about the optical axis.
constexpr const char* kStereo = R"(cam0:
  camera_model: pinhole
  distortion_model: radtan
  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]
  intrinsics: [400, 400, 320, 240]
  resolution: [640, 480]
  T_cam_imu: [[1, 0, 0, 0], [0, 1, 0, 1], [0, 0, 1, 0], [0, 0, 0, 1]]
cam1:
  camera_model: pinhole
  distortion_model: equidistant
  distortion_coeffs: [0.01, 0.0, 0.0, 0.0]
  intrinsics: [410, 411, 321, 241]
  resolution: [640, 480]
  T_cn_cnm1: [[0, 1, 0, 0], [-1, 0, 0, -0.1], [0, 0, 1, 0], [0, 0, 0, 1]]
)";

TEST(CameraIds, OfKalibrsChainAreItsCameras) {
  const TemporaryFolder folder;
  const auto file = folder / "camchain.yaml";
  base::write_file(file, kStereo);
  EXPECT_THAT(camera_ids(file), ElementsAre("cam0", "cam1"));
  EXPECT_EQ(std::get<PinholeRadtan>(read_calibration(file, "cam0").camera.model()).fx, 400.0);
  const Calibration second = read_calibration(file, "cam1");
  EXPECT_EQ(std::get<KannalaBrandt>(second.camera.model()).cy, 241.0);
  // The IMU's origin is at (0, 1, 0) in cam0's frame.
  EXPECT_LT((second.T_cam_imu.translation - geometry::Vec3(1.0, -0.1, 0.0)).norm(), 1e-12);
  EXPECT_LT((second.T_cam_imu * geometry::Vec3(2, 0, 0) - geometry::Vec3(1.0, -2.1, 0.0)).norm(), 1e-12);
  EXPECT_THAT(refusal_of([&] { read_calibration(file, ""); }),
              HasSubstr("holds 2 cameras (cam0, cam1): choose the one"));
  EXPECT_THAT(refusal_of([&] { read_calibration(file, "cam2"); }), HasSubstr("has no camera cam2, only cam0, cam1"));
  EXPECT_EQ(std::get<PinholeRadtan>(read_calibration(file).camera.model()).fx, 400.0);  // the first camera
  std::string broken(kStereo);
  broken.replace(broken.find("[410, 411"), 9, "[410, nan");
  base::write_file(file, broken);
  EXPECT_THAT(refusal_of([&] { read_calibration(file, "cam1"); }), HasSubstr(": cam1: "));
}

TEST(Camchain, IsWrittenAndReadAgain) {
  const TemporaryFolder folder;
  const auto file = folder / "camchain.yaml";
  base::write_file(file, kStereo);
  std::vector<ChainCamera> cameras = read_camchain(file);
  ASSERT_EQ(cameras.size(), 2U);
  EXPECT_TRUE(cameras[0].T_body_cam.matrix().isIdentity(0.0)) << "the body is the first camera";
  // cam1's origin: 0 = R p + t, with T_cn_cnm1 = (R, t).
  EXPECT_LT((cameras[1].T_body_cam.translation - geometry::Vec3(-0.1, 0, 0)).norm(), 1e-12);
  cameras[0].name = "left";
  cameras[1].folder = "cameras/right";
  cameras[1].timeshift_cam_imu_s = -0.0125;
  cameras[1].T_body_cam.translation.z() = 1.0 / 3.0;
  cameras[1].calibration.T_cam_imu = cameras[1].T_body_cam.inverse() * cameras[0].calibration.T_cam_imu;
  write_camchain(file, cameras);
  const std::vector<ChainCamera> again = read_camchain(file);
  ASSERT_EQ(again.size(), 2U);
  EXPECT_EQ(again[0].name, "left");
  EXPECT_EQ(again[1].folder, "cameras/right");
  EXPECT_EQ(again[1].timeshift_cam_imu_s, -0.0125);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_LT((again[i].T_body_cam.matrix() - cameras[i].T_body_cam.matrix()).cwiseAbs().maxCoeff(), 1e-14);
    EXPECT_LT(
        (again[i].calibration.T_cam_imu.matrix() - cameras[i].calibration.T_cam_imu.matrix()).cwiseAbs().maxCoeff(),
        1e-14);
    EXPECT_EQ(again[i].calibration.camera.width(), 640);
  }
  // Without our keys, as Kalibr reads it, the same rig.
  std::string text = base::read_text(file);
  for (std::size_t at; (at = text.find("  T_body_cam:")) != std::string::npos;) text.replace(at, 13, "  other:");
  base::write_file(file, text);
  EXPECT_LT((read_camchain(file)[1].T_body_cam.matrix() - cameras[1].T_body_cam.matrix()).cwiseAbs().maxCoeff(), 1e-14);
}

TEST(Camchain, WhatIsWrongIsSaidWithTheCamera) {
  const TemporaryFolder folder;
  const auto file = folder / "camchain.yaml";
  const auto refusal = [&](const std::string& from, const std::string& to) {
    std::string text(kStereo);
    text.replace(text.find(from), from.size(), to);
    base::write_file(file, text);
    return refusal_of([&] { read_camchain(file); });
  };
  const std::string chain = "T_cn_cnm1: [[0, 1, 0, 0], [-1, 0, 0, -0.1], [0, 0, 1, 0], [0, 0, 0, 1]]";
  EXPECT_THAT(refusal(chain, "T_cn_cnm1: [[0, 2, 0, 0], [-1, 0, 0, -0.1], [0, 0, 1, 0], [0, 0, 0, 1]]"),
              HasSubstr("cam1: \"T_cn_cnm1\" is not a rigid motion (rotation and translation): its 3x3 part is not "
                        "orthonormal, but off by 3.000"));
  EXPECT_THAT(refusal(chain, "T_cn_cnm1: [[0, 1, 0, 0], [1, 0, 0, -0.1], [0, 0, 1, 0], [0, 0, 0, 1]]"),
              HasSubstr("is a reflection"));
  EXPECT_THAT(refusal(chain, "T_cn_cnm1: [[0, 1, 0, 0], [-1, 0, 0, -110], [0, 0, 1, 0], [0, 0, 0, 1]]"),
              HasSubstr("cam1: \"T_cn_cnm1\" puts the camera 110.0 m from the one before, too far for one body: "
                        "translations are in metres, not millimetres"));
  EXPECT_THAT(refusal("[0, 1, 0, 1]", "[0, 1, 0, 35]"), HasSubstr("camchain.yaml: cam0: \"T_cam_imu\" puts the camera "
                                                                  "35.0 m from the IMU"));
  EXPECT_THAT(refusal(chain, "rostopic: /cam1"), HasSubstr("cam1: neither \"T_cn_cnm1\" nor \"T_cam_imu\""));
  EXPECT_THAT(refusal(chain, chain + "\n  T_cam_imu: [[1, 0, 0, 3], [0, 1, 0, 1], [0, 0, 1, 0], [0, 0, 0, 1]]"),
              HasSubstr("put the camera at different places"));
  EXPECT_THAT(refusal(chain, chain + "\n  timeshift_cam_imu: 5000000"), HasSubstr("it must be in seconds"));
  EXPECT_THAT(refusal("cam1:", "cam3:"), HasSubstr("has no camera \"cam1\""));
  base::write_file(file, "{}\n");
  EXPECT_THAT(refusal_of([&] { read_camchain(file); }), HasSubstr("this is not a Kalibr camchain"));
  for (const char* other : {"# Camera list\n1 OPENCV_FISHEYE 640 480 300 301 320 240 0.01 0.002 0 0\n",
                            "%YAML:1.0\nCamera0.model: OPENCV_FISHEYE\nCamera0.fx: 436.25\n", "[cam0]\n"}) {
    base::write_file(file, other);
    EXPECT_THAT(refusal_of([&] { read_camchain(file); }), HasSubstr("this is not a Kalibr camchain"));
  }
}

TEST(CameraIds, OfColmapAreItsNumbers) {
  const TemporaryFolder folder;
  const auto file = folder / "cameras.txt";
  base::write_file(file,
                   "# Camera list\n# Number of cameras: 2\n3 PINHOLE 640 480 500 501 320 240\n"
                   "7 SIMPLE_PINHOLE 320 240 250 160 120\n");
  EXPECT_THAT(camera_ids(file), ElementsAre("3", "7"));
  EXPECT_EQ(read_calibration(file, "7").camera.width(), 320);
  EXPECT_EQ(std::get<PinholeRadtan>(read_calibration(file, "3").camera.model()).fy, 501.0);
  EXPECT_THAT(refusal_of([&] { read_calibration(file, ""); }), HasSubstr("holds 2 cameras (3, 7): choose the one"));
  EXPECT_THAT(refusal_of([&] { read_calibration(file, "cam0"); }), HasSubstr("has no camera cam0, only 3, 7"));
  base::write_file(file, "9 PINHOLE 640 480 500 501 320 240\n");
  EXPECT_EQ(read_calibration(file, "").camera.width(), 640);
}

TEST(CameraIds, OtherFormsHoldOneWithoutAName) {
  const TemporaryFolder folder;
  const auto file = folder / "camera.txt";
  base::write_file(file, "Pinhole 50 50 32 24 0\n64 48\ncrop\n64 48\n");
  EXPECT_THAT(camera_ids(file), IsEmpty());
  EXPECT_EQ(read_calibration(file, "").camera.width(), 64);
  EXPECT_THAT(refusal_of([&] { read_calibration(file, "cam0"); }), HasSubstr("contains one camera without a name"));
}

}  // namespace
}  // namespace tileflight::imaging::camera_ids_test
