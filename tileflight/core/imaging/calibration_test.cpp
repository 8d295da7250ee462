#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tests/test_data.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/camera.h"

namespace tileflight::imaging::calibration_test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

struct Parameters {
  std::vector<double> values;
  void operator()(const PinholeRadtan& m) { values = {0, m.fx, m.fy, m.cx, m.cy, m.d[0], m.d[1], m.d[2], m.d[3]}; }
  void operator()(const KannalaBrandt& m) { values = {1, m.fx, m.fy, m.cx, m.cy, m.k[0], m.k[1], m.k[2], m.k[3]}; }
  void operator()(const FovModel& m) { values = {2, m.fx, m.fy, m.cx, m.cy, m.w}; }
  void operator()(const DoubleSphere& m) { values = {3, m.fx, m.fy, m.cx, m.cy, m.xi, m.alpha}; }
  void operator()(const UnifiedModel& m) { values = {4, m.fx, m.fy, m.cx, m.cy, m.xi, m.d[0], m.d[1], m.d[2], m.d[3]}; }
  void operator()(const PinholeRational& m) {
    values = {6, m.fx, m.fy, m.cx, m.cy};
    values.insert(values.end(), m.d.begin(), m.d.end());
  }
  void operator()(const Equirectangular& m) { values = {7, m.fx, m.fy, m.cx, m.cy}; }
  void operator()(const ExtendedUnifiedModel& m) { values = {5, m.fx, m.fy, m.cx, m.cy, m.alpha, m.beta}; }
};

std::vector<double> parameters(const Camera& camera) {
  Parameters parameters;
  std::visit([&](const auto& m) { parameters(m); }, camera.model());
  return parameters.values;
}

std::vector<Camera> cameras() {
  return {{PinholeRadtan{458.654, 457.296, 367.215, 248.375, {}}, 752, 480},
          {PinholeRadtan{458.654, 457.296, 367.215, 248.375, {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05}},
           752, 480},
          {KannalaBrandt{
               190.97847715, 190.97330798, 254.93170605, 256.89744203, {0.00348238, 0.00071503, -0.00205323, 0.0002}},
           512, 512},
          {FovModel{342.1, 321.9, 315.25, 238.125, 0.897966326944875}, 640, 480}};
}

/// Lens models that DSO's format does not support.
std::vector<Camera> sphere_cameras() {
  return {{DoubleSphere{158.28600034966977, 158.2743455478755, 254.96116578191653, 256.8894394501779,
                        -0.17213086034353243, 0.5931177593944744},
           512, 512},
          {PinholeRational{
               570.5, 572.25, 640.5, 362.25, {8.1, 3.2, 2e-4, -3e-4, 0.14, 8.4, 5.6, 0.78, 1e-3, -2e-3, 3e-3, -4e-3}},
           1280, 720},
          make_panorama(1920, 960),
          {UnifiedModel{1167.1, 1163.8, 360.9, 238.4, 1.9, {-0.26, 0.07, 1e-4, -2e-4}}, 720, 480},
          {ExtendedUnifiedModel{460.76484651566468, 459.4051018049483, 365.8937161309615, 249.33499869752445,
                                0.5903365915227143, 1.127468196965374},
           752, 480}};
}

std::string read_error(const std::string& extension, const std::string& content) {
  tests::TemporaryFolder folder;
  const auto file = folder / ("camera" + extension);
  base::write_file(file, content);
  const std::string line = tests::refusal_of([&] { read_calibration(file); });
  EXPECT_THAT(line, HasSubstr("camera" + extension)) << content;
  return line;
}

TEST(Kalibr, RoundTripKeepsEveryBit) {
  tests::TemporaryFolder folder;
  std::vector<Camera> all = cameras();
  for (const Camera& camera : sphere_cameras()) all.push_back(camera);
  for (const Camera& camera : all) {
    Calibration calibration;
    calibration.camera = camera;
    calibration.T_cam_imu = geometry::SE3(geometry::so3_exp({0.1, -0.2, 1.5}), {0.01, 0.02, -0.03});
    calibration.line_delay_s = 2.5e-5;
    write_kalibr(folder / "camera.yaml", calibration);
    const Calibration back = read_calibration(folder / "camera.yaml");
    EXPECT_EQ(parameters(back.camera), parameters(camera));
    EXPECT_EQ(back.camera.width(), camera.width());
    EXPECT_EQ(back.camera.height(), camera.height());
    EXPECT_EQ(back.line_delay_s, calibration.line_delay_s);
    EXPECT_TRUE(back.T_cam_imu.matrix().isApprox(calibration.T_cam_imu.matrix(), 1e-14));
  }
}

