#include "tileflight/tiles/demo_place/bake_charts.h"

#include <gtest/gtest.h>

namespace tileflight::demo_place::sun_test {
namespace {

Color grey(const Texel&) { return Color(0.5F, 0.5F, 0.5F); }

/// A floor 40 m x 40 m with a wall 10 m high along x = 0, the sun at 45 degrees over the side of negative x.
std::vector<Chart> floor_and_wall() {
  std::vector<Chart> charts = make_box({0, -20, 0}, {1, 20, 10}, grey, grey);
  charts.push_back(make_panel({-20, -20, 0}, {40, 0, 0}, {0, 40, 0}, grey));
  return charts;
}

TEST(Sunlight, TheShadowOfAWallEndsWhereGeometrySays) {
  const std::vector<Chart> charts = floor_and_wall();
  const Sunlight sun({-1, 0, 1}, charts, 0.1);
  const Vec3 up = Vec3::UnitZ();
  const float lit = sun.light_factor({-5, 0, 0}, up), shaded = sun.light_factor({5, 0, 0}, up);
  EXPECT_GT(lit, 1.4F * shaded);
  EXPECT_FLOAT_EQ(sun.light_factor({12.0, 3, 0}, up), lit);  // the roof's far edge (x = 1, z = 10) shades up to x = 11
  EXPECT_FLOAT_EQ(sun.light_factor({10.3, 3, 0}, up), shaded);
  EXPECT_FLOAT_EQ(sun.light_factor({1, 0, 5}, Vec3::UnitX()),
                  sun.light_factor({1, 4, 8}, Vec3::UnitX()));  // the lee side
}

TEST(Sunlight, SurfacesDoNotShadeThemselves) {
  const std::vector<Chart> charts = floor_and_wall();
  const Sunlight sun({-1, 0.2, 0.7}, charts, 0.2);
  const float wall = sun.light_factor({0, 0, 5}, -Vec3::UnitX());
  for (double y = -15; y < 15; y += 0.37) EXPECT_FLOAT_EQ(sun.light_factor({0, y, 6 + 0.1 * y}, -Vec3::UnitX()), wall);
  const float floor = sun.light_factor({-9, 0, 0}, Vec3::UnitZ());
  for (double x = -18; x < -2; x += 0.31) EXPECT_FLOAT_EQ(sun.light_factor({x, x / 2, 0}, Vec3::UnitZ()), floor);
}

}  // namespace
}  // namespace tileflight::demo_place::sun_test
