#include "tileflight/capture/preview/flight_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace tileflight::preview::flight_check_test {
namespace {

using geometry::SE3;
using geometry::Vec2;
using geometry::Vec3;
using testing::ElementsAre;
using testing::HasSubstr;

imaging::TexturedMesh level(double half_m, double z) {
  imaging::TexturedMesh mesh;
  mesh.mesh.vertices = {{-half_m, -half_m, z}, {half_m, -half_m, z}, {half_m, half_m, z}, {-half_m, half_m, z}};
  mesh.mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

/// Looks straight down, image top to the north.
SE3 down(const Vec3& at) {
  geometry::Mat3 r;
  r << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  return {r, at};
}

SE3 north(const Vec3& at) {
  geometry::Mat3 r;
  r << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  return {r, at};
}

recording::PlannedFlight mission_of(const std::vector<SE3>& poses, double fov_deg = 90.0) {
  recording::PlannedFlight mission;
  mission.calibration.camera = imaging::make_pinhole(400, 300, fov_deg);
  for (std::size_t i = 0; i < poses.size(); ++i)
    mission.frames.poses.push_back({0.1 * static_cast<double>(i), poses[i]});
  return mission;
}

FlightCheck checked(const scene::Scene& scene, const recording::PlannedFlight& mission) {
  return check_flight(scene, mission, {}, {});
}

std::vector<std::string> keys_of(const FlightCheck& check) {
  std::vector<std::string> keys;
  for (const render::FlightFault& fault : find_faults(check, {})) keys.push_back(fault.key);
  return keys;
}

TEST(FlightCheckTest, FlowOverALevelPlaneIsThatOfThePinhole) {
  const scene::Scene scene({level(500, 0)});
  const FlightCheck check = checked(scene, mission_of({down({0, 0, 20}), down({1, 0, 20}), down({1, 3, 20})}));
  // f = width / 2 at 90 degrees: a step of s metres at 20 m moves the picture by s / (2 * 20) of its width.
  EXPECT_NEAR(check.views[0].flow_share, 1.0 / 40, 1e-6);
  EXPECT_NEAR(check.views[1].flow_share, 3.0 / 40, 1e-6);
  EXPECT_TRUE(std::isnan(check.views[2].flow_share));
  EXPECT_EQ(check.views[0].surface_share, 1.0);
  EXPECT_NEAR(check.frames[0].surroundings.above_ground_m, 20, 1e-4);
  EXPECT_NEAR(check.frames[0].surroundings.clearance_m, 20, 1e-6);
}

TEST(FlightCheckTest, WhatIsTooFastIsSaid) {
  const scene::Scene scene({level(500, 0)});
  std::vector<SE3> poses;
  for (int i = 0; i < 10; ++i) poses.push_back(down({i < 5 ? 1.0 * i : 5.0 * i - 20, 0, 20}));
  const FlightCheck check = checked(scene, mission_of(poses));
  const auto faults = find_faults(check, {});
  ASSERT_THAT(keys_of(check), ElementsAre("too_fast"));
  EXPECT_THAT(faults[0].frames, ElementsAre(5, 6, 7, 8));
  EXPECT_EQ(initialization_warning(check, {}), std::nullopt);
}

TEST(FlightCheckTest, ParallaxIsTheAngleBetweenTheRays) {
  const scene::Scene scene({level(500, 0)});
  std::vector<SE3> poses;
  for (int i = 0; i < 4; ++i) poses.push_back(down({0.1 * i, 0, 20}));
  const FlightCheck check = checked(scene, mission_of(poses, 10.0));  // narrow: all rays are nearly vertical
  ASSERT_TRUE(check.initialization);
  EXPECT_NEAR(check.initialization->parallax_rad, std::atan(0.3 / 20), 2e-4);
  EXPECT_EQ(check.initialization->at_frame, 3U);
  EXPECT_THAT(initialization_warning(check, {}).value(), HasSubstr("over the first 4 frames"));
  EXPECT_THAT(initialization_warning(check, {}).value(), HasSubstr("0.86°, but 1.5° are needed"));
  EXPECT_FALSE(checked(scene, mission_of({poses[0]})).initialization) << "one frame";
}

TEST(FlightCheckTest, WallsAndInsidesAreSaid) {
  imaging::TexturedMesh wall;  // across the way north, 10 m high
  wall.mesh.vertices = {{-50, 10, 0}, {50, 10, 0}, {50, 10, 10}, {-50, 10, 10}};
  wall.mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  const scene::Scene scene({level(500, 0), wall});
  const auto flown = [&](double z) {
    std::vector<SE3> poses;
    for (int i = 0; i < 12; ++i) poses.push_back(north({0, 0.5 + 2.0 * i, z}));
    return checked(scene, mission_of(poses));
  };
  const FlightCheck through = flown(5), over = flown(15);
  const auto has = [&](const FlightCheck& check, const std::string& key) {
    return std::ranges::count(keys_of(check), key) == 1;
  };
  EXPECT_TRUE(has(through, "path_through_surface"));
  EXPECT_TRUE(has(through, "camera_near_surface"));
  EXPECT_FALSE(has(over, "path_through_surface"));
  for (std::size_t i = 0; i < through.frames.size(); ++i) EXPECT_EQ(through.frames[i].path_is_blocked, i == 4);
  EXPECT_TRUE(has(flown(-3), "camera_inside_surface"));
}

TEST(FlightCheckTest, LeavingThePlaceIsSaid) {
  const scene::Scene scene({level(30, 0)});
  std::vector<SE3> poses;
  for (int i = 0; i < 20; ++i) poses.push_back(down({5.0 * i, 0, 20}));
  const FlightCheck check = checked(scene, mission_of(poses));
  EXPECT_TRUE(std::isinf(check.frames[10].surroundings.above_ground_m));
  EXPECT_THAT(keys_of(check), testing::IsSupersetOf({"nothing_below", "no_surface_in_view", "view_nearly_empty"}));
}

TEST(FlightCheckTest, AFlightAroundATowerHasNotLeftThePlace) {
  imaging::TexturedMesh wall;  // of a tower, 60 m wide and high
  wall.mesh.vertices = {{-30, 20, 0}, {30, 20, 0}, {30, 20, 60}, {-30, 20, 60}};
  wall.mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  const scene::Scene scene({wall});
  std::vector<SE3> poses;
  for (int i = 0; i < 10; ++i) poses.push_back(north({0.3 * i, 0, 30}));
  const FlightCheck check = checked(scene, mission_of(poses));
  EXPECT_TRUE(std::isinf(check.frames[5].surroundings.above_ground_m));
  EXPECT_THAT(keys_of(check), testing::Not(testing::Contains("nothing_below")));
}

TEST(FlightCheckTest, LongFlightsAreLookedAtHereAndThere) {
  const scene::Scene scene({level(500, 0)});
  std::vector<SE3> poses;
  for (int i = 0; i < 100; ++i) poses.push_back(down({0.1 * i, 0, 20}));
  const FlightCheck check = check_flight(scene, mission_of(poses), {.max_views = 10}, {});
  const auto is_known = [](const ViewCheck& view) { return std::isfinite(view.surface_share); };
  EXPECT_EQ(std::ranges::count_if(check.views, is_known), 10);
  EXPECT_TRUE(is_known(check.views.front()));
  EXPECT_TRUE(is_known(check.views.back()));
  EXPECT_TRUE(find_faults(check, {}).empty()) << "what was not looked at is no fault";
}

TEST(FlightCheckTest, TheFootprintOfAPinholeIsItsRectangle) {
  const scene::Scene scene({level(500, 0)});
  const imaging::Camera camera = imaging::make_pinhole(400, 300, 90.0);
  Eigen::AlignedBox2d box;
  for (const Vec2& p : footprint(scene, camera, down({7, -3, 20}), 100)) box.extend(p);
  EXPECT_NEAR(box.min().x(), 7 - 20, 0.2);
  EXPECT_NEAR(box.max().x(), 7 + 20, 0.2);
  EXPECT_NEAR(box.min().y(), -3 - 15, 0.2);
  EXPECT_NEAR(box.max().y(), -3 + 15, 0.2);
}

TEST(FlightCheckTest, TheFootprintEndsAtTheReachAndWhereThePlaceEnds) {
  const scene::Scene scene({level(40, 0)});
  const imaging::Camera camera = imaging::make_pinhole(400, 300, 90.0);
  const std::vector<Vec2> corners = footprint(scene, camera, north({0, 0, 10}), 30);
  ASSERT_FALSE(corners.empty());
  for (const Vec2& p : corners) {
    EXPECT_LE(p.norm(), 30.001);
    EXPECT_GT(p.y(), 0);
  }
  double farthest = 0;
  for (const Vec2& p : footprint(scene, camera, north({0, 0, 10}), 1000)) farthest = std::max(farthest, p.y());
  EXPECT_NEAR(farthest, 40, 0.5);
  EXPECT_TRUE(footprint(scene, camera, north({0, 100, 10}), 1000).empty()) << "it looks away from the place";
}

}  // namespace
}  // namespace tileflight::preview::flight_check_test