TEST(Kalibr, ASensorMayBeReadUpwards) {
  tests::TemporaryFolder folder;
  Calibration calibration;
  calibration.camera = cameras().front();
  calibration.line_delay_s = -2.5e-5;
  write_kalibr(folder / "camera.yaml", calibration);
  EXPECT_EQ(read_calibration(folder / "camera.yaml").line_delay_s, -2.5e-5);
}

TEST(Kalibr, FileAsKalibrWritesIt) {
  tests::TemporaryFolder folder;
  base::write_file(folder / "camchain.yaml", R"(cam0:
  T_cam_imu:
  - [0.0148655429818, -0.999880929698, 0.00414029679422, -0.0216401454975]
  - [0.999557249008, 0.0149672133247, 0.025715529948, -0.064676986768]
  - [-0.0257744366974, 0.00375618835797, 0.999660727178, 0.00981073058949]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]
  distortion_model: radtan
  intrinsics: [458.654, 457.296, 367.215, 248.375]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
  timeshift_cam_imu: 0.001
cam1:
  camera_model: omni
)");
  const Calibration calibration = read_kalibr(folder / "camchain.yaml");
  EXPECT_EQ(parameters(calibration.camera), parameters(cameras()[1]));
  EXPECT_NEAR(calibration.T_cam_imu.translation.y(), -0.064676986768, 1e-15);
  EXPECT_NEAR(calibration.T_cam_imu.rotation.toRotationMatrix()(0, 1), -0.999880929698, 1e-9);
  EXPECT_EQ(calibration.line_delay_s, 0.0);
  EXPECT_THAT(calibration.notes, testing::ElementsAre(testing::HasSubstr("give --imu-time-offset -0.001")));
}

TEST(Kalibr, AKeyThatIsThereTwiceAndAnImuFarAwayAreRefused) {
  tests::TemporaryFolder folder;
  const std::string lens =
      "cam0:\n  camera_model: pinhole\n  intrinsics: [500, 500, 320, 240]\n  resolution: [640, 480]\n"
      "  distortion_model: none\n";
  const auto refusal = [&](const std::string& more) {
    base::write_file(folder / "camera.yaml", lens + more);
    return tests::refusal_of([&] { read_kalibr(folder / "camera.yaml"); });
  };
  EXPECT_THAT(refusal("  intrinsics: [300, 300, 320, 240]\n"),
              testing::HasSubstr("camera.yaml:6: 'intrinsics' is there twice, first in line 3"));
  EXPECT_THAT(refusal("  T_cam_imu: [[1, 0, 0, 100], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n"),
              testing::HasSubstr("100.0 m from the IMU, too far for one body"));
}

TEST(Kalibr, NoDistortion) {
  tests::TemporaryFolder folder;
  const std::string lens =
      "cam0:\n  camera_model: pinhole\n  intrinsics: [500, 500, 320, 240]\n  resolution: [640, 480]\n";
  for (const std::string tail : {"  distortion_model: none\n  distortion_coeffs: []\n", "  distortion_model: none\n"}) {
    base::write_file(folder / "camera.yaml", lens + tail);
    EXPECT_EQ(parameters(read_kalibr(folder / "camera.yaml").camera),
              (std::vector<double>{0, 500, 500, 320, 240, 0, 0, 0, 0}));
  }
}

TEST(Kalibr, LensesWithSpheresHaveTheirNumbersFirst) {
  tests::TemporaryFolder folder;
  const auto read = [&](const std::string& lines) {
    base::write_file(folder / "camera.yaml", "cam0:\n" + lines + "  resolution: [640, 480]\n");
    return parameters(read_kalibr(folder / "camera.yaml").camera);
  };
  EXPECT_EQ(read("  camera_model: ds\n  intrinsics: [-0.2, 0.6, 500, 501, 320, 240]\n  distortion_model: none\n"),
            (std::vector<double>{3, 500, 501, 320, 240, -0.2, 0.6}));
  EXPECT_EQ(read("  camera_model: ds\n  intrinsics: [-0.2, 0.6, 500, 501, 320, 240]\n"),
            (std::vector<double>{3, 500, 501, 320, 240, -0.2, 0.6}));
  EXPECT_EQ(read("  camera_model: eucm\n  intrinsics: [0.6, 1.1, 500, 501, 320, 240]\n  distortion_model: none\n"
                 "  distortion_coeffs: []\n"),
            (std::vector<double>{5, 500, 501, 320, 240, 0.6, 1.1}));
  EXPECT_EQ(read("  camera_model: omni\n  intrinsics: [1.5, 900, 901, 320, 240]\n  distortion_model: radtan\n"
                 "  distortion_coeffs: [-0.2, 0.1, 0.001, 0.002]\n"),
            (std::vector<double>{4, 900, 901, 320, 240, 1.5, -0.2, 0.1, 0.001, 0.002}));
  EXPECT_EQ(read("  camera_model: omni\n  intrinsics: [1.5, 900, 901, 320, 240]\n  distortion_model: none\n"),
            (std::vector<double>{4, 900, 901, 320, 240, 1.5, 0, 0, 0, 0}));
}

