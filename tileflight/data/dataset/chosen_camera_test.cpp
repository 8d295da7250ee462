// Datasets read with a calibration that replaces their own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/moving_picture.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/dataset.h"

namespace tileflight::dataset::chosen_camera_test {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using tests::moving_picture;
using tests::refusal_of;

constexpr int kWidth = 64, kHeight = 48;

class ChosenCamera : public testing::Test {
 protected:
  ChosenCamera() {
    base::write_file(folder_ / "opencv.yaml",
                     "%YAML:1.0\n---\nimage_width: 64\nimage_height: 48\ncamera_matrix: !!opencv-matrix\n"
                     "  rows: 3\n  cols: 3\n  dt: d\n  data: [50, 0, 32, 0, 51, 24, 0, 0, 1]\n"
                     "distortion_model: plumb_bob\n"
                     "distortion_coefficients: !!opencv-matrix\n  rows: 1\n  cols: 4\n  dt: d\n"
                     "  data: [0.01, 0, 0, 0]\n");
    base::write_file(folder_ / "cameras.txt", "1 PINHOLE 128 96 100 102 64 48\n2 PINHOLE 64 64 50 50 32 32\n");
  }
  /// Three images without calibration.
  void pictures(const fs::path& images) const {
    fs::create_directories(images);
    for (int i = 0; i < 3; ++i)
      imaging::write_rgb(images / ("00000" + std::to_string(i) + ".png"), moving_picture(kWidth, kHeight, i));
  }
  static double fx(const Dataset& dataset) {
    return std::get<imaging::PinholeRadtan>(dataset.calibration.camera.model()).fx;
  }

  tileflight::tests::TemporaryFolder folder_;
};

TEST_F(ChosenCamera, ServesFoldersOfPicturesWithoutOne) {
  pictures(folder_ / "set/images");
  base::write_file(folder_ / "set/times.txt", "0\n1\n2\n");
  EXPECT_THAT(refusal_of([&] { read_dataset(folder_ / "set"); }), HasSubstr("or name a file (--camera)"));
  const Dataset dataset = read_dataset(folder_ / "set", {folder_ / "opencv.yaml", ""});
  EXPECT_EQ(fx(dataset), 50.0);
  EXPECT_THAT(dataset.warnings, IsEmpty());
}

TEST_F(ChosenCamera, IsScaledRefusedOrNamed) {
  pictures(folder_ / "set/image_0");  // KITTI's, without calib.txt
  base::write_file(folder_ / "set/times.txt", "0\n1\n2\n");
  const Dataset dataset = read_dataset(folder_ / "set", {folder_ / "cameras.txt", "1"});
  EXPECT_EQ(fx(dataset), 50.0);
  EXPECT_EQ(dataset.calibration.camera.width(), kWidth);
  EXPECT_THAT(dataset.warnings, ElementsAre(HasSubstr("the calibration is scaled")));
  EXPECT_THAT(refusal_of([&] {
                read_dataset(folder_ / "set", {folder_ / "cameras.txt", "2"});
              }),
              HasSubstr("the aspect ratio differs"));
  base::write_file(folder_ / "turned.txt",
                   "1 PINHOLE " + std::to_string(kHeight) + " " + std::to_string(kWidth) + " 50 50 9 9\n");
  EXPECT_THAT(refusal_of([&] {
                read_dataset(folder_ / "set", {folder_ / "turned.txt", ""});
              }),
              HasSubstr("if its width and height are exchanged"));
  EXPECT_THAT(refusal_of([&] {
                read_dataset(folder_ / "set", {folder_ / "cameras.txt", ""});
              }),
              HasSubstr("holds 2 cameras (1, 2)"));
}

/// A lens profile of Gyroflow lists the sizes of images with the same lens, and the readout time of each.
TEST_F(ChosenCamera, OfALensProfileIsThatOfTheModeOfThisSize) {
  pictures(folder_ / "set/images");
  base::write_file(folder_ / "set/times.txt", "0\n1\n2\n");
  const auto profile = [&](const std::string& size, const std::string& modes) {
    base::write_file(folder_ / "p.json",
                     "{\"camera_model\": \"M\", \"calib_dimension\": " + size +
                         ", \"frame_readout_time\": 20, \"fps\": 30, \"fisheye_params\": {\"camera_matrix\": "
                         "[[100, 0, 64], [0, 102, 48], [0, 0, 1]], \"distortion_coeffs\": [0, 0, 0, 0]}, "
                         "\"compatible_settings\": [" +
                         modes + "]}");
    return read_dataset(folder_ / "set", {folder_ / "p.json", ""});
  };
  const std::string size = "{\"w\": 128, \"h\": 96}";
  const Dataset listed = profile(size, "{\"width\": 64, \"height\": 48, \"fps\": 60, \"frame_readout_time\": 12}");
  EXPECT_EQ(std::get<imaging::KannalaBrandt>(listed.calibration.camera.model()).fx, 50.0);
  EXPECT_DOUBLE_EQ(listed.calibration.line_delay_s, 0.012 / 48);
  EXPECT_THAT(listed.warnings, ElementsAre(HasSubstr("is a lens profile of M for 64x48 at 60 frames per second")));
  const Dataset scaled = profile(size, "");
  EXPECT_DOUBLE_EQ(scaled.calibration.line_delay_s, 0.020 / 48);
  EXPECT_THAT(scaled.warnings, ElementsAre(HasSubstr("for 128x96 at 30"), HasSubstr("does not list that size")));
  EXPECT_THAT(refusal_of([&] { profile("{\"w\": 128, \"h\": 72}", ""); }), HasSubstr("the aspect ratio differs"));
}

TEST_F(ChosenCamera, LeavesWhereTheBodyIsToTheLayout) {
  pictures(folder_ / "set/mav0/cam0/data");
  base::write_file(folder_ / "set/mav0/cam0/data.csv", "0,000000.png\n1000000000,000001.png\n2000000000,000002.png\n");
  base::write_file(folder_ / "set/mav0/cam0/sensor.yaml",
                   "T_BS: {data: [1,0,0,0.5, 0,1,0,0, 0,0,1,0, 0,0,0,1]}\nresolution: [64, 48]\n"
                   "intrinsics: [70, 70, 32, 24]\ndistortion_model: radial-tangential\n"
                   "distortion_coefficients: [0, 0, 0, 0]\n");
  fs::create_directories(folder_ / "set/mav0/state_groundtruth_estimate0");
  base::write_file(folder_ / "set/mav0/state_groundtruth_estimate0/data.csv",
                   "0,1,2,3,1,0,0,0\n1000000000,2,2,3,1,0,0,0\n");
  EXPECT_EQ(fx(read_dataset(folder_ / "set")), 70.0);
  const Dataset dataset = read_dataset(folder_ / "set", {folder_ / "opencv.yaml", ""});
  EXPECT_EQ(fx(dataset), 50.0);
  EXPECT_EQ(dataset.groundtruth->poses[0].T_local_camera.translation, geometry::Vec3(1.5, 2, 3));
}

}  // namespace
}  // namespace tileflight::dataset::chosen_camera_test
