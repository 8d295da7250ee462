#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/calibration_checks.h"
#include "tileflight/core/imaging/calibration_files.h"

namespace tileflight::imaging::opencv_file_test {
namespace {

using geometry::Vec2;
using geometry::Vec3;
using testing::AllOf;
using testing::HasSubstr;

Camera read(const std::string& content, const std::string& name = "calibration.dat") {
  const tests::TemporaryFolder folder;
  base::write_file(folder / name, content);
  return read_calibration(folder / name).camera;
}

std::string error(const std::string& content) {
  const std::string line = tests::refusal_of([&] { read(content); });
  EXPECT_THAT(line, HasSubstr("calibration.dat")) << content;
  return line;
}

/// cv::projectPoints as documented: x' = x (1 + k1 r2 + k2 r4) + 2 p1 x y + p2 (r2 + 2 x x).
Vec2 opencv_pixel(const std::array<double, 4>& f, const std::array<double, 4>& d, const Vec3& point) {
  const double x = point.x() / point.z(), y = point.y() / point.z(), r2 = x * x + y * y;
  const double radial = 1 + d[0] * r2 + d[1] * r2 * r2;
  return {f[0] * (x * radial + 2 * d[2] * x * y + d[3] * (r2 + 2 * x * x)) + f[2],
          f[1] * (y * radial + d[2] * (r2 + 2 * y * y) + 2 * d[3] * x * y) + f[3]};
}

/// cv::fisheye::projectPoints: theta_d = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8).
Vec2 fisheye_pixel(const std::array<double, 4>& f, const std::array<double, 4>& k, const Vec3& point) {
  const double r = std::hypot(point.x(), point.y()), theta = std::atan2(r, point.z()), t2 = theta * theta;
  const double theta_d =
      theta * (1 + k[0] * t2 + k[1] * std::pow(t2, 2) + k[2] * std::pow(t2, 3) + k[3] * t2 * t2 * t2 * t2);
  return {f[0] * theta_d * point.x() / r + f[2], f[1] * theta_d * point.y() / r + f[3]};
}

const std::array<double, 4> kFocal{538.5, 540.25, 319.75, 241.125};
const std::array<double, 4> kRadtan{-0.21, 0.05, 0.0011, -0.0007};
const std::array<double, 4> kFisheye{0.021, -0.013, 0.0042, -0.0009};
const std::vector<Vec3> kPoints{{0.1, 0.2, 1}, {-0.4, 0.3, 1.2}, {0.55, -0.4, 1}, {-0.3, -0.35, 0.9}};

void expect_pixels(const Camera& camera, const std::function<Vec2(const Vec3&)>& pixel_of) {
  EXPECT_EQ(camera.width(), 640);
  EXPECT_EQ(camera.height(), 480);
  for (const Vec3& point : kPoints) {
    const auto pixel = camera.project(point);
    ASSERT_TRUE(pixel);
    EXPECT_LT((*pixel - pixel_of(point)).norm(), 1e-9);
  }
}
void expect_radtan(const Camera& camera) {
  expect_pixels(camera, [](const Vec3& point) { return opencv_pixel(kFocal, kRadtan, point); });
}
void expect_fisheye(const Camera& camera) {
  expect_pixels(camera, [](const Vec3& point) { return fisheye_pixel(kFocal, kFisheye, point); });
}

const std::string kMatrixData = "[ 5.3850000000000000e+02, 0., 3.1975e+02, 0.,\n       540.25, 241.125, 0., 0., 1. ]";
const std::string kSizeLines = "image_width: 640\nimage_height: 480\n";
const std::string kFive = "-0.21, 0.05, 0.0011, -0.0007, 0.";

/// A matrix as written by cv::FileStorage.
std::string opencv_matrix(const std::string& key, int rows, int cols, const std::string& data) {
  return key + ": !!opencv-matrix\n   rows: " + std::to_string(rows) + "\n   cols: " + std::to_string(cols) +
         "\n   dt: d\n   data: " + data + "\n";
}
const std::string kMatrixLines = opencv_matrix("camera_matrix", 3, 3, kMatrixData);
std::string lens_file(const std::string& distortion, const std::string& more = "") {
  return "%YAML:1.0\n---\n" + kSizeLines + kMatrixLines + "distortion_coefficients: [" + distortion + "]\n" + more;
}

TEST(OpenCv, YamlAsItsCalibrationExampleWritesIt) {
  const std::string head = "%YAML:1.0\n---\ncalibration_time: \"Sat Nov 21 20:00:00 2026\"\nnr_of_frames: 25\n";
  const std::string tail =
      "avg_reprojection_error: 2.1e-01\nper_view_reprojection_errors: !!opencv-matrix\n   rows: 2\n"
      "   cols: 1\n   dt: f\n   data: [ 1.9e-01, .Nan ]\n";
  const std::string d = opencv_matrix("distortion_coefficients", 5, 1, "[ " + kFive + " ]");
  expect_radtan(read(head + kSizeLines + "fisheye_model: 0\n" + kMatrixLines + d + tail));
  const std::string k = opencv_matrix("distortion_coefficients", 4, 1, "[ 0.021, -0.013, 0.0042, -0.0009 ]");
  expect_fisheye(read(head + kSizeLines + "fisheye_model: 1\n" + kMatrixLines + k + tail));
}

TEST(OpenCv, XmlAsItsCalibrationExampleWritesIt) {
  const auto file = [](const std::string& flag, const std::string& coefficients, const std::string& size) {
    return "<?xml version=\"1.0\"?>\n<!-- a <comment> -->\n<opencv_storage>\n"
           "<calibration_time>\"Sat Nov 21\"</calibration_time>\n" +
           size + "<views type_id=\"opencv-matrix\"/>\n<names>\n  a.png <_>b.png</_></names>\n" + flag +
           "<Camera_Matrix type_id=\"opencv-matrix\">\n  <rows>3</rows>\n  <cols>3</cols>\n  <dt>d</dt>\n  <data>\n"
           "    5.3850000000000000e+02 0. 319.75 0.\n    540.25 241.125 0. 0. 1.</data></Camera_Matrix>\n"
           "<Distortion_Coefficients type_id=\"opencv-matrix\">\n  <rows>5</rows>\n  <cols>1</cols>\n  <dt>d</dt>\n"
           "  <data>" +
           coefficients + "</data></Distortion_Coefficients>\n</opencv_storage>\n";
  };
  const std::string sides = "<image_Width>640</image_Width>\n<image_Height>480</image_Height>\n";
  expect_radtan(read(file("", "\n -0.21 0.05\n 0.0011 -0.0007 0.", sides)));
  expect_radtan(read(file("", "-0.21 0.05 0.0011 -0.0007 0.", "<image_size>\n  640 480</image_size>\n")));
  expect_fisheye(read(file("<fisheye_model>1</fisheye_model>\n", "0.021 -0.013 0.0042 -0.0009", sides)));
}

TEST(OpenCv, CameraInfoOfRos) {
  const auto file = [](const std::string& model, const std::string& coefficients) {
    return kSizeLines + "camera_name: cam0\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: " + kMatrixData +
           "\ndistortion_model: " + model + "\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [" +
           coefficients +
           "]\nrectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n"
           "projection_matrix:\n  rows: 3\n  cols: 4\n  data: [500, 0, 320, 0, 0, 500, 240, 0, 0, 0, 1, 0]\n";
  };
  expect_radtan(read(file("plumb_bob", kFive)));
  expect_radtan(read(file("plumb_bob", "-0.21, 0.05, 0.0011, -0.0007")));
  expect_radtan(read(file("rational_polynomial", kFive + ", 0, 0, 0")));
  expect_fisheye(read(file("equidistant", "0.021, -0.013, 0.0042, -0.0009")));
  expect_fisheye(read(file("fisheye", "0.021, -0.013, 0.0042, -0.0009")));
  EXPECT_THAT(error(file("ftheta", kFive)), AllOf(HasSubstr("\"ftheta\""), HasSubstr("use plumb_bob")));
  expect_fisheye(read(file("equidistant", "0.021, -0.013, 0.0042, -0.0009, 0")));
  EXPECT_THAT(error(file("equidistant", "0.021, -0.013, 0.0042, -0.0009, 0.1")), HasSubstr("4 numbers, not 5"));
}

// sensor_msgs/CameraInfo: K is that of the whole sensor, of which the images are a region with joined pixels.
TEST(OpenCv, CameraInfoOfARegionOfTheSensor) {
  const auto camera = [](const std::string& more) {
    return read("width: 640\nheight: 480\nK: " + kMatrixData + "\nD: [0, 0, 0, 0, 0]\n" + more);
  };
  const auto pixel = [](const Camera& c) { return *c.project(Vec3(0.1, -0.2, 1.0)); };
  const geometry::Vec2 whole = pixel(camera(""));
  const Camera none = camera("binning_x: 1\nroi: {x_offset: 0, y_offset: 0, height: 0, width: 0, do_rectify: false}\n");
  EXPECT_EQ(pixel(none), whole);
  EXPECT_EQ(none.width(), 640);
  const Camera part = camera("roi:\n  x_offset: 100\n  y_offset: 40\n  height: 200\n  width: 320\n  do_rectify: 0\n");
  EXPECT_EQ(part.width(), 320);
  EXPECT_EQ(part.height(), 200);
  EXPECT_LT((pixel(part) - (whole - geometry::Vec2(100, 40))).norm(), 1e-9);
  const Camera joined =
      camera("binning_x: 2\nbinning_y: 2\nroi: {x_offset: 100, y_offset: 40, height: 200, width: 320}\n");
  EXPECT_EQ(joined.width(), 160);
  const geometry::Vec2 half(0.5, 0.5);  // from the pixel's corner, which halves, to its centre
  EXPECT_LT((pixel(joined) + half - 0.5 * (whole - geometry::Vec2(100, 40) + half)).norm(), 1e-9);
  EXPECT_THAT(error("width: 640\nheight: 480\nK: " + kMatrixData +
                    "\nD: [0, 0, 0, 0, 0]\nroi: {x_offset: 400, y_offset: 0, height: 480, width: 320}\n"),
              HasSubstr("its roi is no part of the image of 640x480"));
}

TEST(OpenCv, OtherKeysAreReadOrNamed) {
  const std::string rest = kSizeLines + "camera_matrix: " + kMatrixData + "\n";
  expect_radtan(read(rest + "dist_coeff: [" + kFive + "]\n"));
  EXPECT_THAT(error(rest + "dist_params: [" + kFive + "]\n"),
              HasSubstr("has no \"distortion_coefficients\", but \"dist_params\""));
  EXPECT_THAT(error("lens: &lens {D: [0, 0, 0, 0, 0]}\n<<: *lens\n" + rest + "D: [0, 0, 0, 0, 0]\n"),
              HasSubstr("'<<' (YAML's merge key) is not read"));
}

TEST(OpenCv, FilesBesideItAreReadOrNamed) {
  expect_radtan(
      read("#General sensor definitions.\nsensor_type: camera\ncomment: VI-Sensor cam0\nT_BS:\n  cols: 4\n  rows: 4\n"
           "  data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\nrate_hz: 20\nresolution: [640, 480]\n"
           "camera_model: pinhole\nintrinsics: [538.5, 540.25, 319.75, 241.125]\n"
           "distortion_model: radial-tangential\n"
           "distortion_coefficients: [-0.21, 0.05, 0.0011, -0.0007]\n"));
  EXPECT_THAT(
      error("# oST version 5.0 parameters\n\n[image]\n\nwidth\n640\n\nheight\n480\n\n[narrow_stereo]\n\ncamera matrix\n"
            "538.5 0 319.75\n0 540.25 241.125\n0 0 1\n"),
      HasSubstr("is ROS's ost.ini: give the ost.yaml"));
}

TEST(OpenCv, MessageOfRosAsText) {
  expect_radtan(
      read("header:\n  seq: 1\n  frame_id: \"cam\"\nheight: 480\nwidth: 640\ndistortion_model: \"plumb_bob\"\n"
           "D: [" +
           kFive + "]\nK: " + kMatrixData + "\nR: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nbinning_x: 0\n---\n"));
}

/// `rostopic echo /camera_info > camera.yaml`, for as long as a flight: the messages differ by their headers.
TEST(OpenCv, ManyMessagesOfRosAreOneCalibration) {
  const auto message = [](int number, const std::string& width) {
    return "header: \n  seq: " + std::to_string(number) + "\n  stamp: \n    secs: " + std::to_string(1000 + number) +
           "\n  frame_id: \"cam\"\nheight: 480\nwidth: " + width + "\ndistortion_model: \"plumb_bob\"\nD: [" + kFive +
           "]\nK: " + kMatrixData + "\nR: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nbinning_x: 0\n---\n";
  };
  std::string many;
  int count = 0;
  while (many.size() <= kMaxCalibrationBytes) many += message(count++, "640");
  const tests::TemporaryFolder folder;
  base::write_file(folder / "camera.yaml", many + message(count++, "640"));
  const Calibration calibration = read_calibration(folder / "camera.yaml");
  expect_radtan(calibration.camera);
  EXPECT_THAT(calibration.notes,
              testing::ElementsAre(HasSubstr("the first of its " + std::to_string(count) + " YAML documents is used")));
  EXPECT_THAT(error(message(0, "640") + message(1, "640") + message(2, "320")),
              HasSubstr("line 29: a second calibration begins, which differs from the first: keep one"));
}

TEST(OpenCv, OtherNamesAndCounts) {
  const std::string size = "image_size: [640, 480]\n";
  expect_radtan(read("cameraMatrix: [[538.5, 0, 319.75], [0, 540.25, 241.125], [0, 0, 1]]\ndistCoeffs: [[" + kFive +
                     "]]\n" + size));
  for (const int count : {5, 8, 12, 14}) {
    std::string numbers = kFive;
    for (int i = 5; i < count; ++i) numbers += ", 0";
    expect_radtan(read(lens_file(numbers)));
  }
  expect_pixels(read(lens_file("")), [](const Vec3& point) { return opencv_pixel(kFocal, {}, point); });
}

TEST(OpenCv, RationalAndThinPrismCoefficientsAreRead) {
  const std::string four = "-0.21, 0.05, 0.0011, -0.0007";
  const std::array<double, 8> beyond{0.02, 0.11, -0.03, 0.004, 0.0012, -0.0004, 0.0009, 0.0003};
  for (const std::size_t count : {1U, 4U, 8U}) {
    std::string numbers = four;
    std::array<double, 8> k{};
    for (std::size_t i = 0; i < count; ++i) {
      k[i] = beyond[i];
      numbers += ", " + std::to_string(k[i]);
    }
    expect_pixels(read(lens_file(numbers)), [&k](const Vec3& point) -> Vec2 {
      const double x = point.x() / point.z(), y = point.y() / point.z(), r2 = x * x + y * y;
      // Effect of the rational model relative to the polynomial one.
      const double above = 1 - 0.21 * r2 + 0.05 * r2 * r2 + k[0] * r2 * r2 * r2;
      const double below = 1 + k[1] * r2 + k[2] * r2 * r2 + k[3] * r2 * r2 * r2;
      const double more = above / below - (1 - 0.21 * r2 + 0.05 * r2 * r2);
      return opencv_pixel(kFocal, kRadtan, point) + Vec2(kFocal[0] * (x * more + k[4] * r2 + k[5] * r2 * r2),
                                                         kFocal[1] * (y * more + k[6] * r2 + k[7] * r2 * r2));
    });
  }
}

TEST(OpenCv, WhatNoLensHereHasIsNamed) {
  const std::string four = "-0.21, 0.05, 0.0011, -0.0007";
  EXPECT_THAT(error(lens_file(four + ", 0, 0, 0, 0, 0, 0, 0, 0, 0.25, 0")),
              AllOf(HasSubstr("tx is 0.25"), HasSubstr("CALIB_TILTED_MODEL")));
  EXPECT_THAT(error(lens_file(four + ", 0, 0, 0, 0, 0, 0, 0, 0, 0, -0.5")), HasSubstr("ty is -0.5"));
  EXPECT_THAT(error(lens_file(four)), AllOf(HasSubstr("k1 k2 p1 p2"), HasSubstr("distortion_model: equidistant")));
  EXPECT_THAT(error(lens_file("1, 2, 3")), HasSubstr("not 3"));
  EXPECT_THAT(error(kSizeLines + "K: [500, 1, 320, 0, 500, 240, 0, 0, 1]\nD: [0, 0, 0, 0, 0]\n"), HasSubstr("skew"));
}

TEST(OpenCv, BadFilesAreOneClearLine) {
  const std::string d = "D: [0, 0, 0, 0, 0]\n";
  const auto with_matrix = [&](const std::string& k) { return error(kSizeLines + d + "K: " + k + "\n"); };
  EXPECT_THAT(with_matrix("[0, 0, 320, 0, 500, 240, 0, 0, 1]"), HasSubstr("focal"));
  EXPECT_THAT(with_matrix("[.nan, 0, 320, 0, 500, 240, 0, 0, 1]"), HasSubstr("\".nan\" is not a number"));
  EXPECT_THAT(with_matrix("[nan, 0, 320, 0, 500, 240, 0, 0, 1]"), HasSubstr("finite"));
  EXPECT_THAT(with_matrix("[500, nan, 320, 0, 500, 240, 0, 0, 1]"), HasSubstr("[fx, 0, cx"));
  EXPECT_THAT(with_matrix("[500, 0, 320]"), AllOf(HasSubstr("\"K\""), HasSubstr("3 rows")));
  EXPECT_THAT(with_matrix("{rows: 1, cols: 9, data: [500, 0, 320, 0, 500, 240, 0, 0, 1]}"), HasSubstr("3 rows"));
  EXPECT_THAT(error(lens_file("0, 0, inf, 0, 0")), HasSubstr("finite"));
  EXPECT_THAT(error(lens_file("0, 0, 0, 0, nan")), HasSubstr("finite"));
  EXPECT_THAT(error(lens_file("0, 0, 0, 0, 0", "fisheye_model: maybe\n")), HasSubstr("\"maybe\""));
  EXPECT_THAT(error(lens_file("0, 0, 0, 0, 0", "image_width: 320\n")), HasSubstr("twice"));
  EXPECT_THAT(error(kMatrixLines + d), HasSubstr("\"image_width\""));
  EXPECT_THAT(error(kMatrixLines + d + "image_size: [640]\n"), HasSubstr("image_size"));
  EXPECT_THAT(error(kMatrixLines + d + "image_width: 0\nimage_height: 480\n"), HasSubstr("\"image_width\""));
  EXPECT_THAT(error(kMatrixLines + d + "image_width: 640\nimage_height: 1e30\n"), HasSubstr("\"image_height\""));
  EXPECT_THAT(error(kMatrixLines + d + "image_width: []\nimage_height: 480\n"), HasSubstr("one number"));
  EXPECT_THAT(error(kSizeLines + kMatrixLines), HasSubstr("distortion_coefficients"));
  EXPECT_THAT(error(kSizeLines + d), AllOf(HasSubstr("cam0"), HasSubstr("camera_matrix")));
  EXPECT_THAT(error("%YAML:1.0\n---\nK: [1, 2\n b: {"), HasSubstr("not valid YAML"));
  EXPECT_THAT(error("<a/>"), AllOf(HasSubstr("<a>"), HasSubstr("<opencv_storage>")));
  EXPECT_THAT(error("<opencv_storage>\n<a>1"), AllOf(HasSubstr("line 2"), HasSubstr("<a> is not closed")));
  EXPECT_THAT(error("<opencv_storage>\n<a>1</b>"), AllOf(HasSubstr("line 2"), HasSubstr("</b>")));
  EXPECT_THAT(error("<opencv_storage>\n<a"), AllOf(HasSubstr("line 2"), HasSubstr("ends within")));
  EXPECT_THAT(error("<opencv_storage><!-- "), HasSubstr("ends within"));
  EXPECT_THAT(error("<opencv_storage></opencv_storage>"), HasSubstr("camera_matrix"));
}

TEST(CalibrationForm, DamagedFilesAreReadOrRefusedInOneLine) {
  const std::vector<std::string> whole{
      lens_file(kFive), lens_file("0, 0, 0, 0", "distortion_model: equidistant\n"),
      "<?xml version=\"1.0\"?><!-- a --><opencv_storage><image_size>640 480</image_size><K a=\"b\"><rows>3</rows>"
      "<data>500 0 320 0 500 240 0 0 1</data></K><D><data>0 0 0 0 0</data></D></opencv_storage>",
      "# Cameras\n1 OPENCV 640 480 500 500 320 240 -0.1 0.02 0 0\n2 FOV 640 480 500 500 320 240 0.9\n"};
  const std::string pieces = "<>/!?-#:[]{}\"', \n\t.0e9n&*%\xEF\xFF";
  const tests::TemporaryFolder folder;
  std::mt19937 random(5);
  const auto below = [&](std::size_t n) { return static_cast<std::size_t>(random()) % n; };
  int refused = 0;
  constexpr int kTries = 1200;
  for (int i = 0; i < kTries; ++i) {
    std::string text = whole[below(whole.size())];
    for (std::size_t changes = 1 + below(4); changes > 0; --changes)
      text[below(text.size())] = pieces[below(pieces.size())];
    if (below(4) == 0) text.resize(1 + below(text.size()));
    std::filesystem::remove(folder / "camera");  // to replace a file that is there, ext4 waits for the disk
    base::write_file(folder / "camera", text);
    try {
      EXPECT_GT(read_calibration(folder / "camera").camera.width(), 0);
    } catch (const InputError& e) {
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos) << e.what();
      ++refused;
    }
  }
  EXPECT_GT(refused, kTries / 4);
  EXPECT_LT(refused, kTries);
}

TEST(CalibrationForm, IsToldByContent) {
  EXPECT_EQ(detect_calibration_format("# Kalibr's\n\ncam0:\n  camera_model: pinhole\n"), CalibrationFormat::kKalibr);
  EXPECT_EQ(detect_calibration_format("{\"cam0\": {camera_model: pinhole}}"), CalibrationFormat::kKalibr);
  EXPECT_EQ(detect_calibration_format("%YAML:1.0\nK: [1]\n"), CalibrationFormat::kOpenCv);
  EXPECT_EQ(detect_calibration_format("camera_name: cam0\nK: [1]\n"), CalibrationFormat::kOpenCv);
  EXPECT_EQ(detect_calibration_format("\xEF\xBB\xBF<?xml version=\"1.0\"?>"), CalibrationFormat::kOpenCv);
  EXPECT_EQ(detect_calibration_format("# Camera list\n1 PINHOLE 640 480 1 1 1 1\n"), CalibrationFormat::kColmap);
  EXPECT_EQ(detect_calibration_format("Pinhole 525 526 320 240 0\n640 480\n"), CalibrationFormat::kDso);
  EXPECT_EQ(detect_calibration_format("1 2 3 4 0\r\n640 480\r\n"), CalibrationFormat::kDso);
  EXPECT_EQ(detect_calibration_format("1 nan 3 4 0\n640 480\n"), CalibrationFormat::kDso);
  for (const char* text : {"", "\n\n", "# nothing\n", "hello", "\x89PNG\r\n\x1a\n", "- a\n- b\n"})
    EXPECT_EQ(detect_calibration_format(text), std::nullopt) << text;
}

}  // namespace
}  // namespace tileflight::imaging::opencv_file_test
