#include "tileflight/evaluation/localization/height_model.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tileflight::localization::height_model_test {
namespace {

using geometry::Vec2;
using geometry::Vec3;

/// `side` x `side` points over the unit square, heights by a function.
template <typename Height>
std::vector<Vec3> points_over_square(int side, const Height& height) {
  std::vector<Vec3> points;
  for (int j = 0; j < side; ++j) {
    for (int i = 0; i < side; ++i) {
      const double x = (i + 0.5) / side, y = (j + 0.5) / side;
      points.emplace_back(x, y, height(x, y));
    }
  }
  return points;
}

TEST(HeightModel, IsThePlaneThatThePointsLieOn) {
  const auto plane = [](double x, double y) { return 2.0 + 0.3 * x - 0.2 * y; };
  const HeightModel model(points_over_square(60, plane), Vec2(0, 0), Vec2(1, 1));
  for (const Vec2& p : {Vec2(0.5, 0.5), Vec2(0.2, 0.7), Vec2(0.83, 0.11)}) {
    EXPECT_NEAR(model.at(p), plane(p.x(), p.y()), 0.3 * model.cell());
    EXPECT_TRUE(model.is_supported(p));
  }
  EXPECT_FALSE(model.is_supported(Vec2(1.2, 0.5)));
}

TEST(HeightModel, OutliersDoNotMoveIt) {
  std::vector<Vec3> points = points_over_square(60, [](double, double) { return 1.0; });
  for (std::size_t k = 0; k < points.size(); k += 7) points[k].z() = 50.0;
  const HeightModel model(points, Vec2(0, 0), Vec2(1, 1));
  for (const Vec2& p : {Vec2(0.5, 0.5), Vec2(0.2, 0.7), Vec2(0.83, 0.11)}) EXPECT_NEAR(model.at(p), 1.0, 1e-6);
}

TEST(HeightModel, AHoleIsFilledFromAroundAndNotSupported) {
  std::vector<Vec3> points = points_over_square(80, [](double x, double) { return x < 0.5 ? 1.0 : 2.0; });
  std::erase_if(points, [](const Vec3& p) { return (p.head<2>() - Vec2(0.25, 0.5)).norm() < 0.2; });
  const HeightModel model(points, Vec2(0, 0), Vec2(1, 1));
  EXPECT_NEAR(model.at(Vec2(0.25, 0.5)), 1.0, 0.5);
  EXPECT_FALSE(model.is_supported(Vec2(0.25, 0.5)));
  EXPECT_NEAR(model.at(Vec2(0.9, 0.5)), 2.0, 1e-6);
}

TEST(HeightModel, WithoutPointsItIsLevelAndSupportedNowhere) {
  const HeightModel model({}, Vec2(0, 0), Vec2(1, 1));
  EXPECT_EQ(model.at(Vec2(0.5, 0.5)), 0.0);
  EXPECT_FALSE(model.is_supported(Vec2(0.5, 0.5)));
  const HeightModel one({Vec3(0.3, 0.3, 4.0)}, Vec2(0, 0), Vec2(1, 1));
  EXPECT_EQ(one.at(Vec2(0.9, 0.9)), 4.0);
}

}  // namespace
}  // namespace tileflight::localization::height_model_test
