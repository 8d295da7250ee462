#include "tileflight/slam/mapping/depth_bounds.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tileflight::mapping::depth_bounds_test {
namespace {

/// Known pixels of a slope whose inverse distance grows from row to row.
float slope(float y) { return 0.1F + 0.001F * y; }

std::vector<tracking::ReferencePoint> known_pixels() {
  std::vector<tracking::ReferencePoint> known;
  for (float y = 0.0F; y < 200.0F; y += 10.0F)
    for (float x = 0.0F; x < 300.0F; x += 10.0F) known.push_back({{x, y}, slope(y), 1.0F});
  return known;
}

keyframes::ImmaturePoint point_at(float x, float y) {
  keyframes::ImmaturePoint point;
  point.patch.pixel = {x, y};
  return point;
}

TEST(DepthBounds, HoldTheTruthAndAreNarrow) {
  std::vector<keyframes::ImmaturePoint> points{point_at(33, 47), point_at(151, 103), point_at(299, 8)};
  bound_by_neighbours(known_pixels(), points);
  for (const keyframes::ImmaturePoint& point : points) {
    const float truth = slope(point.patch.pixel.y());
    ASSERT_TRUE(point.has_depth());
    EXPECT_LT(point.rho_min, truth);
    EXPECT_GT(point.rho_max, truth);
    EXPECT_LT(point.rho_max / point.rho_min, 2.5F);
  }
}

TEST(DepthBounds, OfTooFewNeighboursAreNone) {
  std::vector<keyframes::ImmaturePoint> points{point_at(33, 47)};
  bound_by_neighbours({{{30.0F, 40.0F}, 0.1F, 1.0F}}, points);
  EXPECT_FALSE(points[0].has_depth());
  EXPECT_EQ(points[0].rho_min, 0.0F);
}

}  // namespace
}  // namespace tileflight::mapping::depth_bounds_test
