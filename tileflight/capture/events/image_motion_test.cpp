// The motion of what a camera sees, against projections of all its pixels.
#include "tileflight/capture/events/image_motion.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tileflight/capture/render/test_scenes.h"

namespace tileflight::events::image_motion_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
namespace shapes = render::test_scenes;

SE3 moved(const SE3& T, const Vec3& by_m, const Vec3& turn_rad) {
  return {T.rotation * Eigen::Quaterniond(geometry::so3_exp(turn_rad)), T.translation + by_m};
}

/// The largest motion of all pixels, by projecting what each sees.
double brute_force_px(const imaging::Camera& camera, const SeenSurface& seen, const SE3& from, const SE3& to) {
  double largest = 0.0;
  for (int y = 0; y < camera.height(); ++y) {
    for (int x = 0; x < camera.width(); ++x) {
      const auto ray = camera.unproject(geometry::Vec2(x, y));
      if (!ray || std::isnan(seen.range_m(x, y))) continue;
      const bool is_sky = std::isinf(seen.range_m(x, y));
      const Vec3 in_other = is_sky ? Vec3(to.rotation.conjugate() * (from.rotation * *ray))
                                   : Vec3(to.rotation.conjugate() *
                                          (from * (static_cast<double>(seen.range_m(x, y)) * *ray) - to.translation));
      const auto pixel = camera.project(in_other);
      if (pixel) largest = std::max(largest, (*pixel - geometry::Vec2(x, y)).norm());
    }
  }
  return largest;
}

TEST(ImageMotion, IsThatOfTheNearestThingsForAnyLens) {
  const auto image = shapes::texture(8, 8, [](int, int) { return shapes::grey(90); });
  const scene::Scene scene({shapes::hills(Vec3::Zero(), 60.0, 40, image), shapes::ground(Vec3(1, 2, 8), 3.0, image)});
  const SE3 from = shapes::looking_along(Vec3(0, -20, 14), Vec3(0, 1, -0.5));
  for (const imaging::Camera& camera : {imaging::make_pinhole(120, 90, 90.0), imaging::make_fisheye(120, 90, 170.0)}) {
    const render::CameraRenderer renderer(scene, camera, {.depth = false});
    SeenSurface seen(camera.width(), camera.height());
    renderer.visit_surface(std::span(&from, 1), seen.visitor(scene));
    const ImageMotion motion(camera);
    const std::vector<ImageMotion::Point> points = motion.nearest_points(seen);
    for (const Vec3& by_m : {Vec3(0.1, 0, 0), Vec3(0, 0.1, 0), Vec3(0.02, -0.03, 0.05), Vec3(0, 0, 0)}) {
      for (const Vec3& turn : {Vec3(0, 0, 0), Vec3(0.003, 0, 0), Vec3(0, -0.002, 0.01)}) {
        const SE3 to = moved(from, by_m, turn);
        const double exact = brute_force_px(camera, seen, from, to);
        const double found = ImageMotion::largest_px(points, {from}, {to});
        EXPECT_LE(found, 1.03 * exact + 1e-6);
        EXPECT_GE(found, 0.9 * exact - 1e-6);
      }
    }
  }
}

TEST(ImageMotion, ThingsThatMoveAreHeeded) {
  const auto image = shapes::texture(8, 8, [](int, int) { return shapes::grey(90); });
  const auto frame = scene::SceneFrame(Vec3::Zero());
  const auto place =
      std::make_shared<const scene::ScenePart>(std::vector{shapes::ground(Vec3::Zero(), 200.0, image)}, frame);
  const auto thing =
      std::make_shared<const scene::ScenePart>(std::vector{shapes::ground(Vec3::Zero(), 2.0, image)}, frame);
  const auto at = [&](double x_m) {
    return scene::Scene(
        {place},
        {scene::PlacedPart{"car", thing, {scene::placed_at(SE3(Eigen::Quaterniond::Identity(), Vec3(x_m, 0, 10)))}}});
  };
  const scene::Scene first = at(0.0), second = at(0.1);
  const imaging::Camera camera = imaging::make_pinhole(121, 91, 60.0);
  const SE3 pose = shapes::looking_down(Vec3(0, 0, 20));
  const render::CameraRenderer renderer(first, camera, {.depth = false});
  SeenSurface seen(camera.width(), camera.height());
  renderer.visit_surface(std::span(&pose, 1), seen.visitor(first));
  const auto points = ImageMotion(camera).nearest_points(seen);
  const double focal_px = 60.5 / std::tan(M_PI / 6.0);
  EXPECT_NEAR(ImageMotion::largest_px(points, {pose, &first}, {pose, &second}), focal_px * 0.1 / 10.0, 0.01);
  EXPECT_NEAR(ImageMotion::largest_px(points, {pose, &first}, {pose, &first}), 0.0, 1e-9);
}

}  // namespace
}  // namespace tileflight::events::image_motion_test
