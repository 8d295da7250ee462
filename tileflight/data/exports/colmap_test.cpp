#include "tileflight/data/exports/colmap.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/calibration_files.h"

namespace tileflight::exports::colmap_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

std::vector<std::string> lines_of(const std::filesystem::path& file) {
  std::ifstream stream(file);
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);)
    if (!line.starts_with('#')) lines.push_back(line);
  return lines;
}

std::vector<double> numbers_of(const std::string& line) {
  std::istringstream stream(line);
  std::vector<double> numbers;
  for (double value = 0; stream >> value;) numbers.push_back(value);
  return numbers;
}

ColmapModel small_model(const imaging::Camera& camera) {
  ColmapModel model;
  model.camera = camera;
  model.images = {{"000000.jpg", SE3(geometry::so3_exp({0.1, -0.2, 0.3}), Vec3(1, 2, 3))},
                  {"000007.jpg", SE3(geometry::so3_exp({0.1, -0.1, 0.2}), Vec3(1.5, 2.1, 3))}};
  for (const Vec3& direction : {Vec3(0.1, 0.2, 5), Vec3(-0.5, 0.1, 6), Vec3(0, 0, 4)})
    model.points.push_back({model.images[0].T_world_camera * direction, {10, 20, 30}, {0, 1}});
  model.points.push_back({model.images[0].T_world_camera * Vec3(0, 0, -5), {1, 2, 3}, {0}});  // behind
  return model;
}

/// OpenCV's fisheye model as documented by COLMAP, implemented independently.
geometry::Vec2 colmap_fisheye(const std::vector<double>& p, const Vec3& point) {
  const double r = std::hypot(point.x(), point.y()) / point.z(), t = std::atan(r), t2 = t * t;
  const double d = t * (1 + t2 * (p[4] + t2 * (p[5] + t2 * (p[6] + t2 * p[7]))));
  const double scale = r > 0 ? d / r : 1.0;
  return {p[0] * scale * point.x() / point.z() + p[2], p[1] * scale * point.y() / point.z() + p[3]};
}

TEST(Colmap, FilesHoldTheModelInColmapsConventions) {
  const tests::TemporaryFolder folder;
  const imaging::Camera camera(imaging::KannalaBrandt{300, 301, 319.5, 239.5, {0.01, -0.02, 0.003, 0.0}}, 640, 480);
  const ColmapModel model = small_model(camera);
  write_colmap(folder.path(), model);

  const auto cameras = lines_of(folder / "cameras.txt");
  ASSERT_EQ(cameras.size(), 1U);
  EXPECT_TRUE(cameras[0].starts_with("1 OPENCV_FISHEYE 640 480 300 301 320 240 ")) << cameras[0];
  const std::vector<double> parameters = numbers_of(cameras[0].substr(std::string("1 OPENCV_FISHEYE 640 480").size()));
  ASSERT_EQ(parameters.size(), 8U);

  const auto images = lines_of(folder / "images.txt");
  const auto points = lines_of(folder / "points3D.txt");
  ASSERT_EQ(images.size(), 4U);
  ASSERT_EQ(points.size(), 4U);
  EXPECT_TRUE(images[0].ends_with(" 1 000000.jpg"));
  for (std::size_t i = 0; i < 3; ++i) {
    const std::vector<double> point = numbers_of(points[i]);  // id xyz rgb error (picture, place)...
    ASSERT_EQ(point.size(), 12U);
    EXPECT_EQ(point[7], -1);
    for (std::size_t o = 8; o < 12; o += 2) {
      const std::vector<double> pose = numbers_of(images[2 * (point[o] - 1)]);
      const std::vector<double> pixels = numbers_of(images[2 * (point[o] - 1) + 1]);
      const auto at = static_cast<std::size_t>(3 * point[o + 1]);
      EXPECT_EQ(pixels[at + 2], point[0]);
      // world to camera, by the quaternion w x y z and t that the file has
      const Vec3 X = Eigen::Quaterniond(pose[1], pose[2], pose[3], pose[4]) * Vec3(point[1], point[2], point[3]) +
                     Vec3(pose[5], pose[6], pose[7]);
      EXPECT_LT((colmap_fisheye(parameters, X) - geometry::Vec2(pixels[at], pixels[at + 1])).norm(), 1e-6);
    }
  }
  EXPECT_EQ(numbers_of(points[3]).size(), 8U) << "seen by no picture";
}

TEST(Colmap, CamerasThatAreWrittenAreReadBack) {
  const tests::TemporaryFolder folder;
  for (const imaging::CameraModel& lens :
       {imaging::CameraModel(imaging::PinholeRadtan{300.1, 302, 317.3, 241.7, {}}),
        {imaging::PinholeRadtan{300.1, 302, 317.3, 241.7, {-0.1, 0.02, 1e-3, -2e-4}}},
        {imaging::KannalaBrandt{300.1, 302, 317.3, 241.7, {0.01, -0.02, 3e-3, 4e-4}}},
        {imaging::FovModel{300.1, 302, 317.3, 241.7, 0.9}}}) {
    const imaging::Camera camera(lens, 640, 480);
    write_colmap(folder.path(), small_model(camera));
    for (const imaging::Camera& back : {imaging::read_calibration(folder / "cameras.txt").camera,
                                        imaging::read_colmap_cameras(folder / "cameras.txt", 1).camera}) {
      EXPECT_EQ(back.model().index(), camera.model().index());
      EXPECT_EQ(back.width(), 640);
      EXPECT_EQ(back.height(), 480);
      for (const Vec3& point : {Vec3(0.1, 0.2, 1), Vec3(-0.5, 0.4, 1), Vec3(0.3, -0.5, 1.1)})
        EXPECT_LT((camera.project(point).value() - back.project(point).value()).norm(), 1e-9);
    }
  }
}

TEST(Colmap, EachLensHasItsNameOrIsRefused) {
  const tests::TemporaryFolder folder;
  const auto name_of = [&](const imaging::CameraModel& lens) {
    write_colmap(folder.path(), small_model(imaging::Camera(lens, 640, 480)));
    std::istringstream line(lines_of(folder / "cameras.txt").at(0));
    std::string id, name;
    line >> id >> name;
    return name;
  };
  EXPECT_EQ(name_of(imaging::PinholeRadtan{300, 300, 319.5, 239.5, {}}), "PINHOLE");
  EXPECT_EQ(name_of(imaging::PinholeRadtan{300, 300, 319.5, 239.5, {-0.1, 0, 0, 0}}), "OPENCV");
  EXPECT_EQ(name_of(imaging::KannalaBrandt{300, 300, 319.5, 239.5, {}}), "OPENCV_FISHEYE");
  EXPECT_EQ(name_of(imaging::FovModel{300, 300, 319.5, 239.5, 0.9}), "FOV");
  EXPECT_THAT(
      [&] {
        name_of(imaging::DoubleSphere{300, 300, 319.5, 239.5, 0, 0.5});
      },
      ThrowsMessage<InputError>(HasSubstr("COLMAP has no model for this lens")));
  EXPECT_THAT(
      [&] {
        name_of(imaging::UnifiedModel{300, 300, 319.5, 239.5, 1, {}});
      },
      ThrowsMessage<InputError>(HasSubstr("COLMAP has no model for this lens")));
  EXPECT_THAT(
      [&] {
        name_of(imaging::ExtendedUnifiedModel{300, 300, 319.5, 239.5, 0.5, 1});
      },
      ThrowsMessage<InputError>(HasSubstr("COLMAP has no model for this lens")));
}

}  // namespace
}  // namespace tileflight::exports::colmap_test
