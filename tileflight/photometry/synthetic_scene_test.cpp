#include "tileflight/photometry/synthetic_scene.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tileflight::photometry::synthetic_scene_test {
namespace {

using geometry::Vec3;
using test_support::cosine;
using test_support::hit_distance;
using test_support::Relief;
using test_support::sine;

TEST(SyntheticScene, SineIsThatOfTheLibrary) {
  for (double x = -2000.0; x < 2000.0; x += 0.0137) {
    ASSERT_NEAR(sine(x), std::sin(x), 1.2e-9) << x;
    ASSERT_NEAR(cosine(x), std::cos(x), 1.2e-9) << x;
  }
}

Relief hills() {
  Relief relief;
  relief.height_m = [](double x, double y) { return 1.5 * sine(0.35 * x) * cosine(0.28 * y); };
  relief.highest_m = 1.5;
  return relief;
}

/// Distance at which a ray is first below the relief, by steps of a centimetre; 0: nowhere.
double first_below_m(const Relief& relief, const Vec3& origin, const Vec3& ray) {
  for (double d = 0.0; d < 200.0; d += 0.01) {
    const Vec3 p = origin + d * ray;
    if (p.z() <= relief.height_m(p.x(), p.y())) return d;
  }
  return 0.0;
}

TEST(SyntheticScene, RaysEndOnTheGroundThatTheyMeetFirst) {
  const Relief relief = hills();
  const Vec3 origin(1.0, -2.0, 12.0);
  for (double heading = 0.0; heading < 6.3; heading += 0.13) {
    for (const double down : {0.2, 0.4, 0.8, 2.0}) {
      const Vec3 ray = Vec3(std::cos(heading), std::sin(heading), -down).normalized();
      const double distance_m = hit_distance(relief, origin, ray);
      const Vec3 p = origin + distance_m * ray;
      EXPECT_NEAR(p.z(), relief.height_m(p.x(), p.y()), 1e-6);
      EXPECT_NEAR(distance_m, first_below_m(relief, origin, ray), 0.011);
    }
  }
  EXPECT_EQ(hit_distance(relief, origin, Vec3(1.0, 0.0, 0.1).normalized()), 0.0);
}

}  // namespace
}  // namespace tileflight::photometry::synthetic_scene_test
