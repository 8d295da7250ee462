#include "tileflight/evaluation/localization/orthophoto.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "tileflight/capture/render/appearance.h"
#include "tileflight/evaluation/localization/test_places.h"

namespace tileflight::localization::orthophoto_test {
namespace {

using geometry::Box3;
using geometry::Vec2;
using geometry::Vec3;

constexpr double kSide_m = 51.2;  // of the ground; a texel is 0.1 m

/// Level ground at 100 m with a grey roof at 108 m over x, y from 5 to 9 m.
scene::Scene ground_with_a_roof() {
  using namespace render::test_scenes;
  return scene::Scene({ground(Vec3(0, 0, 100), kSide_m, test_places::blotches(1)),
                       ground(Vec3(7, 7, 108), 4.0, texture(40, 40, [](int, int) { return grey(222); }))});
}

GroundImage orthophoto_of(const scene::Scene& scene, const Box3& box, const OrthophotoOptions& options = {}) {
  return build_orthophoto(scene, std::make_shared<const render::Appearance>(scene), box, options);
}

const Box3 kBox(Vec3(-20, -15, 90), Vec3(20, 15, 120));

TEST(Orthophoto, ShowsTheTextureWhereItLies) {
  const GroundImage image = orthophoto_of(ground_with_a_roof(), kBox, {.pixel_m = 0.1});
  EXPECT_NEAR(image.pixel_size, 0.1, 1e-12);
  EXPECT_EQ(image.grey.width, 400);
  EXPECT_EQ(image.grey.height, 300);
  double squares = 0.0, n = 0.0;
  for (int y = 3; y < 300; y += 7) {
    for (int x = 3; x < 400; x += 7) {
      const Vec2 p = image.position(x, y);
      if ((p - Vec2(7, 7)).cwiseAbs().maxCoeff() < 2.2) continue;  // the roof
      // Texel (i, j) lies around x = -25.6 m + (i + 0.5) 0.1 m from west to east, y from north to south.
      const double i = (p.x() + 0.5 * kSide_m) / 0.1 - 0.5, j = (0.5 * kSide_m - p.y()) / 0.1 - 0.5;
      const double expected = static_cast<int>(test_places::blotches_at(std::lround(i), std::lround(j), 1));
      squares += std::pow(image.grey(x, y) - expected, 2), n += 1.0;
    }
  }
  EXPECT_LT(std::sqrt(squares / n), 6.0);
  EXPECT_EQ(image.grey(270, 80), 222);  // the roof hides the ground
}

TEST(Orthophoto, HeightsAreThoseOfWhatIsSeen) {
  const GroundImage image = orthophoto_of(ground_with_a_roof(), kBox, {.pixel_m = 0.1});
  EXPECT_NEAR(image.height_at(Vec2(0, 0)).value(), 100.0, 0.02);
  EXPECT_NEAR(image.height_at(Vec2(7, 7)).value(), 108.0, 0.02);
}

TEST(Orthophoto, ThePixelIsNoFinerThanTheTexturesAndAsManyAsAllowed) {
  const scene::Scene scene = ground_with_a_roof();
  EXPECT_NEAR(median_texel_size_m(scene, Box3(Vec3(-30, -30, 0), Vec3(30, 30, 200))).value(), 0.1, 1e-6);
  EXPECT_NEAR(orthophoto_of(scene, Box3(Vec3(-30, -30, 90), Vec3(30, 30, 120)), {.pixel_m = 0.01}).pixel_size, 0.05,
              1e-6);
  EXPECT_NEAR(orthophoto_of(scene, kBox, {.max_pixels = 1200.0}).pixel_size, 1.0, 1e-9);
}

TEST(Orthophoto, BesideThePlaceNothingIsSeen) {
  const GroundImage image = orthophoto_of(ground_with_a_roof(), Box3(Vec3(20, -5, 90), Vec3(40, 5, 120)));
  EXPECT_EQ(image.seen(20, 50), 255);
  EXPECT_EQ(image.seen(image.seen.width - 5, 50), 0);
  EXPECT_FALSE(image.height_at(Vec2(38, 0)));
}

TEST(Orthophoto, ThreadsDoNotMatter) {
  const scene::Scene scene = ground_with_a_roof();
  const auto run = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return orthophoto_of(scene, kBox, {.pixel_m = 0.2});
  };
  const GroundImage one = run(1), four = run(4);
  EXPECT_EQ(one.grey.pixels, four.grey.pixels);
  EXPECT_EQ(one.height.pixels, four.height.pixels);
}

}  // namespace
}  // namespace tileflight::localization::orthophoto_test
