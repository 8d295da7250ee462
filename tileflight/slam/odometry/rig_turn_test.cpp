#include "tileflight/slam/odometry/rig_turn.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace tileflight::odometry {
namespace {

using geometry::Vec3;

constexpr double kDegree = std::numbers::pi / 180.0, kPixel_rad = 1.0 / 320.0;
const Vec3 kCentre(-0.3, 0.0, 0.0);  // the other camera is 0.3 to the right

/// Corners between 4 and 60 m away, whose rays have errors of 0.1 pixels; distances are in another unit.
std::vector<RigCorner> corners(const Vec3& turn_rad, int seed) {
  std::mt19937_64 random(static_cast<std::uint64_t>(seed));
  std::uniform_real_distribution<double> place(-0.6, 0.6), inverse(1.0 / 60.0, 1.0 / 4.0);
  std::normal_distribution<double> error(0.0, 0.1 * kPixel_rad);
  std::vector<RigCorner> all;
  for (int i = 0; i < 200; ++i) {
    const Vec3 own = Vec3(place(random), place(random), 1.0).normalized();
    const double rho = inverse(random);
    const Vec3 true_ray = (own + rho * kCentre).normalized();
    const Vec3 noise(error(random), error(random), 0.0);
    // The calibration's ray lacks the turn.
    all.push_back({own, 3.0 * rho, (geometry::so3_exp(-turn_rad) * true_ray + noise).normalized()});
  }
  return all;
}

TEST(RigTurn, IsFoundAboutEachAxis) {
  for (const double degrees : {0.02, 0.1, 0.5}) {
    for (int axis = 0; axis < 3; ++axis) {
      SCOPED_TRACE(axis);
      const Vec3 turn = degrees * kDegree * Vec3::Unit(axis);
      std::vector<RigTurnFit> fits;
      for (int seed = 0; seed < 5; ++seed) {
        const auto fit = fit_rig_turn(corners(turn, seed), kCentre, kPixel_rad);
        ASSERT_TRUE(fit);
        EXPECT_NEAR(fit->scale, 1.0 / 3.0, 0.01);
        fits.push_back(*fit);
      }
      const RigTurn joined = join_rig_turns(fits).value();
      EXPECT_LT((joined.turn_rad - turn).norm(), 0.01 * kDegree);
      const Vec3 error = joined.turn_rad - turn;
      EXPECT_LT(error.dot(joined.covariance_rad2.inverse() * error), 16.3);  // chi squared, 3 degrees, 0.1 %
    }
  }
}

TEST(RigTurn, SaysHowWrongDistancesAre) {
  const auto fit = fit_rig_turn(corners(0.1 * kDegree * Vec3::UnitY(), 1), kCentre, kPixel_rad);
  ASSERT_TRUE(fit);
  const RigTurn joined = join_rig_turns({*fit}).value();
  EXPECT_GT(std::abs(joined.parallax_axis.y()), 0.99);
  // The rays without the turn show another parallax; distances are as parallax over its angle.
  const double measured_rad = joined.parallax_rad - joined.along_parallax_rad();
  EXPECT_NEAR(joined.parallax_rad / measured_rad - 1.0, joined.distance_error(), 0.01);
  // A turn to the left about the vertical moves what the right camera sees to smaller angles.
  const Vec3 ahead = Vec3::UnitZ(),
             calibrated = geometry::so3_exp(-0.1 * kDegree * Vec3::UnitY()) * (ahead + kCentre / 20.0).normalized();
  const double by_rig_m = kCentre.norm() / std::tan(std::acos(ahead.dot(calibrated)));
  EXPECT_EQ(by_rig_m > 20.0, joined.distance_error() > 0.0);
}

TEST(RigTurn, CornersAtOneDistanceDoNotTellItFromAnotherScale) {
  std::vector<RigCorner> level;
  for (int i = 0; i < 200; ++i) {
    const Vec3 own = Vec3(0.01 * (i % 20) - 0.1, 0.01 * (i / 20.0) - 0.05, 1.0).normalized();
    level.push_back({own, 0.1, (own + 0.1 * kCentre).normalized()});
  }
  const auto fit = fit_rig_turn(level, kCentre, kPixel_rad);
  ASSERT_TRUE(fit);
  EXPECT_GT(join_rig_turns({*fit})->along_parallax_sigma_rad(), 0.2 * kDegree);
}

TEST(RigTurn, FewCornersGiveNone) {
  std::vector<RigCorner> few = corners(Vec3::Zero(), 1);
  few.resize(30);
  EXPECT_FALSE(fit_rig_turn(few, kCentre, kPixel_rad));
  EXPECT_FALSE(join_rig_turns({}));
}

}  // namespace
}  // namespace tileflight::odometry
