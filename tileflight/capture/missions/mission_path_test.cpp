#include "tileflight/capture/missions/mission_path.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/refusal.h"

namespace tileflight::missions::mission_path_test {
namespace {

using geometry::Vec3;
using testing::Contains;
using testing::HasSubstr;
using tests::refusal_of;

constexpr double kGround_m = 190.0;  // of the place's surface, above the ellipsoid

MissionPlace level_place(std::optional<double> ground_m = kGround_m) {
  const geometry::LocalFrame frame({35.3103, -80.7402, {190.0}});
  return {frame, [ground_m](const std::vector<GroundPoint>& points) {
            return std::vector<std::optional<double>>(points.size(), ground_m);
          }};
}

MissionWaypoint at(double latitude, double longitude, double height_m, HeightAbove above = HeightAbove::kTakeoff) {
  MissionWaypoint waypoint;
  waypoint.position = {latitude, longitude, height_m, above};
  return waypoint;
}

/// A square of 78 m x 109 m whose corners were computed by the closed form of geodetic coordinates.
Mission square() {
  Mission mission;
  mission.takeoff = Takeoff{35.3103, -80.7402, std::nullopt};
  mission.waypoints = {at(35.3103, -80.7402, 35), at(35.3110, -80.7402, 35), at(35.3110, -80.7390, 40),
                       at(35.3096, -80.7390, 40)};
  return mission;
}
const std::vector<Vec3> kSquare{
    {0, 0, 35}, {0, 77.665141, 34.999526}, {109.133642, 77.665862, 39.998593}, {109.135522, -77.664532, 39.998593}};

double nearest_m(const std::vector<flight_path::Waypoint>& waypoints, const Vec3& position) {
  double nearest = HUGE_VAL;
  for (const flight_path::Waypoint& waypoint : waypoints)
    nearest = std::min(nearest, (waypoint.position - position).norm());
  return nearest;
}

double distance_to_leg_m(const Vec3& point, const Vec3& a, const Vec3& b) {
  const double share = std::clamp((point - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
  return (point - a - share * (b - a)).norm();
}

double distance_to_route_m(const Vec3& point, const std::vector<Vec3>& corners) {
  double nearest = HUGE_VAL;
  for (std::size_t i = 0; i + 1 < corners.size(); ++i)
    nearest = std::min(nearest, distance_to_leg_m(point, corners[i], corners[i + 1]));
  return nearest;
}

/// The waypoint nearest to a position.
const flight_path::Waypoint& waypoint_at(const PlacedMission& placed, const Vec3& position) {
  return *std::ranges::min_element(placed.waypoints, {}, [&](const flight_path::Waypoint& waypoint) {
    return (waypoint.position - position).norm();
  });
}

TEST(MissionPath, CornersLieWhereTheClosedFormSays) {
  Mission mission = square();
  for (MissionWaypoint& waypoint : mission.waypoints) waypoint.passing.kind = Passing::Kind::kStop;
  const PlacedMission placed = place_mission(mission, {}, level_place(), 5.0, "x");
  for (const Vec3& corner : kSquare) EXPECT_LT(nearest_m(placed.waypoints, corner), 2e-6) << corner.transpose();
}

TEST(MissionPath, LegsAreStraightAndCornersAreRounded) {
  Mission mission = square();
  mission.waypoints[2].passing.distance_m = 10.0;
  const PlacedMission placed = place_mission(mission, {}, level_place(), 5.0, "x");
  const flight_path::Path path = flight_path::path_through_waypoints(placed.waypoints, {});
  double farthest_m = 0.0, corner_m = HUGE_VAL, rounded_m = HUGE_VAL;
  for (double t = 0.0; t < path.end_s(); t += 0.05) {
    const Vec3 position = path.pose(t).translation;
    corner_m = std::min(corner_m, (position - kSquare[1]).norm());
    rounded_m = std::min(rounded_m, (position - kSquare[2]).norm());
    if ((position - kSquare[2]).norm() > 11.0 && (position - kSquare[1]).norm() > 2.5)
      farthest_m = std::max(farthest_m, distance_to_route_m(position, kSquare));
  }
  EXPECT_LT(farthest_m, 0.02) << "of the straight legs";
  // A parabola from r before to r behind a right angle passes it at r / (2 sqrt 2).
  EXPECT_NEAR(corner_m, 2.0 / std::sqrt(8.0), 0.05);
  EXPECT_NEAR(rounded_m, 10.0 / std::sqrt(8.0), 0.1);
}

TEST(MissionPath, StopsHoldAndSpeedsAreKept) {
  Mission mission = square();
  mission.waypoints[0].speed_m_s = 4.0;
  mission.waypoints[1].speed_m_s = 8.0;
  mission.waypoints[1].passing = {Passing::Kind::kStop, 0.0, 6.0};
  const PlacedMission placed = place_mission(mission, {}, level_place(), 5.0, "x");
  const flight_path::Path path = flight_path::path_through_waypoints(placed.waypoints, {8.0, 2.0, 60.0});
  double resting_s = 0.0, first_m_s = 0.0, second_m_s = 0.0, third_m_s = 0.0;
  bool was_at_corner = false;
  for (double t = 0.0; t < path.end_s(); t += 0.01) {
    const Vec3 position = path.pose(t).translation;
    const double speed_m_s = path.velocity(t).norm();
    if ((position - kSquare[1]).norm() < 1e-3 && speed_m_s < 1e-6) resting_s += 0.01;
    was_at_corner = was_at_corner || (position - kSquare[1]).norm() < 1e-3;
    if (!was_at_corner) first_m_s = std::max(first_m_s, speed_m_s);
    if (was_at_corner && position.y() > 77.0) second_m_s = std::max(second_m_s, speed_m_s);
    if (position.y() < 60.0 && position.x() > 100.0) third_m_s = std::max(third_m_s, speed_m_s);
  }
  EXPECT_NEAR(resting_s, 6.0, 0.1);
  EXPECT_NEAR(first_m_s, 4.0, 0.05);
  EXPECT_NEAR(second_m_s, 8.0, 0.1);
  EXPECT_NEAR(third_m_s, 5.0, 0.06) << "stated nowhere: the flight's";
}

TEST(MissionPath, HeadingsFollowTheLegs) {
  const PlacedMission placed = place_mission(square(), {}, level_place(), 5.0, "x");
  EXPECT_NEAR(waypoint_at(placed, {0, 40, 35}).yaw_deg, 0.0, 1e-3) << "north";
  EXPECT_NEAR(waypoint_at(placed, {55, 77.67, 37.5}).yaw_deg, 90.0, 1e-3) << "east";
  EXPECT_NEAR(waypoint_at(placed, {109.13, 0, 40}).yaw_deg, 180.0, 1e-2) << "south";
  EXPECT_EQ(waypoint_at(placed, {0, 40, 35}).pitch_deg, 0.0);
  EXPECT_THAT(placed.notes, Contains(HasSubstr("does not state the camera's pitch")));
}

TEST(MissionPath, BlendsTheShorterWayRound) {
  Mission mission = square();
  mission.waypoints[0].heading = {Heading::Kind::kBlend, 350.0};
  mission.waypoints[1].heading = {Heading::Kind::kBlend, 30.0};
  mission.waypoints[0].pitch = {Pitch::Kind::kBlend, -20.0};
  mission.waypoints[1].pitch = {Pitch::Kind::kFixed, -60.0};
  const PlacedMission placed = place_mission(mission, {}, level_place(), 5.0, "x");
  for (const flight_path::Waypoint& waypoint : placed.waypoints) {
    const double share = waypoint.position.y() / 77.665;
    if (waypoint.position.x() > 1e-3 || share > 0.95) continue;
    EXPECT_NEAR(std::remainder(waypoint.yaw_deg - (350.0 + 40.0 * share), 360.0), 0.0, 0.01);
    EXPECT_NEAR(waypoint.pitch_deg, -20.0 - 40.0 * share, 0.01);
  }
}

TEST(MissionPath, LooksAtItsTarget) {
  Mission mission = square();
  for (MissionWaypoint& waypoint : mission.waypoints) {
    waypoint.target = MissionPosition{35.3105, -80.7400, 0.0, HeightAbove::kTakeoff};
    waypoint.heading.kind = Heading::Kind::kTarget;
    waypoint.pitch.kind = Pitch::Kind::kTarget;
  }
  const PlacedMission placed = place_mission(mission, {}, level_place(), 5.0, "x");
  const flight_path::Path path = flight_path::path_through_waypoints(placed.waypoints, {});
  const Vec3 target(18.188938, 22.189935, -0.000065);
  for (double t = 0.0; t < path.end_s(); t += 0.1) {
    const geometry::SE3 pose = path.pose(t);
    const Vec3 axis = pose.rotation * Vec3::UnitZ();
    const double angle_deg =
        std::acos(std::min(1.0, axis.dot((target - pose.translation).normalized()))) * 180.0 / 3.14159265358979;
    ASSERT_LT(angle_deg, 1.5) << t;
  }
}

TEST(MissionPath, HeightsAreCountedFromWhatTheFileSays) {
  Mission mission = square();
  mission.waypoints = {at(35.3103, -80.7402, 225, HeightAbove::kEllipsoid),
                       at(35.3110, -80.7402, 35, HeightAbove::kGround)};
  PlacedMission placed = place_mission(mission, {}, level_place(200.0), 5.0, "x");
  EXPECT_NEAR(placed.waypoints.front().position.z(), 35.0, 1e-6) << "225 m above the ellipsoid, origin at 190 m";
  EXPECT_NEAR(placed.waypoints.back().position.z(), 45.0, 1e-3) << "35 m above the surface at 200 m";
  mission.waypoints[0].position.above = HeightAbove::kSeaLevel;
  mission.waypoints[0].position.height_m = 255.0;
  placed = place_mission(mission, {}, level_place(200.0), 5.0, "x");
  // EGM96's undulation near Charlotte is -32 m.
  EXPECT_NEAR(placed.waypoints.front().position.z(), 33.0, 2.0);
  mission.waypoints[0] = at(35.3103, -80.7402, 30);
  placed = place_mission(mission, {}, level_place(200.0), 5.0, "x");
  EXPECT_NEAR(placed.waypoints.front().position.z(), 40.0, 1e-6) << "30 m above the take-off place's surface";
  placed = place_mission(mission, {.takeoff_height_m = 195.0}, level_place(200.0), 5.0, "x");
  EXPECT_NEAR(placed.waypoints.front().position.z(), 35.0, 1e-6) << "the user's take-off height";
}

TEST(MissionPath, DoubtsAboutTheTakeoffAreNamed) {
  Mission mission = square();
  mission.takeoff->height_above_sea_m = 250.0;  // 218 m above the ellipsoid; the surface is at 190 m
  EXPECT_THAT(place_mission(mission, {}, level_place(), 5.0, "x").notes,
              Contains(HasSubstr("250.0 m above sea level")));
  const PlacedMission outside = place_mission(mission, {}, level_place(std::nullopt), 5.0, "x");
  EXPECT_NEAR(outside.waypoints.front().position.z(), 63.0, 2.0);
  EXPECT_THAT(outside.notes, Contains(HasSubstr("no surface where the vehicle takes off")));
  mission.takeoff->height_above_sea_m.reset();
  EXPECT_THAT(refusal_of([&] { place_mission(mission, {}, level_place(std::nullopt), 5.0, "x"); }),
              HasSubstr("takeoff_height"));
  mission.takeoff.reset();
  EXPECT_THAT(place_mission(mission, {}, level_place(), 5.0, "x").notes,
              Contains(HasSubstr("does not state where the vehicle takes off")));
}

TEST(MissionPath, HeightsThatNobodyStatesAreAsked) {
  Mission mission = square();
  for (MissionWaypoint& waypoint : mission.waypoints)
    waypoint.position = {waypoint.position.latitude_deg, waypoint.position.longitude_deg, std::nullopt,
                         HeightAbove::kGround};
  EXPECT_THAT(refusal_of([&] { place_mission(mission, {}, level_place(), 5.0, "x"); }),
              HasSubstr("height_above_ground_m"));
  const PlacedMission placed = place_mission(mission, {.height_above_ground_m = 60.0}, level_place(), 5.0, "x");
  EXPECT_NEAR(placed.waypoints.front().position.z(), 60.0, 1e-6);
  EXPECT_THAT(
      refusal_of([&] { place_mission(mission, {.height_above_ground_m = 60.0}, level_place(std::nullopt), 5.0, "x"); }),
      HasSubstr("no surface"));
}

TEST(MissionPath, OnePlaceIsNoFlight) {
  Mission mission;
  mission.waypoints = {at(35.3103, -80.7402, 35), at(35.3103, -80.7402, 35)};
  EXPECT_THAT(refusal_of([&] { place_mission(mission, {}, level_place(), 5.0, "x"); }), HasSubstr("one place"));
}

TEST(MissionPath, SurveysLookDownUnlessTold) {
  Mission mission = square();
  for (MissionWaypoint& waypoint : mission.waypoints) waypoint.pitch.kind = Pitch::Kind::kNadir;
  EXPECT_EQ(place_mission(mission, {}, level_place(), 5.0, "x").waypoints[3].pitch_deg, -90.0);
  EXPECT_EQ(place_mission(mission, {.pitch_deg = -70.0}, level_place(), 5.0, "x").waypoints[3].pitch_deg, -70.0);
}

}  // namespace
}  // namespace tileflight::missions::mission_path_test