TEST(Kalibr, BadFilesAreOneClearLine) {
  const auto file = [](const std::string& model, const std::string& intrinsics, const std::string& distortion,
                       const std::string& coefficients, const std::string& resolution, const std::string& more = "") {
    return "cam0:\n  camera_model: " + model + "\n  intrinsics: " + intrinsics + "\n  distortion_model: " + distortion +
           "\n  distortion_coeffs: " + coefficients + "\n  resolution: " + resolution + "\n" + more;
  };
  const std::string k = "[500, 500, 320, 240]";
  const std::string d = "[0, 0, 0, 0]";
  const std::string size = "[640, 480]";
  EXPECT_THAT(read_error(".yaml", file("spherical", k, "radtan", d, size)), HasSubstr("\"spherical\""));
  EXPECT_THAT(read_error(".yaml", file("omni", k, "radtan", d, size)), HasSubstr("5 numbers, not 4"));
  EXPECT_THAT(read_error(".yaml", file("ds", k, "none", "[]", size)), HasSubstr("6 numbers, not 4"));
  EXPECT_THAT(read_error(".yaml", file("ds", "[1]", "none", "[]", size)), HasSubstr("6 numbers, not 1"));
  EXPECT_THAT(read_error(".yaml", file("ds", "[0, 0.5, 500, 500, 320, 240]", "radtan", d, size)),
              AllOf(HasSubstr("\"ds\""), HasSubstr("use none")));
  EXPECT_THAT(read_error(".yaml", file("omni", "[1, 500, 500, 320, 240]", "equidistant", d, size)),
              AllOf(HasSubstr("\"omni\""), HasSubstr("use radtan or none")));
  EXPECT_THAT(read_error(".yaml", file("omni", "[-1, 500, 500, 320, 240]", "radtan", d, size)), HasSubstr("xi"));
  EXPECT_THAT(read_error(".yaml", file("omni", "[.nan, 500, 500, 320, 240]", "radtan", d, size)), HasSubstr("finite"));
  EXPECT_THAT(read_error(".yaml", file("ds", "[0, 1.5, 500, 500, 320, 240]", "none", "[]", size)), HasSubstr("alpha"));
  EXPECT_THAT(read_error(".yaml", file("ds", "[-1, 0.5, 500, 500, 320, 240]", "none", "[]", size)), HasSubstr("xi"));
  EXPECT_THAT(read_error(".yaml", file("eucm", "[0.5, 0, 500, 500, 320, 240]", "none", "[]", size)), HasSubstr("beta"));
  EXPECT_THAT(read_error(".yaml", file("pinhole", k, "equi8", d, size)), HasSubstr("\"equi8\""));
  EXPECT_THAT(read_error(".yaml", file("pinhole", "[500, 500, 320]", "radtan", d, size)),
              HasSubstr("4 numbers, not 3"));
  EXPECT_THAT(read_error(".yaml", file("pinhole", "500", "radtan", d, size)), HasSubstr("intrinsics"));
  EXPECT_THAT(read_error(".yaml", file("pinhole", "[500, .nan, 320, 240]", "radtan", d, size)), HasSubstr("finite"));
  EXPECT_THAT(read_error(".yaml", file("pinhole", "[500, x, 320, 240]", "radtan", d, size)), HasSubstr("intrinsics"));
  EXPECT_THAT(read_error(".yaml", file("pinhole", "[-500, 500, 320, 240]", "radtan", d, size)), HasSubstr("focal"));
  EXPECT_THAT(read_error(".yaml", file("pinhole", k, "radtan", "[0, 0]", size)), HasSubstr("4 numbers, not 2"));
  EXPECT_THAT(read_error(".yaml", file("pinhole", k, "radtan", "[0, 0, .inf, 0]", size)), HasSubstr("finite"));
  EXPECT_THAT(read_error(".yaml", file("pinhole", k, "fov", "[4]", size)), HasSubstr("pi"));
  EXPECT_THAT(read_error(".yaml", file("pinhole", k, "none", d, size)), HasSubstr("0 numbers, not 4"));
  EXPECT_THAT(read_error(".yaml", file("pinhole", k, "radtan", d, "[640, 0]")), HasSubstr("resolution"));
  EXPECT_THAT(read_error(".yaml", file("pinhole", k, "radtan", d, "[640.5, 480]")), HasSubstr("resolution"));
  EXPECT_THAT(read_error(".yaml", file("pinhole", k, "radtan", d, "[640]")), HasSubstr("resolution"));
  EXPECT_THAT(read_error(".yaml", file("pinhole", k, "radtan", d, "[1e30, 480]")), HasSubstr("resolution"));
  EXPECT_THAT(read_error(".yaml", file("pinhole", k, "radtan", d, size, "  line_delay: -1\n")),
              HasSubstr("line_delay"));
  EXPECT_THAT(read_error(".yaml", file("pinhole", k, "radtan", d, size, "  line_delay: .nan\n")),
              HasSubstr("line_delay"));
  EXPECT_THAT(read_error(".yaml", file("pinhole", k, "radtan", d, size, "  T_cam_imu: [[1, 0, 0, 0]]\n")),
              HasSubstr("T_cam_imu"));
  EXPECT_THAT(read_error(".yaml", file("pinhole", k, "radtan", d, size,
                                       "  T_cam_imu: [[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n")),
              HasSubstr("rigid"));
  EXPECT_THAT(read_error(".yaml", "cam0:\n  camera_model: pinhole\n"), HasSubstr("no key"));
  EXPECT_THAT(read_error(".yaml", "cam0: 3\n"), HasSubstr("cam0"));
  EXPECT_THAT(read_error(".yaml", ""), HasSubstr("cam0"));
  EXPECT_THAT(read_error(".yaml", "cam0: [1, 2\n b: {"), HasSubstr("YAML"));
  EXPECT_THAT(read_error(".yaml", "- a\n- b\n"), HasSubstr("cam0"));
  EXPECT_THAT(read_error(".xml", "<a/>"), HasSubstr("opencv_storage"));
}

