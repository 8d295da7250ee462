#include "tileflight/core/imaging/rectify.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tileflight::imaging::rectify_test {
namespace {

using geometry::Vec3;

/// A smooth function of direction, so that every lens shows the same scene.
double brightness(const Vec3& ray) {
  return 120.0 + 50.0 * std::sin(3.0 * ray.x() + ray.z()) * std::cos(2.5 * ray.y());
}

FloatImage seen_by(const Camera& camera) {
  FloatImage image(camera.width(), camera.height());
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) {
      const auto ray = camera.unproject({x, y});
      image(x, y) = ray ? static_cast<float>(brightness(*ray)) : 0.0F;
    }
  return image;
}

TEST(Rectifier, ShowsWhatThePinholeWouldHaveSeen) {
  const Camera pinhole = make_pinhole(320, 200, 100.0);
  for (const Camera& wide :
       {make_fisheye(400, 300, 155.0), Camera(DoubleSphere{150, 150, 199.5, 149.5, 0.1, 0.6}, 400, 300),
        Camera(UnifiedModel{300, 300, 199.5, 149.5, 1.2, {-0.05, 0.0, 1e-3, 0.0}}, 400, 300)}) {
    const FloatImage expected = seen_by(pinhole), rectified = Rectifier(wide, pinhole)(seen_by(wide));
    double worst = 0.0;
    for (std::size_t i = 0; i < expected.pixels.size(); ++i)
      worst = std::max(worst, std::abs(static_cast<double>(expected.pixels[i] - rectified.pixels[i])));
    EXPECT_LT(worst, 0.05);  // of 100 grey values; bilinear over a pixel
  }
}

TEST(Rectifier, IsBlackWhereTheLensDoesNotSee) {
  const Rectifier rectify(make_pinhole(100, 80, 60.0), make_pinhole(100, 80, 120.0));
  const GrayImage wide = rectify(GrayImage(100, 80, 200));
  EXPECT_EQ(wide(0, 0), 0);
  EXPECT_EQ(wide(99, 40), 0);
  EXPECT_EQ(wide(50, 40), 200);
  EXPECT_EQ(rectify(RgbImage(100, 80, Rgb8{10, 20, 30}))(50, 40), (Rgb8{10, 20, 30}));
}

TEST(Rectifier, TheSameLensChangesNothing) {
  const Camera camera(PinholeRadtan{180, 182, 161, 118, {-0.2, 0.05, 1e-3, -1e-3}}, 320, 240);
  const FloatImage picture = seen_by(camera), same = Rectifier(camera, camera)(picture);
  for (int y = 1; y < 239; ++y)
    for (int x = 1; x < 319; ++x) EXPECT_NEAR(same(x, y), picture(x, y), 1e-3);
}

}  // namespace
}  // namespace tileflight::imaging::rectify_test
