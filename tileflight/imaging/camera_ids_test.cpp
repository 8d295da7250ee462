// Calibration files that hold several cameras.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/base/files.h"
#include "tileflight/imaging/calibration_files.h"

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
