#include "tileflight/alignment/ray_agreement.h"

#include <gtest/gtest.h>

#include "tileflight/alignment/test_flights.h"

namespace tileflight::alignment {
namespace {

using namespace test_flights;

TEST(RayAgreement, TheRightPlaceAgreesAndNothingIsBlocked) {
  const Flight flight = fly(curved_path());
  const auto rays = ray_agreement(flight.points, T_local_map(), cast);
  ASSERT_TRUE(rays);
  EXPECT_GT(rays->rays, 1500U);
  EXPECT_GT(rays->agreeing, 0.97);
  EXPECT_GT(rays->score, 0.85);
  EXPECT_LT(rays->blocked, 0.01);
}

TEST(RayAgreement, AMapThatIsTooHighFloatsAndOneThatIsTooLowIsBlocked) {
  const Flight flight = fly(curved_path());
  Sim3 high = T_local_map(), low = T_local_map();
  high.translation.z() += 4.0;
  low.translation.z() -= 4.0;
  const auto above = ray_agreement(flight.points, high, cast), below = ray_agreement(flight.points, low, cast);
  ASSERT_TRUE(above && below);
  EXPECT_GT(above->floating, 0.8);
  EXPECT_LT(above->blocked, 0.1);
  EXPECT_GT(below->blocked, 0.8);
  EXPECT_LT(below->score, -0.6);
}

TEST(RayAgreement, ShrinkingGainsNothing) {
  const Flight flight = fly(curved_path());
  const Vec3 middle = T_local_map() * flight.points.positions.front();
  const Sim3& T = T_local_map();
  const Sim3 small(0.2 * T.scale, T.rotation, middle + 0.2 * (T.translation - middle));
  const auto right = ray_agreement(flight.points, T, cast), shrunk = ray_agreement(flight.points, small, cast);
  ASSERT_TRUE(right && shrunk);
  EXPECT_LT(shrunk->score, right->score - 0.4);
}

TEST(RayAgreement, PointsBesideTheRegionsDoNotCount) {
  const Flight flight = fly(curved_path());
  const geometry::Box3 nowhere(Vec3(1000, 1000, 0), Vec3(1001, 1001, 1));
  EXPECT_FALSE(ray_agreement(flight.points, T_local_map(), cast, {.regions = {nowhere}}));
  ObservedPoints blind = flight.points;
  blind.viewpoints.clear();
  EXPECT_FALSE(ray_agreement(blind, T_local_map(), cast));
}

}  // namespace
}  // namespace tileflight::alignment