TEST(DsoCamera, RoundTripKeepsEveryBit) {
  tests::TemporaryFolder folder;
  for (const Camera& camera : cameras()) {
    Calibration calibration;
    calibration.camera = camera;
    write_dso_camera(folder / "camera.txt", calibration);
    const Camera back = read_calibration(folder / "camera.txt").camera;
    EXPECT_EQ(parameters(back), parameters(camera));
    EXPECT_EQ(back.width(), camera.width());
    EXPECT_EQ(back.height(), camera.height());
  }
}

TEST(DsoCamera, LensesThatDsoDoesNotKnowAreRefused) {
  tests::TemporaryFolder folder;
  for (const Camera& camera : sphere_cameras()) {
    EXPECT_FALSE(has_dso_model(camera));
    EXPECT_THAT([&] { write_dso_camera(folder / "camera.txt", {.camera = camera}); },
                ThrowsMessage<InputError>(HasSubstr("DSO's camera file cannot describe this lens")));
  }
  for (const Camera& camera : cameras()) EXPECT_TRUE(has_dso_model(camera));
}

TEST(DsoCamera, PrincipalPointInTheFirstPixel) {
  tests::TemporaryFolder folder;
  Calibration calibration;
  calibration.camera = Camera(PinholeRadtan{50, 60, 0.25, -0.25, {}}, 64, 48);
  write_dso_camera(folder / "camera.txt", calibration);
  const std::vector<double> back = parameters(read_dso_camera(folder / "camera.txt").camera);
  for (std::size_t i = 0; i < back.size(); ++i) EXPECT_NEAR(back[i], parameters(calibration.camera)[i], 1e-12);
}

