#include "tileflight/core/alignment/plane_system.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

namespace tileflight::alignment::constraint_test {
namespace {

using geometry::Vec3;

struct Oriented {
  Vec3 point, normal;
};

constexpr double kPi = 3.141592653589793;

/// 4000 points of a surface with two parameters in [0, 1), relative to their centre.
Constraint constraint_of_surface(const std::function<Oriented(double, double)>& surface, bool with_scale = false) {
  constexpr int kSide = 64;
  std::vector<Oriented> points;
  for (int i = 0; i < kSide; ++i) {
    for (int j = 0; j < kSide; ++j) points.push_back(surface((i + 0.5) / kSide, (j + 0.5) / kSide));
  }
  Vec3 center = Vec3::Zero();
  for (const Oriented& o : points) center += o.point / static_cast<double>(points.size());
  double squares = 0.0;
  for (const Oriented& o : points) squares += (o.point - center).squaredNorm();
  const double length_m = std::sqrt(squares / static_cast<double>(points.size()));
  PointToPlaneSystem system;
  for (const Oriented& o : points) system.add(o.point - center, o.point - center, o.normal, length_m);
  return analyze_constraint(system, points.size(), with_scale);
}

Oriented on_sphere(double u, double v) {
  const double z = 2.0 * u - 1.0, r = std::sqrt(1.0 - z * z), angle_rad = 2.0 * kPi * v;
  const Vec3 normal(r * std::cos(angle_rad), r * std::sin(angle_rad), z);
  return {20.0 * normal, normal};
}

Oriented on_level_plane(double u, double v) { return {Vec3(80.0 * u, 60.0 * v, 5.0), Vec3::UnitZ()}; }

Oriented on_cylinder_along_x(double u, double v) {
  const double angle_rad = 2.0 * kPi * v;
  const Vec3 normal(0.0, std::cos(angle_rad), std::sin(angle_rad));
  return {10.0 * normal + 90.0 * u * Vec3::UnitX(), normal};
}

/// A bowl with a level floor, round about the vertical: what a round stadium without its stands' gaps would be.
Oriented in_round_bowl(double u, double v) {
  const double angle_rad = 2.0 * kPi * v, r = 40.0 * std::sqrt(u);
  const Vec3 outwards(std::cos(angle_rad), std::sin(angle_rad), 0.0);
  if (r < 25.0) return {r * outwards, Vec3::UnitZ()};
  return {r * outwards + Vec3(0, 0, 0.8 * (r - 25.0)), (Vec3::UnitZ() - 0.8 * outwards).normalized()};
}

TEST(Constraint, PlaneNamesEveryOpenMotion) {
  const Constraint c = constraint_of_surface(on_level_plane);
  EXPECT_FALSE(c.well_constrained);
  EXPECT_NEAR(c.eigenvalues[2], 0.0, 1e-12);
  EXPECT_GT(c.eigenvalues[3], 0.1);
  EXPECT_EQ(c.weakest_motion, "translation along x, translation along y, rotation about z");
}

TEST(Constraint, PlaneLeavesItsScaleOpenToo) {
  EXPECT_EQ(constraint_of_surface(on_level_plane, true).weakest_motion,
            "translation along x, translation along y, rotation about z, scale");
}

TEST(Constraint, RoundBowlMayTurnAboutTheVertical) {
  const Constraint c = constraint_of_surface(in_round_bowl, true);
  EXPECT_FALSE(c.well_constrained);
  EXPECT_EQ(c.weakest_motion, "rotation about z");
  EXPECT_NEAR(std::abs(c.weakest_direction[5]), 1.0, 1e-6);
  EXPECT_GT(c.eigenvalues[1], 0.003);
}

TEST(Constraint, SphereMayTurnAnyWay) {
  const Constraint c = constraint_of_surface(on_sphere);
  EXPECT_EQ(c.weakest_motion, "rotation about x, rotation about y, rotation about z");
  EXPECT_NEAR(c.eigenvalues[3], 1.0 / 3.0, 1e-3) << "the mean square of one component of a unit normal";
}

TEST(Constraint, TunnelMaySlideAndTurn) {
  EXPECT_EQ(constraint_of_surface(on_cylinder_along_x).weakest_motion, "translation along x, rotation about x");
}

TEST(Constraint, BowlWithACornerIsHeld) {
  const Constraint c = constraint_of_surface([](double u, double v) {
    if (v > 0.2) return in_round_bowl(u, v);
    return Oriented{Vec3(30.0 * u, 12.0, 60.0 * v), Vec3::UnitY()};  // a wall away from the centre
  });
  EXPECT_TRUE(c.well_constrained) << c.weakest_motion;
}

TEST(Constraint, NothingMatchedIsNotHeld) { EXPECT_FALSE(analyze_constraint({}, 0, true).well_constrained); }

}  // namespace
}  // namespace tileflight::alignment::constraint_test
