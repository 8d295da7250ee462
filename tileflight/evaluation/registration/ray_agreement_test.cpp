#include "tileflight/evaluation/registration/ray_agreement.h"

#include <gtest/gtest.h>

#include "tileflight/evaluation/registration/test_flights.h"

namespace tileflight::registration::ray_agreement_test {
namespace {

using namespace test_flights;

TEST(RayAgreement, TheRightPlaceAgreesAndNothingIsBlocked) {
  const Flight flight = simulate_map(curved_path());
  const auto rays = compute_ray_agreement(flight.points, T_local_map(), cast_ray);
  ASSERT_TRUE(rays);
  EXPECT_GT(rays->rays, 1500U);
  EXPECT_GT(rays->agreeing_share, 0.97);
  EXPECT_GT(rays->score, 0.85);
  EXPECT_LT(rays->blocked_share, 0.01);
}

TEST(RayAgreement, AMapThatIsTooHighFloatsAndOneThatIsTooLowIsBlocked) {
  const Flight flight = simulate_map(curved_path());
  Sim3 high = T_local_map(), low = T_local_map();
  high.translation.z() += 4.0;
  low.translation.z() -= 4.0;
  const auto above = compute_ray_agreement(flight.points, high, cast_ray),
             below = compute_ray_agreement(flight.points, low, cast_ray);
  ASSERT_TRUE(above && below);
  EXPECT_GT(above->floating_share, 0.8);
  EXPECT_LT(above->blocked_share, 0.1);
  EXPECT_GT(below->blocked_share, 0.8);
  EXPECT_LT(below->score, -0.6);
}

TEST(RayAgreement, ShrinkingGainsNothing) {
  const Flight flight = simulate_map(curved_path());
  const Vec3 middle = T_local_map() * flight.points.positions.front();
  const Sim3& T = T_local_map();
  const Sim3 small(0.2 * T.scale, T.rotation, middle + 0.2 * (T.translation - middle));
  const auto right = compute_ray_agreement(flight.points, T, cast_ray),
             shrunk = compute_ray_agreement(flight.points, small, cast_ray);
  ASSERT_TRUE(right && shrunk);
  EXPECT_LT(shrunk->score, right->score - 0.4);
}

TEST(RayAgreement, PointsBesideTheRegionsDoNotCount) {
  const Flight flight = simulate_map(curved_path());
  const geometry::Box3 nowhere(Vec3(1000, 1000, 0), Vec3(1001, 1001, 1));
  EXPECT_FALSE(compute_ray_agreement(flight.points, T_local_map(), cast_ray, {.regions = {nowhere}}));
  ObservedPoints blind = flight.points;
  blind.viewpoints.clear();
  EXPECT_FALSE(compute_ray_agreement(blind, T_local_map(), cast_ray));
}

}  // namespace
}  // namespace tileflight::registration::ray_agreement_test
