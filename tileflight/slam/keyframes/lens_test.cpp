#include "tileflight/slam/keyframes/lens.h"

#include <gtest/gtest.h>

#include <random>

namespace tileflight::keyframes::lens_test {
namespace {

using geometry::Vec2;
using geometry::Vec3;
using imaging::Camera;

std::vector<Camera> lenses() {
  return {imaging::make_fisheye(1008, 566, 155.0, {-0.0416666667, 0.0005208333, -3.1001984127e-06, 1.0764577822e-08}),
          imaging::make_fisheye(640, 640, 200.0),
          imaging::make_pinhole(640, 480, 70.0),
          Camera(imaging::PinholeRadtan{458, 457, 367, 248, {-0.283, 0.0739, 0.00019, 0.0000176}}, 752, 480),
          Camera(imaging::FovModel{300, 300, 319.5, 239.5, 0.92}, 640, 480),
          Camera(imaging::DoubleSphere{158.3, 158.3, 255, 257, -0.172, 0.593}, 512, 512),
          Camera(imaging::DoubleSphere{230, 230, 399.5, 149.5, 0.4, 0.62}, 800, 300),  // beyond 180 degrees
          Camera(imaging::UnifiedModel{1167, 1164, 361, 238, 1.9, {-0.26, 0.07, 1e-3, -2e-3}}, 720, 480),
          Camera(imaging::UnifiedModel{300, 300, 399.5, 199.5, 1.0, {0.05, 0.0, 0.0, 0.0}}, 800, 400),
          Camera(imaging::UnifiedModel{250, 250, 399.5, 149.5, 0.98, {0.01, 0.0, 1e-3, 1e-3}}, 800, 300),
          Camera(imaging::ExtendedUnifiedModel{300, 300, 399.5, 99.5, 0.7, 1.3}, 800, 200),
          Camera(imaging::PinholeRational{570, 572, 640.5, 362.25, {8.1, 3.2, 0, 0, 0.14, 8.4, 5.6, 0.78}}, 1280, 720),
          Camera(imaging::PinholeRational{570, 572, 640.5, 362.25, {8.1, 3.2, 2e-4, -3e-4, 0.14, 8.4, 5.6, 0.78, 1e-3}},
                 1280, 720),
          imaging::make_panorama(800, 400)};
}

/// Directions within a camera's image, at several distances.
std::vector<Vec3> visible_points(const Camera& camera) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> u(0.0, camera.width() - 1.0), v(0.0, camera.height() - 1.0), d(0.2, 50.0);
  std::vector<Vec3> points;
  while (points.size() < 500) {
    const auto ray = camera.unproject(Vec2(u(random), v(random)));
    if (ray) points.push_back(*ray * d(random));
  }
  return points;
}

TEST(Lens, ProjectsAsTheCameraDoes) {
  for (const Camera& camera : lenses()) {
    const Lens lens(camera);
    for (const Vec3& point : visible_points(camera)) {
      Vec2 pixel;
      Eigen::Vector2f pixel_float;
      ASSERT_TRUE(lens.project<double>(point, pixel));
      ASSERT_TRUE(lens.project<float>(point.cast<float>(), pixel_float));
      EXPECT_LT((pixel - *camera.project(point)).norm(), 1e-6);
      EXPECT_LT((pixel_float.cast<double>() - pixel).norm(), 1e-3);
    }
  }
}

TEST(Lens, DerivativeIsThatOfTheCamera) {
  for (const Camera& camera : lenses()) {
    const Lens lens(camera);
    for (const Vec3& point : visible_points(camera)) {
      Vec2 pixel;
      Eigen::Matrix<double, 2, 3> ours, camera_own;
      ASSERT_TRUE(lens.project<double>(point, pixel, ours));
      ASSERT_TRUE(camera.project(point, camera_own));
      EXPECT_LT((ours - camera_own).norm(), 1e-5 * camera_own.norm());
    }
  }
}

TEST(Lens, LevelsHalveThePixelGridAboutItsCorner) {
  const Lens lens(lenses()[0]);
  for (const Vec3& point : visible_points(lenses()[0])) {
    Vec2 fine, coarse;
    ASSERT_TRUE(lens.project<double>(point, fine));
    ASSERT_TRUE(lens.at_level(3).project<double>(point, coarse));
    EXPECT_LT(((fine + Vec2(0.5, 0.5)) / 8 - Vec2(0.5, 0.5) - coarse).norm(), 1e-9);
    const auto ray = lens.at_level(3).unproject(coarse);
    ASSERT_TRUE(ray);
    EXPECT_LT((*ray - point.normalized()).norm(), 1e-7);
  }
}

TEST(Lens, RefusesWhatLiesBehind) {
  Vec2 pixel;
  EXPECT_FALSE(Lens(imaging::make_pinhole(640, 480, 70.0)).project<double>(Vec3(0, 0, -1), pixel));
  EXPECT_FALSE(Lens(imaging::make_fisheye(640, 640, 200.0)).project<double>(Vec3(0.1, 0, -1), pixel));
  EXPECT_TRUE(Lens(imaging::make_fisheye(640, 640, 200.0)).project<double>(Vec3(1, 0, -0.1), pixel));
}

}  // namespace
}  // namespace tileflight::keyframes::lens_test
