#include "tileflight/capture/vehicle/vehicle.h"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "tests/refusal.h"
#include "tileflight/capture/vehicle/test_obstacles.h"

namespace tileflight::vehicle::vehicle_test {
namespace {

using geometry::Vec3;
using std::numbers::pi;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr double kStart_m = 10.0;

Vehicle hovering(const VehicleOptions& options = {}, ObstacleQuery obstacles = {}) {
  return {options, std::move(obstacles), {0, 0, kStart_m}, 0.0};
}

void wait(Vehicle& vehicle, double seconds) {
  for (int i = 0; i < seconds / vehicle.options().step_s; ++i) vehicle.step();
}

FollowPath path_of(std::vector<Vec3> points, double speed_m_s) {
  FollowPath path;
  path.points = std::move(points);
  path.speed_m_s = speed_m_s;
  path.timeout_s = 120;
  return path;
}

double tilt_rad(const Vehicle& vehicle) { return std::acos((vehicle.state().R_local_body * Vec3::UnitZ()).z()); }

double yaw_of(const Vehicle& vehicle) { return yaw_rad(vehicle.state().R_local_body); }

TEST(PathProgress, GoesOnAndNeverBack) {
  PathProgress path({{0, 0, 0}, {10, 0, 0}, {10, 0, 0}, {10, 10, 0}});
  EXPECT_EQ(path.length_m(), 20);
  EXPECT_EQ(path.at(15), Vec3(10, 5, 0));
  EXPECT_EQ(path.at(-1), Vec3(0, 0, 0));
  EXPECT_EQ(path.at(99), Vec3(10, 10, 0));
  path.advance_to_nearest({4, 1, 0}, 5);
  EXPECT_NEAR(path.progress_m(), 4, 1e-12);
  path.advance_to_nearest({2, 0, 0}, 5);
  EXPECT_NEAR(path.progress_m(), 4, 1e-12);
  path.advance_to_nearest({9.5, 2, 0}, 5);  // nearest is beyond its reach
  EXPECT_NEAR(path.progress_m(), 9, 1e-12);
  path.advance_to_nearest({9.5, 2, 0}, 5);  // round the corner
  EXPECT_NEAR(path.progress_m(), 12, 1e-12);
}

TEST(Vehicle, TakesOffFromTheGroundAndLandsOnIt) {
  const VehicleOptions options;
  Vehicle vehicle(options, test_support::level_ground(0.0), {1, 2, options.radius_m}, pi / 2, true);
  wait(vehicle, 1.0);
  EXPECT_TRUE(vehicle.landed());
  EXPECT_EQ(vehicle.state().position_m.z(), options.radius_m);
  EXPECT_EQ(vehicle.run(TakeOff{}), Outcome::kFinished);
  EXPECT_NEAR(vehicle.time_s(), 1.0 + 2.0 / 0.5, 2.5);  // AirSim's 2 m at 0.5 m/s
  wait(vehicle, 4.0);
  EXPECT_LT((vehicle.state().position_m - Vec3(1, 2, 2 + options.radius_m)).norm(), 0.02);
  EXPECT_EQ(vehicle.run(Land{0.5, 30}), Outcome::kFinished);
  EXPECT_TRUE(vehicle.landed());
  EXPECT_LT((vehicle.state().position_m - Vec3(1, 2, options.radius_m)).norm(), 0.05);
  EXPECT_NEAR(yaw_of(vehicle), pi / 2, 0.01);
  EXPECT_EQ(vehicle.collisions(), 0);
  EXPECT_EQ(vehicle.run(Land{}), Outcome::kFinished);  // already landed
}

TEST(Vehicle, WithoutGroundLandingTimesOut) {
  Vehicle vehicle = hovering();
  EXPECT_EQ(vehicle.run(Land{0.2, 5}), Outcome::kTimedOut);
  EXPECT_NEAR(vehicle.time_s(), 5.0, 0.0061);
  EXPECT_FALSE(vehicle.landed());
}

TEST(Vehicle, GoesToAPlaceAndHoldsIt) {
  Vehicle vehicle = hovering();
  EXPECT_EQ(vehicle.run(path_of({{30, 10, 15}}, 5)), Outcome::kFinished);
  EXPECT_LT((vehicle.state().position_m - Vec3(30, 10, 15)).norm(), 0.51);
  EXPECT_LT(vehicle.time_s(), 12.0);
  wait(vehicle, 15.0);
  EXPECT_LT((vehicle.state().position_m - Vec3(30, 10, 15)).norm(), 0.01);
  EXPECT_NEAR(yaw_of(vehicle), 0.0, 1e-3);  // flies sideways
}

TEST(Vehicle, CutsCornersByItsLookaheadAtMost) {
  const Vec3 corner(40, 0, kStart_m), end(40, 30, kStart_m);
  for (const double lookahead_m : {2.0, 6.0}) {
    Vehicle vehicle = hovering();
    FollowPath path = path_of({corner, end}, 4);
    path.lookahead_m = lookahead_m;
    double nearest_corner = 1e9, furthest_off = 0;
    EXPECT_EQ(vehicle.run(path,
                          [&](const Vehicle& v) {
                            const Vec3& p = v.state().position_m;
                            nearest_corner = std::min(nearest_corner, (p - corner).norm());
                            furthest_off = std::max(furthest_off, std::min(std::abs(p.y()), std::abs(p.x() - 40)));
                          }),
              Outcome::kFinished);
    EXPECT_LT(nearest_corner, 0.6 * lookahead_m);
    EXPECT_LT(furthest_off, 0.75 * lookahead_m);
  }
}

TEST(Vehicle, ForwardOnlyPointsToWhereItFlies) {
  Vehicle vehicle = hovering();
  FollowPath path = path_of({{0, 30, kStart_m}}, 4);
  path.drivetrain = Drivetrain::kForwardOnly;
  double seen = 0;
  vehicle.run(path, [&](const Vehicle& v) {
    if (std::abs(v.state().position_m.y() - 20) < 0.5) seen = yaw_of(v);
  });
  EXPECT_NEAR(seen, pi / 2, 0.02);
}

TEST(Vehicle, FliesVelocitiesInEitherFrameAndAtAHeight) {
  Vehicle vehicle = hovering();
  EXPECT_EQ(vehicle.run(TurnToYaw{pi / 2}), Outcome::kFinished);
  FlyVelocity velocity{{3, 1, 0.5}, 10.0};
  EXPECT_EQ(vehicle.run(velocity), Outcome::kFinished);
  EXPECT_LT((vehicle.state().velocity_m_s - Vec3(3, 1, 0.5)).norm(), 0.1);
  velocity.frame = VelocityFrame::kHeading;  // forward is north, left is west
  velocity.height_m = 12.0;
  EXPECT_EQ(vehicle.run(velocity), Outcome::kFinished);
  EXPECT_LT((vehicle.state().velocity_m_s - Vec3(-1, 3, 0)).norm(), 0.15);
  EXPECT_NEAR(vehicle.state().position_m.z(), 12.0, 0.1);
  wait(vehicle, 10.0);  // stops by itself
  EXPECT_LT(vehicle.state().velocity_m_s.norm(), 0.01);
}

TEST(Vehicle, TurnsToAYawAndAtARate) {
  Vehicle vehicle = hovering();
  EXPECT_EQ(vehicle.run(TurnToYaw{-3.0, 0.02, 20}), Outcome::kFinished);
  wait(vehicle, 2.0);
  EXPECT_NEAR(yaw_of(vehicle), -3.0, 2e-3);
  const double before = yaw_of(vehicle);
  EXPECT_EQ(vehicle.run(TurnAtRate{0.5, 4.0}), Outcome::kFinished);
  EXPECT_NEAR(wrap_angle_rad(yaw_of(vehicle) - before), 2.0, 0.1);
  EXPECT_LT((vehicle.state().position_m - Vec3(0, 0, kStart_m)).norm(), 0.05);
}

TEST(Vehicle, ANewCommandCancelsTheOldOne) {
  Vehicle vehicle = hovering();
  const auto first = vehicle.command(path_of({{100, 0, kStart_m}}, 5));
  wait(vehicle, 3.0);
  EXPECT_EQ(first->outcome, Outcome::kRunning);
  const auto second = vehicle.command(Hover{});
  EXPECT_EQ(first->outcome, Outcome::kCancelled);
  EXPECT_NEAR(first->ended_s, 3.0, 0.0061);
  vehicle.cancel();
  EXPECT_EQ(second->outcome, Outcome::kCancelled);
  wait(vehicle, 10.0);
  EXPECT_LT(vehicle.state().velocity_m_s.norm(), 0.01);
  EXPECT_EQ(first->outcome, Outcome::kCancelled);
}

TEST(Vehicle, AWallStopsOrBouncesItOrIsNotThere) {
  const ObstacleQuery wall = test_support::plane({1, 0, 0}, 20.0);
  VehicleOptions options;
  Vehicle stopped = hovering(options, wall);
  EXPECT_EQ(stopped.run(path_of({{60, 0, kStart_m}}, 8)), Outcome::kCollided);
  EXPECT_NEAR(stopped.state().position_m.x(), 20 - options.radius_m, 1e-6);
  ASSERT_TRUE(stopped.last_collision());
  EXPECT_NEAR(stopped.last_collision()->impact_m_s, 8.0, 1.0);
  EXPECT_LT((stopped.last_collision()->normal - Vec3(-1, 0, 0)).norm(), 1e-12);
  const Vec3 place = stopped.state().position_m;
  wait(stopped, 2.0);
  EXPECT_EQ(stopped.state().position_m, place);
  EXPECT_EQ(stopped.run(Hover{}), Outcome::kCollided);

  options.collision = CollisionPolicy::kBounce;
  Vehicle bouncing = hovering(options, wall);
  FollowPath path = path_of({{60, 0, kStart_m}}, 8);
  path.timeout_s = 15;
  double furthest = 0;
  EXPECT_EQ(bouncing.run(path, [&](const Vehicle& v) { furthest = std::max(furthest, v.state().position_m.x()); }),
            Outcome::kTimedOut);
  EXPECT_LE(furthest, 20 - options.radius_m + 1e-9);
  EXPECT_GE(bouncing.collisions(), 1);

  options.collision = CollisionPolicy::kOff;
  EXPECT_EQ(hovering(options, wall).run(path_of({{60, 0, kStart_m}}, 8)), Outcome::kFinished);
}

/// Pressed against a slope of 30 degrees each touch is soft, as in a landing.
TEST(Vehicle, ASlopeThatItSlidesAlongIsAContactThatLasts) {
  const Vec3 normal(-std::sin(pi / 6), 0, std::cos(pi / 6));
  VehicleOptions options;
  options.collision = CollisionPolicy::kBounce;
  Vehicle vehicle = hovering(options, test_support::plane(normal, normal.z() * kStart_m - 1.0));
  FlyVelocity onwards;
  onwards.velocity_m_s = {2, 0, 0};
  onwards.duration_s = 20;
  vehicle.command(onwards);
  wait(vehicle, 4.0);
  for (int second = 0; second < 8; ++second) {
    wait(vehicle, 1.0);
    ASSERT_TRUE(vehicle.last_contact());
    EXPECT_GT(vehicle.last_contact()->time_s, vehicle.time_s() - 0.5) << second;
  }
  EXPECT_GT(vehicle.state().position_m.z(), kStart_m + 1.0) << "it slides up the slope";
}

TEST(Vehicle, TakingOffAndLandingAreNoContacts) {
  VehicleOptions options;
  options.collision = CollisionPolicy::kBounce;
  Vehicle vehicle(options, test_support::level_ground(0.0), {0, 0, options.radius_m}, 0.0, true);
  EXPECT_EQ(vehicle.run(TakeOff{}), Outcome::kFinished);
  EXPECT_EQ(vehicle.run(Land{0.5, 30}), Outcome::kFinished);
  EXPECT_FALSE(vehicle.last_contact());
}

TEST(Vehicle, ABallInTheWayStopsIt) {
  const Vec3 center(20, 0.8, kStart_m);
  Vehicle vehicle = hovering({}, test_support::sphere(center, 2.0));
  EXPECT_EQ(vehicle.run(path_of({{60, 0, kStart_m}}, 8)), Outcome::kCollided);
  const double clearance_m = (vehicle.state().position_m - center).norm() - 2.0 - vehicle.options().radius_m;
  EXPECT_GT(clearance_m, -0.02);
  EXPECT_LT(clearance_m, 0.1);
}

TEST(Vehicle, HoldsItsPlaceInGusts) {
  VehicleOptions options;
  options.wind = {{5, 2, 0}, Turbulence::kModerate, 30.0, 3};
  Vehicle vehicle = hovering(options);
  wait(vehicle, 10.0);
  double squares = 0, worst = 0;
  int count = 0;
  EXPECT_EQ(vehicle.run(Hover{30.0},
                        [&](const Vehicle& v) {
                          const double off = (v.state().position_m - Vec3(0, 0, kStart_m)).norm();
                          squares += off * off;
                          worst = std::max(worst, off);
                          ++count;
                        }),
            Outcome::kFinished);
  EXPECT_LT(std::sqrt(squares / count), 0.3);
  EXPECT_GT(worst, 0.005);  // the gusts have an effect
  EXPECT_LT(worst, 0.8);
}

TEST(Vehicle, TheSameCommandsGiveTheSameFlight) {
  const auto flown = [](std::uint64_t seed) {
    VehicleOptions options;
    options.wind = {{3, 0, 0}, Turbulence::kLight, 30.0, seed};
    Vehicle vehicle = hovering(options, test_support::level_ground(0.0));
    vehicle.run(path_of({{10, 0, 12}, {10, 10, 12}}, 5));
    return vehicle.state();
  };
  const RigidBodyState a = flown(1), b = flown(1), c = flown(2);
  EXPECT_EQ(a.position_m, b.position_m);
  EXPECT_EQ(a.R_local_body.coeffs(), b.R_local_body.coeffs());
  EXPECT_NE(a.position_m, c.position_m);
}

TEST(Vehicle, WhatCannotBeFlownIsRefused) {
  Vehicle vehicle = hovering();
  const auto refusal = [&](const Command& command) {
    return tileflight::tests::refusal_of([&] { vehicle.command(command); });
  };
  FollowPath path = path_of({{1, 0, 0}}, 5);
  path.lookahead_m = 0.0;
  EXPECT_THAT(refusal(path), testing::HasSubstr("path: the lookahead must be more than 0"));
  path.lookahead_m.reset();
  path.drivetrain = Drivetrain::kForwardOnly;
  path.yaw = {YawMode::Kind::kRate, 0.1};
  EXPECT_THAT(refusal(path), testing::HasSubstr("forward only"));
  EXPECT_THAT(refusal(path_of({{NAN, 0, 0}}, 5)), testing::HasSubstr("not finite"));
  EXPECT_THAT(refusal(path_of({{0, 0, 0}}, -1)), testing::HasSubstr("speed"));
  EXPECT_THAT(refusal(Hover{-1}), testing::HasSubstr("duration"));
  EXPECT_THAT(refusal(TrackReference{}), testing::HasSubstr("reference"));
  VehicleOptions options;
  options.step_s = 0.1;
  EXPECT_THAT(tileflight::tests::refusal_of([&] { hovering(options); }), testing::HasSubstr("0.01 s"));
}

/// Without drag, a vehicle tilted by a accelerates by g tan(a) and keeps its height.
TEST(Vehicle, LeansSoFarAndKeepsItsHeight) {
  VehicleOptions options;
  options.quadrotor.quadratic_drag_n_s2_m2 = Vec3::Zero();
  constexpr double kLean_rad = 0.15;
  const double speed_after_2_s = kStandardGravity_m_s2 * std::tan(kLean_rad) * 2.0;
  for (const auto& [roll, pitch, direction] :
       {std::tuple(0.0, -kLean_rad, Vec3(0, 1, 0)), std::tuple(kLean_rad, 0.0, Vec3(1, 0, 0))}) {
    Vehicle vehicle(options, {}, Vec3(0, 0, 50), pi / 2);  // heading north
    EXPECT_EQ(vehicle.run(FlyAttitude{.roll_rad = roll, .pitch_rad = pitch, .height_m = 50.0, .duration_s = 2.0}),
              Outcome::kFinished);
    EXPECT_NEAR(vehicle.state().velocity_m_s.dot(direction), speed_after_2_s, 0.12 * speed_after_2_s);
    EXPECT_NEAR(vehicle.state().position_m.z(), 50.0, 0.1);
    EXPECT_NEAR(tilt_rad(vehicle), kLean_rad, 0.01);
    vehicle.run(Hover{});
    EXPECT_LT(vehicle.state().velocity_m_s.norm(), 0.3) << "and stops afterwards";
  }
}

TEST(Vehicle, LeansNoFartherThanItsGreatestTilt) {
  Vehicle vehicle({}, {}, Vec3(0, 0, 500), 0.0);
  vehicle.run(FlyAttitude{.roll_rad = 1.5, .height_m = 500.0, .duration_s = 1.5});
  EXPECT_NEAR(tilt_rad(vehicle), ControllerOptions{}.max_tilt_rad, 0.03);
}

TEST(Vehicle, TurnsAtTheRatesAskedForAboutItsAxes) {
  const VehicleOptions options;
  const double hover =
      kStandardGravity_m_s2 * options.quadrotor.body.mass_kg / (4.0 * options.quadrotor.max_rotor_thrust_n());
  Vehicle vehicle(options, {}, Vec3(0, 0, 50), 0.0);
  double rate_rad_s = 0.0;  // before it ends
  vehicle.run(FlyRates{.rates_rad_s = Vec3(0.5, 0, 0), .throttle = hover, .duration_s = 0.8}, [&](const Vehicle& now) {
    if (now.time_s() < 0.79) rate_rad_s = now.state().angular_velocity_rad_s.x();
  });
  EXPECT_NEAR(rate_rad_s, 0.5, 0.01);
  EXPECT_NEAR(tilt_rad(vehicle), 0.4, 0.05);
  EXPECT_LT(vehicle.state().velocity_m_s.y(), -0.3) << "to its right";
  Vehicle risen(options, {}, Vec3(0, 0, 50), 0.0);
  risen.run(FlyRates{.throttle = 1.2 * hover, .duration_s = 1.0});
  EXPECT_NEAR(risen.state().velocity_m_s.z(), 0.2 * kStandardGravity_m_s2, 0.25);
}

TEST(Vehicle, LeaningNeedsAHeightOrAThrottle) {
  Vehicle vehicle({}, {}, Vec3(0, 0, 50), 0.0);
  EXPECT_THAT([&] { vehicle.command(FlyAttitude{}); },
              ThrowsMessage<InputError>(HasSubstr("attitude: give either a height or a throttle")));
  EXPECT_THAT([&] { vehicle.command(FlyAttitude{.height_m = 50.0, .throttle = 0.5}); },
              ThrowsMessage<InputError>(HasSubstr("attitude: give either a height or a throttle")));
  EXPECT_THAT([&] { vehicle.command(FlyAttitude{.throttle = 1.5}); },
              ThrowsMessage<InputError>(HasSubstr("attitude: the throttle must be from 0 to 1")));
  EXPECT_THAT([&] { vehicle.command(FlyRates{.rates_rad_s = Vec3(NAN, 0, 0), .throttle = 0.5}); },
              ThrowsMessage<InputError>(HasSubstr("rates: a rate is not finite")));
}

}  // namespace
}  // namespace tileflight::vehicle::vehicle_test