TEST(DsoCamera, Dialects) {
  tests::TemporaryFolder folder;
  const auto read = [&](const std::string& text) {
    base::write_file(folder / "camera.txt", text);
    return parameters(read_dso_camera(folder / "camera.txt").camera);
  };
  EXPECT_EQ(read("Pinhole 525 526 320 240 0\n640 480\nnone\n640 480\n"),
            (std::vector<double>{0, 525, 526, 320, 240, 0, 0, 0, 0}));
  // Relative: cx below 1; the image's centre (0.5 w) is at w / 2 - 0.5 if pixel centres are integers.
  EXPECT_EQ(read("FOV 0.5 0.75 0.5 0.5 0.9\n640 480\ncrop\n320 240"),
            (std::vector<double>{2, 320, 360, 319.5, 239.5, 0.9}));
  EXPECT_EQ(read("0.5 0.75 0.5 0.5 0.9\n640 480\n0.4 0.6 0.5 0.5 0\n640 480"),
            (std::vector<double>{2, 320, 360, 319.5, 239.5, 0.9}));
  EXPECT_EQ(read("525 526 320 240 0\n640 480\n"), (std::vector<double>{0, 525, 526, 320, 240, 0, 0, 0, 0}));
  EXPECT_EQ(read("RadTan 1 2 3 4 5e-1 6e-1 7e-3 8e-3\r\n640 480\r\nfull\r\n640 480\r\n"),
            (std::vector<double>{0, 1, 2, 3, 4, 0.5, 0.6, 7e-3, 8e-3}));
  EXPECT_EQ(read("1 2 3 4 .5 .6 7e-3 8e-3\n640 480"), (std::vector<double>{0, 1, 2, 3, 4, 0.5, 0.6, 7e-3, 8e-3}));
  EXPECT_EQ(read("EquiDistant 1 2 3 4 5 6 7 8\n640 480"), (std::vector<double>{1, 1, 2, 3, 4, 5, 6, 7, 8}));
  EXPECT_EQ(read("KannalaBrandt 1 2 3 4 5 6 7 8\n640 480"), (std::vector<double>{1, 1, 2, 3, 4, 5, 6, 7, 8}));
}

TEST(DsoCamera, BadFilesAreOneClearLine) {
  EXPECT_THAT(read_error(".txt", "Omni 1 2 3 4 5\n640 480\n"), AllOf(HasSubstr("\"Omni\""), HasSubstr("line 1")));
  EXPECT_THAT(read_error(".txt", "Pinhole 1 2 3 4\n640 480\n"), HasSubstr("5 numbers, not 4"));
  EXPECT_THAT(read_error(".txt", "Pinhole 1 2 3 4 5\n640 480\n"), HasSubstr("must be 0"));
  EXPECT_THAT(read_error(".txt", "RadTan 1 2 3 4 5\n640 480\n"), HasSubstr("8 numbers, not 5"));
  EXPECT_THAT(read_error(".txt", "1 2 3\n640 480\n"), HasSubstr("numbers"));
  EXPECT_THAT(read_error(".txt", "Pinhole 1 2 x 4 0\n640 480\n"), HasSubstr("\"x\""));
  EXPECT_THAT(read_error(".txt", "Pinhole nan 2 3 4 0\n640 480\n"), HasSubstr("finite"));
  EXPECT_THAT(read_error(".txt", "nan 2 3 4 0\n640 480\n"), HasSubstr("finite"));
  EXPECT_THAT(read_error(".txt", "Pinhole 0 2 3 4 0\n640 480\n"), HasSubstr("focal"));
  EXPECT_THAT(read_error(".txt", "Pinhole 1 2 3 4 0\n640 -1\n"), AllOf(HasSubstr("line 2"), HasSubstr("width")));
  EXPECT_THAT(read_error(".txt", "Pinhole 1 2 3 4 0\n640 480\nshrink\n"),
              AllOf(HasSubstr("line 3"), HasSubstr("crop")));
  EXPECT_THAT(read_error(".txt", "Pinhole 1 2 3 4 0\n640 480\ncrop\n640\n"), HasSubstr("line 4"));
  EXPECT_THAT(read_error(".txt", "Pinhole 1 2 3 4 0\n"), HasSubstr("image size"));
  EXPECT_THAT(read_error(".txt", ""), HasSubstr("DSO's camera.txt"));
}

TEST(DsoCamera, SevenScenes) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "sequences/seven_scenes_500");
  EXPECT_EQ(parameters(read_dso_camera(folder / "camera.txt").camera),
            parameters(read_kalibr(folder / "camera.yaml").camera));
}

}  // namespace
}  // namespace tileflight::imaging::calibration_test
