#include "tileflight/world/scene/traffic.h"

#include <gmock/gmock.h>

#include <cmath>
#include <fstream>
#include <numbers>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::scene::traffic_test {
namespace {

using geometry::Vec2;
using geometry::Vec3;
using testing::HasSubstr;

std::optional<double> level(double, double, double) { return 3.0; }

PathPoint at(double x, double y, double speed_m_s) { return {Vec2(x, y), std::nullopt, speed_m_s}; }

ActorPath path(const ActorRoute& route, const GroundHeight& ground = level) { return {route, ground, "actor"}; }

TEST(ActorPath, GoesThroughItsPointsAtTheirSpeeds) {
  const ActorPath straight = path({.points = {at(0, 0, 10), at(100, 0, 10)}, .start_s = 2});
  EXPECT_NEAR(straight.duration_s(), 10.0, 1e-9);
  EXPECT_LT((straight.pose(1).translation - Vec3(0, 0, 3)).norm(), 1e-9) << "waits at its start";
  EXPECT_LT((straight.pose(7).translation - Vec3(50, 0, 3)).norm(), 1e-9);
  EXPECT_LT((straight.velocity(7) - Vec3(10, 0, 0)).norm(), 1e-9);
  EXPECT_LT((straight.pose(99).translation - Vec3(100, 0, 3)).norm(), 1e-9) << "and at its end";
  EXPECT_LT(straight.velocity(99).norm(), 1e-9);
  // A speed that changes evenly along the way: t = ln(v1 / v0) / (dv / ds).
  const ActorPath faster = path({.points = {at(0, 0, 5), at(0, 60, 15)}});
  EXPECT_NEAR(faster.duration_s(), std::log(3.0) / (10.0 / 60.0), 1e-3);
  EXPECT_NEAR((faster.pose(1).rotation * Vec3::UnitX()).y(), 1.0, 1e-9) << "looks where it goes";
}

TEST(ActorPath, ALoopThroughACirclesPointsStaysNearTheCircleAndIsSmooth) {
  ActorRoute route{.loops = true};
  for (int i = 0; i < 12; ++i)
    route.points.push_back(at(30 * std::cos(i * std::numbers::pi / 6), 30 * std::sin(i * std::numbers::pi / 6), 8));
  const ActorPath loop = path(route);
  EXPECT_NEAR(loop.length_m(), 2 * std::numbers::pi * 30, 0.5);
  Vec3 last = loop.velocity(0.01);
  for (double t = 0.02; t < 2.5 * loop.duration_s(); t += 0.05) {
    const Vec3 p = loop.pose(t).translation;
    EXPECT_NEAR(std::hypot(p.x(), p.y()), 30.0, 0.06);
    const Vec3 velocity = loop.velocity(t);
    EXPECT_NEAR(velocity.norm(), 8.0, 0.05);
    EXPECT_LT((velocity - last).norm(), 8.0 * 0.05 * 8.0 / 30 + 0.2);
    EXPECT_NEAR((loop.pose(t).rotation * Vec3::UnitX()).dot(velocity.normalized()), 1.0, 1e-3);
    last = velocity;
  }
  EXPECT_LT((loop.pose(1.0).translation - loop.pose(1.0 + loop.duration_s()).translation).norm(), 1e-6);
}

TEST(ActorPath, FollowsTheGroundWithItsSlopes) {
  const auto slope = [](double x, double y, double) -> std::optional<double> { return 0.1 * x + 0.05 * y; };
  const ActorPath up = path({.points = {at(0, 0, 5), at(50, 0, 5)}}, slope);
  const geometry::SE3 T = up.pose(5);
  EXPECT_NEAR(T.translation.z(), 2.5, 1e-6);
  const Vec3 normal = T.rotation * Vec3::UnitZ();
  EXPECT_LT((normal - Vec3(-0.1, -0.05, 1).normalized()).norm(), 2e-3) << "its wheels are on the road";
  EXPECT_GT((T.rotation * Vec3::UnitX()).z(), 0.09);
  // Under a bridge, where a height is given; over a hole, straight on.
  const auto bridge = [](double x, double, double below) -> std::optional<double> {
    if (x > 40 && x < 45) return std::nullopt;
    return below > 6.0 && x > 20 && x < 30 ? 6.0 : 0.0;
  };
  ActorRoute route{.points = {at(0, 0, 5), at(100, 0, 5)}};
  for (PathPoint& point : route.points) point.up_m = 0.5;
  const ActorPath below = path(route, bridge);
  for (double t = 0; t < 20; t += 0.5) EXPECT_NEAR(below.pose(t).translation.z(), 0.0, 1e-9);
  for (PathPoint& point : route.points) point.up_m.reset();
  EXPECT_NEAR(path(route, bridge).pose(5).translation.z(), 6.0, 1e-9) << "without one, the uppermost";
}

TEST(ActorPath, WrongRoutesAreRefused) {
  const auto refusal = [](const ActorRoute& route, const GroundHeight& ground = level) {
    return tests::refusal_of([&] { path(route, ground); });
  };
  EXPECT_THAT(refusal({}), HasSubstr("actor: has no place"));
  EXPECT_THAT(refusal({.points = {at(0, 0, 1), at(0, 0, 1)}}), HasSubstr("the same"));
  EXPECT_THAT(refusal({.points = {at(0, 0, 0), at(9, 0, 1)}}), HasSubstr("speed"));
  EXPECT_THAT(refusal({.points = {at(0, NAN, 1), at(9, 0, 1)}}), HasSubstr("finite"));
  EXPECT_THAT(refusal({.points = {at(0, 0, 1), at(9e5, 0, 1)}}), HasSubstr("200 km"));
  EXPECT_THAT(refusal({.points = {at(0, 0, 1), at(9, 0, 1)}, .follows_ground = false}), HasSubstr("up"));
  const auto nothing = [](double, double, double) -> std::optional<double> { return std::nullopt; };
  EXPECT_THAT(refusal({.points = {at(0, 0, 1), at(9, 0, 1)}}, nothing), HasSubstr("no surface below its path"));
}

class ActorFile : public testing::Test {
 protected:
  std::vector<ActorPlan> read(const std::string& text) {
    std::ofstream(folder / "flight.yaml") << text;
    return read_actors(folder / "flight.yaml");
  }
  tests::TemporaryFolder folder;
};

TEST_F(ActorFile, NamesModelsPathsAndSpeeds) {
  const auto plans = read(R"(actors:
  - {model: car, path: [{at: [0, 0]}, {at: [50, 0], speed_m_s: 5}], loop: true, start_s: -3}
  - {name: Ann, model: person, position: [3, 4, 1], yaw_deg: 90, on_ground: false, color: [255, 0, 0], scale: 1.1}
)");
  ASSERT_EQ(plans.size(), 2U);
  EXPECT_EQ(plans[0].name, "car_1");
  EXPECT_EQ(plans[0].route.points[0].speed_m_s, 10.0);
  EXPECT_EQ(plans[0].route.points[1].speed_m_s, 5.0);
  EXPECT_TRUE(plans[0].route.loops);
  EXPECT_EQ(plans[1].name, "Ann");
  EXPECT_EQ(plans[1].route.points[0].up_m, 1.0);
  EXPECT_TRUE(read("fps: 5\n").empty());
  const Traffic traffic(plans, level);
  const ActorState ann = traffic.state(1, 7.0);
  EXPECT_LT((ann.T_local_actor.translation - Vec3(3, 4, 1)).norm(), 1e-9);
  EXPECT_NEAR((ann.T_local_actor.rotation * Vec3::UnitX()).x(), 1.0, 1e-9) << "east";
  EXPECT_NEAR(traffic.own_box(1).sizes().z(), 1.1 * 1.77, 0.02);
}

TEST_F(ActorFile, WhatIsWrongIsNamed) {
  const auto refusal = [&](const std::string& actor) {
    return tests::refusal_of([&] { read("actors:\n  - {" + actor + "}\n"); });
  };
  EXPECT_THAT(refusal("model: tank, position: [0, 0]"), HasSubstr("model"));
  EXPECT_THAT(refusal("model: car"), HasSubstr("path"));
  EXPECT_THAT(refusal("position: [0, 0], path: [{at: [1, 1]}]"), HasSubstr("both"));
  EXPECT_THAT(refusal("path: [{at: [1, 1]}]"), HasSubstr("one place"));
  EXPECT_THAT(refusal("path: [{att: [1, 1]}, {at: [2, 2]}]"), HasSubstr("at"));
  EXPECT_THAT(refusal("position: [0, 0], speed_m_s: 1000"), HasSubstr("speed_m_s"));
  EXPECT_THAT(refusal("position: [0, 0], color: [1, 2, 300]"), HasSubstr("color"));
  EXPECT_THAT(refusal("position: [0, 0], wheels: 4"), HasSubstr("wheels"));
  EXPECT_THAT(
      tests::refusal_of([&] { read("actors:\n  - {name: a, position: [0, 0]}\n  - {name: a, position: [0, 0]}\n"); }),
      HasSubstr("twice"));
}

TEST(Traffic, PosesOfASceneAreThoseOfItsTimes) {
  std::vector<ActorPlan> plans(2);
  for (std::size_t i = 0; i < 2; ++i) {
    plans[i].name = "car" + std::to_string(i);
    plans[i].route = {.points = {at(0, 0, 9), at(40, 10, 9), at(40, 60, 9)}};
  }
  const Traffic traffic(plans, level);
  const auto parts = traffic.placed(2.0, 2.05);
  ASSERT_EQ(parts.size(), 2U);
  EXPECT_EQ(parts[0].part, parts[1].part) << "they look the same";
  ASSERT_EQ(parts[0].poses.size(), 6U);
  for (std::size_t k = 0; k < 6; ++k) {
    const geometry::SE3 T = traffic.state(0, 2.0 + 0.01 * static_cast<double>(k)).T_local_actor;
    EXPECT_LT((parts[0].poses[k].matrix() - T.matrix()).norm(), 1e-9);
  }
  EXPECT_EQ(traffic.placed(2.0, 2.0)[1].poses.size(), 1U);
}

}  // namespace
}  // namespace tileflight::scene::traffic_test
