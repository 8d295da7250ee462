#include "tileflight/capture/vehicle/collision.h"

#include <gtest/gtest.h>

#include <random>

#include "tileflight/capture/vehicle/test_obstacles.h"

namespace tileflight::vehicle::collision_test {
namespace {

using geometry::Vec3;

constexpr double kRadius_m = 0.3;

Vec3 random_vector(std::mt19937& random, double reach) {
  std::uniform_real_distribution<double> uniform(-reach, reach);
  return {uniform(random), uniform(random), uniform(random)};
}

TEST(FirstContact, OfAPlaneIsExactWhateverTheAngleAndTheLengthOfTheStep) {
  std::mt19937 random(1);
  int met = 0;
  for (int i = 0; i < 3000; ++i) {
    const Vec3 normal = random_vector(random, 1).normalized();
    const ObstacleQuery wall = test_support::plane(normal, 1.0);
    const Vec3 from = random_vector(random, 0.3);
    const Vec3 to = from + random_vector(random, i % 2 == 0 ? 1.0 : 20.0);
    const auto contact = first_contact(wall, from, to, kRadius_m);
    const bool reaches = normal.dot(to) > 1.0 - kRadius_m;
    ASSERT_EQ(contact.has_value(), reaches) << i;
    if (!contact) continue;
    ++met;
    EXPECT_NEAR(normal.dot(contact->center), 1.0 - kRadius_m, 1e-9);
    EXPECT_LT((contact->normal + normal).norm(), 1e-12);
  }
  EXPECT_GT(met, 500);
}

TEST(FirstContact, OfASphereNeverReachesIntoIt) {
  std::mt19937 random(2);
  const Vec3 center(0.2, -0.1, 0.4);
  const double radius_m = 2.0;
  const ObstacleQuery ball = test_support::sphere(center, radius_m);
  int met = 0;
  for (int i = 0; i < 3000; ++i) {
    const Vec3 from = center + random_vector(random, 1).normalized() * 2.6;
    const Vec3 to = from + random_vector(random, i % 2 == 0 ? 0.5 : 30.0);
    const auto contact = first_contact(ball, from, to, kRadius_m);
    // Where the centre passes within the sum of the radii.
    const Vec3 way = to - from;
    const double t = std::clamp((center - from).dot(way) / way.squaredNorm(), 0.0, 1.0);
    const double nearest = (from + t * way - center).norm();
    ASSERT_TRUE(contact || nearest >= radius_m) << "went through it";
    EXPECT_TRUE(contact || t < 1.0 || nearest >= radius_m + 0.7 * kRadius_m) << nearest;
    if (!contact) continue;
    ++met;
    const double clearance = (contact->center - center).norm() - radius_m;
    EXPECT_GT(clearance, 0.7 * kRadius_m);  // a curved body between probe rays is detected this late
    EXPECT_LT(contact->normal.dot(way), 0.0);
  }
  EXPECT_GT(met, 500);
}

TEST(FirstContact, HeadOnTheSphereIsExact) {
  const auto contact = first_contact(test_support::sphere({10, 0, 0}, 2.0), {0, 0, 0}, {500, 0, 0}, kRadius_m);
  ASSERT_TRUE(contact);
  EXPECT_NEAR(contact->center.x(), 10 - 2 - kRadius_m, 1e-12);
}

TEST(FirstContact, LeavingASurfaceIsNone) {
  const ObstacleQuery ground = test_support::level_ground(0.0);
  EXPECT_FALSE(first_contact(ground, {0, 0, 0.2}, {0, 0, 0.25}, kRadius_m));
  EXPECT_FALSE(first_contact(ground, {0, 0, 0.3}, {5, 0, 0.3}, kRadius_m));
  EXPECT_TRUE(first_contact(ground, {0, 0, 0.3}, {5, 0, 0.29}, kRadius_m));
  EXPECT_TRUE(first_contact(ground, {0, 0, 0.2}, {0, 0, 0.19}, kRadius_m));
}

TEST(FirstContact, ABallAtRestTouchesOrNot) {
  const ObstacleQuery ball = test_support::sphere({0, 0, 0}, 1.0);
  EXPECT_TRUE(touches(ball, {1.25, 0, 0}, kRadius_m));
  EXPECT_FALSE(touches(ball, {1.3, 0, 0}, kRadius_m));
  EXPECT_FALSE(touches(test_support::level_ground(0), {0, 0, kRadius_m}, kRadius_m));
}

TEST(FirstContact, ThinWallsStopAnySpeed) {
  const ObstacleQuery sheet = test_support::plane({1, 0, 0}, 100.0);  // without thickness
  for (const double step_m : {0.1, 10.0, 1e3, 1e6}) {
    const auto contact = first_contact(sheet, {99.65, 0, 0}, {99.65 + step_m, 0, 0}, kRadius_m);
    ASSERT_TRUE(contact);
    EXPECT_NEAR(contact->center.x(), 100 - kRadius_m, 1e-9);
  }
}

TEST(Bounce, RestitutionAndFriction) {
  const BounceOptions options{0.5, 0.2, 0.1};
  const Vec3 up = Vec3::UnitZ();
  EXPECT_LT((bounce_velocity({0, 0, -4}, up, options) - Vec3(0, 0, 2)).norm(), 1e-15);
  EXPECT_LT((bounce_velocity({3, 4, -4}, up, options) - Vec3(3, 4, 0) * (1 - 1.2 / 5) - Vec3(0, 0, 2)).norm(), 1e-12);
  EXPECT_LT((bounce_velocity({0.5, 0, -4}, up, options) - Vec3(0, 0, 2)).norm(), 1e-15);  // friction only stops
  EXPECT_LT((bounce_velocity({1, 0, -0.05}, up, options) - Vec3(0.99, 0, 0)).norm(), 1e-12);
  EXPECT_EQ(bounce_velocity({1, 2, 3}, up, options), Vec3(1, 2, 3));
}

TEST(Bounce, AllFrictionlessElasticBouncesKeepEnergy) {
  std::mt19937 random(3);
  for (int i = 0; i < 100; ++i) {
    const Vec3 velocity = random_vector(random, 5), normal = random_vector(random, 1).normalized();
    EXPECT_NEAR(bounce_velocity(velocity, normal, {1.0, 0.0, 0.0}).norm(), velocity.norm(), 1e-12);
  }
}

}  // namespace
}  // namespace tileflight::vehicle::collision_test
