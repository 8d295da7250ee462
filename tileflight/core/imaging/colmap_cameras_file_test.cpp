#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/imaging/calibration_files.h"

namespace tileflight::imaging::colmap_cameras_file_test {
namespace {

using geometry::Vec2;
using geometry::Vec3;
using testing::AllOf;
using testing::HasSubstr;

const std::string kHead =
    "# Camera list with one line of data per camera:\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n"
    "# Number of cameras: 1\n";

Camera read(const std::string& content, std::optional<std::int64_t> camera_id = {}) {
  const tests::TemporaryFolder folder;
  base::write_file(folder / "cameras.dat", content);
  return camera_id ? read_colmap_cameras(folder / "cameras.dat", camera_id).camera
                   : read_calibration(folder / "cameras.dat").camera;
}

std::string error(const std::string& content, std::optional<std::int64_t> camera_id = {}) {
  const std::string line = tests::refusal_of([&] { read(content, camera_id); });
  EXPECT_THAT(line, HasSubstr("cameras.dat")) << content;
  return line;
}

/// With COLMAP's pixel centres at half-integers, u = f x + c is half a pixel more than here.
void expect_pixels(const std::string& lens, double fx, double fy, const std::function<Vec2(double, double)>& distort) {
  const Camera camera = read(kHead + "1 " + lens + "\n");
  EXPECT_EQ(camera.width(), 640);
  EXPECT_EQ(camera.height(), 480);
  for (const Vec3& point : {Vec3(0.1, 0.2, 1), Vec3(-0.4, 0.3, 1.2), Vec3(0.5, -0.4, 1), Vec3(-0.3, -0.35, 0.9)}) {
    const Vec2 at = distort(point.x() / point.z(), point.y() / point.z());
    const auto pixel = camera.project(point);
    ASSERT_TRUE(pixel) << lens;
    EXPECT_LT((*pixel + Vec2(0.5, 0.5) - Vec2(fx * at.x() + 320.25, fy * at.y() + 240.5)).norm(), 1e-9) << lens;
  }
}

/// Along the radius: r(theta) in place of tan(theta).
std::function<Vec2(double, double)> radial(const std::function<double(double)>& r_of_theta) {
  return [=](double x, double y) {
    const double r = std::hypot(x, y);
    return Vec2(Vec2(x, y) * (r_of_theta(std::atan(r)) / r));
  };
}

TEST(ColmapCameras, EachModelProjectsAsColmapDocumentsIt) {
  const auto plain = [](double x, double y) { return Vec2(x, y); };
  expect_pixels("SIMPLE_PINHOLE 640 480 500.5 320.25 240.5", 500.5, 500.5, plain);
  expect_pixels("PINHOLE 640 480 500.5 498 320.25 240.5", 500.5, 498, plain);
  const auto brown = [](double k1, double k2, double p1, double p2) {
    return [=](double x, double y) {
      const double r2 = x * x + y * y, k = k1 * r2 + k2 * r2 * r2;
      return Vec2(x + x * k + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
                  y + y * k + 2 * p2 * x * y + p1 * (r2 + 2 * y * y));
    };
  };
  expect_pixels("SIMPLE_RADIAL 640 480 500.5 320.25 240.5 -0.12", 500.5, 500.5, brown(-0.12, 0, 0, 0));
  expect_pixels("RADIAL 640 480 500.5 320.25 240.5 -0.12 0.03", 500.5, 500.5, brown(-0.12, 0.03, 0, 0));
  expect_pixels("OPENCV 640 480 500.5 498 320.25 240.5 -0.12 0.03 0.001 -0.002", 500.5, 498,
                brown(-0.12, 0.03, 0.001, -0.002));
  expect_pixels("FULL_OPENCV 640 480 500.5 498 320.25 240.5 -0.12 0.03 0.001 -0.002 0 0 0 0", 500.5, 498,
                brown(-0.12, 0.03, 0.001, -0.002));
  expect_pixels("FULL_OPENCV 640 480 500.5 498 320.25 240.5 -0.12 0.03 0.001 -0.002 0.01 0.2 0.05 0.02", 500.5, 498,
                [](double x, double y) {
                  const double r2 = x * x + y * y, r4 = r2 * r2, r6 = r4 * r2;
                  const double k = (1 - 0.12 * r2 + 0.03 * r4 + 0.01 * r6) / (1 + 0.2 * r2 + 0.05 * r4 + 0.02 * r6);
                  return Vec2(x * k + 2 * 0.001 * x * y - 0.002 * (r2 + 2 * x * x),
                              y * k + 0.001 * (r2 + 2 * y * y) - 2 * 0.002 * x * y);
                });
  const auto fisheye = [](double k1, double k2, double k3, double k4) {
    return radial([=](double t) {
      return t + k1 * std::pow(t, 3) + k2 * std::pow(t, 5) + k3 * std::pow(t, 7) + k4 * std::pow(t, 9);
    });
  };
  expect_pixels("OPENCV_FISHEYE 640 480 300 301 320.25 240.5 0.02 -0.01 0.004 -0.001", 300, 301,
                fisheye(0.02, -0.01, 0.004, -0.001));
  expect_pixels("SIMPLE_RADIAL_FISHEYE 640 480 300 320.25 240.5 0.02", 300, 300, fisheye(0.02, 0, 0, 0));
  expect_pixels("RADIAL_FISHEYE 640 480 300 320.25 240.5 0.02 -0.01", 300, 300, fisheye(0.02, -0.01, 0, 0));
  expect_pixels("FOV 640 480 300 301 320.25 240.5 0.9", 300, 301,
                radial([](double t) { return std::atan(2 * std::tan(t) * std::tan(0.45)) / 0.9; }));
}

TEST(ColmapCameras, OneOfSeveralMustBeNamed) {
  const std::string two = kHead + "3 SIMPLE_PINHOLE 640 480 500 320 240\r\n\n7 PINHOLE 800 600 600 600 400 300\r\n";
  EXPECT_EQ(read(two, 3).width(), 640);
  EXPECT_EQ(read(two, 7).width(), 800);
  EXPECT_THAT(error(two), AllOf(HasSubstr("2 cameras (3, 7)"), HasSubstr("keep only the line")));
  EXPECT_THAT(error(two, 4), HasSubstr("no camera 4, only 3, 7"));
  EXPECT_THAT(error(two + "7 PINHOLE 800 600 600 600 400 300\n", 7), HasSubstr("camera 7 twice"));
  EXPECT_THAT(error(kHead, 1), HasSubstr("has no camera"));
}

TEST(ColmapCameras, BadFilesAreOneClearLine) {
  EXPECT_THAT(error("1 NO_SUCH_FISHEYE 640 480 500 500 320 240 0 0 0 0 0 0 0 0\n"),
              AllOf(HasSubstr("line 1"), HasSubstr("\"NO_SUCH_FISHEYE\""), HasSubstr("OPENCV_FISHEYE")));
  EXPECT_THAT(error("\n1 FULL_OPENCV 640 480 500 500 320 240 0 0 0 0 0 nan 0 0\n"),
              AllOf(HasSubstr("line 2"), HasSubstr("finite")));
  EXPECT_THAT(error("1 PINHOLE 640 480 500 320 240\n"), HasSubstr("PINHOLE must have 4 parameters, not 3"));
  EXPECT_THAT(error("1 PINHOLE 640\n"), HasSubstr("CAMERA_ID MODEL WIDTH HEIGHT"));
  EXPECT_THAT(error("1 PINHOLE 640 480 500 x 320 240\n"), HasSubstr("\"x\" is not a number"));
  EXPECT_THAT(error("1 PINHOLE 640 480 500 nan 320 240\n"), HasSubstr("finite"));
  EXPECT_THAT(error("1 OPENCV 640 480 500 500 320 240 0 0 0 inf\n"), HasSubstr("finite"));
  EXPECT_THAT(error("1 PINHOLE 640 480 0 500 320 240\n"), HasSubstr("focal"));
  EXPECT_THAT(error("1 PINHOLE 0 480 500 500 320 240\n"), AllOf(HasSubstr("WIDTH"), HasSubstr("\"0\"")));
  EXPECT_THAT(error("1 PINHOLE 640 4.5 500 500 320 240\n"), HasSubstr("HEIGHT"));
  EXPECT_THAT(error("1 FOV 640 480 500 500 320 240 4\n"), HasSubstr("pi"));
  EXPECT_THAT(error("1 PINHOLE 640 480 500 500 320 240\nx PINHOLE 640 480 500 500 320 240\n"),
              AllOf(HasSubstr("line 2"), HasSubstr("CAMERA_ID")));
}

}  // namespace
}  // namespace tileflight::imaging::colmap_cameras_file_test
