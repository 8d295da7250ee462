#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/refusal.h"
#include "tileflight/capture/missions/mission.h"

namespace tileflight::missions::mavlink_test {
namespace {

using nlohmann::json;
using testing::Contains;
using testing::HasSubstr;
using tests::refusal_of;

json item(int command, int frame, const json& params) {
  return {{"type", "SimpleItem"}, {"command", command}, {"frame", frame}, {"params", params}, {"autoContinue", true}};
}

/// A plan of PX4 with the take-off place and hover speed that QGroundControl writes.
json plan_of(const json& items, int firmware = 12) {
  json numbered = items;
  for (std::size_t i = 0; i < numbered.size(); ++i) numbered[i]["doJumpId"] = i + 1;
  return {{"fileType", "Plan"},
          {"version", 1},
          {"mission",
           {{"firmwareType", firmware},
            {"vehicleType", 2},
            {"hoverSpeed", 5},
            {"cruiseSpeed", 15},
            {"plannedHomePosition", {35.3103, -80.7402, 221.5}},
            {"items", numbered}}}};
}

Mission read(const json& items, int firmware = 12) { return read_plan(plan_of(items, firmware).dump(), "x.plan"); }
std::string fault(const json& items) {
  return refusal_of([&] { read(items); });
}

TEST(QgcPlan, WaypointsWithSpeedsHeadingsAndHeights) {
  const Mission mission = read(
      {item(22, 3, {0, 0, 0, nullptr, nullptr, nullptr, 35}), item(16, 3, {0, 0, 0, nullptr, 35.3110, -80.7402, 35}),
       item(178, 2, {1, 7.5, -1, 0, 0, 0, 0}), item(16, 0, {4, 0, 0, 90, 35.3110, -80.7390, 260}),
       item(16, 10, {0, 6, 0, nullptr, 35.3096, -80.7390, 40}), item(20, 2, {0, 0, 0, 0, 0, 0, 0})});
  ASSERT_TRUE(mission.takeoff);
  EXPECT_EQ(mission.takeoff->latitude_deg, 35.3103);
  EXPECT_EQ(mission.takeoff->height_above_sea_m, 221.5);
  ASSERT_EQ(mission.waypoints.size(), 5u);
  const auto& w = mission.waypoints;
  EXPECT_EQ(w[0].position.latitude_deg, 35.3103) << "above the take-off place";
  EXPECT_EQ(w[0].position.height_m, 35);
  EXPECT_EQ(w[0].position.above, HeightAbove::kTakeoff);
  EXPECT_EQ(w[0].speed_m_s, 5) << "hoverSpeed";
  EXPECT_EQ(w[1].speed_m_s, 7.5) << "command 178 holds from the waypoint before it on";
  EXPECT_EQ(w[1].heading.kind, Heading::Kind::kFixed) << "PX4 turns on the way to the waypoint that has a heading";
  EXPECT_EQ(w[1].heading.deg, 90);
  EXPECT_EQ(w[1].passing.kind, Passing::Kind::kRounded);
  EXPECT_EQ(w[2].position.above, HeightAbove::kSeaLevel);
  EXPECT_EQ(w[2].position.height_m, 260);
  EXPECT_EQ(w[2].passing.kind, Passing::Kind::kStop);
  EXPECT_EQ(w[2].passing.hold_s, 4);
  EXPECT_EQ(w[2].heading.kind, Heading::Kind::kAlong);
  EXPECT_EQ(w[3].position.above, HeightAbove::kGround);
  EXPECT_EQ(w[3].passing.distance_m, 6) << "acceptance radius";
  EXPECT_EQ(w[4].position.longitude_deg, -80.7402) << "returns";
  EXPECT_EQ(w[4].position.above, HeightAbove::kGround) << "at the height of its last waypoint";
  EXPECT_EQ(w[4].position.height_m, 40);
  EXPECT_EQ(w[0].pitch.kind, Pitch::Kind::kOpen);
}

TEST(QgcPlan, GimbalAndRegionOfInterest) {
  const json first = item(16, 3, {0, 0, 0, nullptr, 35.3110, -80.7402, 35}),
             second = item(16, 3, {0, 0, 0, nullptr, 35.3110, -80.7390, 35}),
             third = item(16, 3, {0, 0, 0, nullptr, 35.3096, -80.7390, 35});
  const Mission mission =
      read({item(205, 2, {-45, 0, 0, 0, 0, 0, 2}), first, item(195, 3, {0, 0, 0, 0, 35.3103, -80.7400, 2}), second,
            item(197, 2, {0, 0, 0, 0, 0, 0, 0}), item(1000, 2, {-60, 0, 0, 0, 0, 0, 0}),
            item(115, 2, {270, 10, 1, 0, 0, 0, 0}), third, first});
  ASSERT_EQ(mission.waypoints.size(), 4u);
  EXPECT_EQ(mission.waypoints[0].pitch.kind, Pitch::Kind::kTarget);
  EXPECT_EQ(mission.waypoints[0].heading.kind, Heading::Kind::kTarget);
  ASSERT_TRUE(mission.waypoints[0].target);
  EXPECT_EQ(mission.waypoints[0].target->longitude_deg, -80.74);
  EXPECT_EQ(mission.waypoints[0].target->height_m, 2);
  EXPECT_EQ(mission.waypoints[1].pitch.kind, Pitch::Kind::kFixed);
  EXPECT_EQ(mission.waypoints[1].pitch.deg, -60);
  EXPECT_FALSE(mission.waypoints[1].target);
  EXPECT_EQ(mission.waypoints[1].heading.kind, Heading::Kind::kFixed);
  EXPECT_EQ(mission.waypoints[1].heading.deg, 270);
  EXPECT_EQ(mission.waypoints[2].heading.kind, Heading::Kind::kAlong) << "command 115 ends at the next waypoint";
  const Mission tilted = read({item(205, 2, {-45, 0, 0, 0, 0, 0, 2}), first, second});
  EXPECT_EQ(tilted.waypoints[0].pitch.deg, -45);
}

json survey_item() {
  const json camera{{"CameraName", "Sony ILCE-QX1"}, {"FocalLength", 16},   {"ImageHeight", 3632}, {"ImageWidth", 5456},
                    {"SensorHeight", 15.4},          {"SensorWidth", 23.2}, {"Landscape", true}};
  const json parts{item(16, 3, {0, 0, 0, nullptr, 35.3110, -80.7402, 50}), item(206, 2, {25, 0, 1, 0, 0, 0, 0}),
                   item(16, 3, {0, 0, 0, nullptr, 35.3110, -80.7390, 50}), item(206, 2, {0, 0, 0, 0, 0, 0, 0}),
                   item(16, 3, {0, 0, 0, nullptr, 35.3106, -80.7390, 50})};
  return {{"type", "ComplexItem"},
          {"complexItemType", "survey"},
          {"polygon", json::array()},
          {"TransectStyleComplexItem", {{"CameraCalc", camera}, {"Items", parts}}}};
}

TEST(QgcPlan, SurveyIsFlownByItsItems) {
  const Mission mission = read({item(22, 3, {0, 0, 0, nullptr, 35.3103, -80.7402, 50}), survey_item()});
  ASSERT_EQ(mission.waypoints.size(), 4u) << "a take-off at the take-off place is one point";
  EXPECT_EQ(mission.waypoints[0].pitch.kind, Pitch::Kind::kNadir);
  EXPECT_EQ(mission.waypoints[2].pitch.kind, Pitch::Kind::kNadir);
  EXPECT_THAT(mission.notes, Contains(HasSubstr("206 (2 times)")));
  ASSERT_TRUE(mission.camera);
  EXPECT_EQ(mission.camera->width, 5456);
  EXPECT_EQ(mission.camera->height, 3632);
  EXPECT_NEAR(mission.camera->fov_deg, 71.8837, 1e-3) << "2 atan(11.6 / 16)";
}

TEST(QgcPlan, JumpsRepeatAndAreBounded) {
  const json a = item(16, 3, {0, 0, 0, nullptr, 35.3110, -80.7402, 35}),
             b = item(16, 3, {0, 0, 0, nullptr, 35.3110, -80.7390, 35});
  const Mission mission = read({a, b, item(177, 2, {1, 2, 0, 0, 0, 0, 0})});
  EXPECT_EQ(mission.waypoints.size(), 6u) << "flown once and repeated twice";
  EXPECT_THAT(fault({a, b, item(177, 2, {9, 2, 0, 0, 0, 0, 0})}), HasSubstr("item 9"));
  const json jump = item(177, 2, {3, 30000, 0, 0, 0, 0, 0});
  EXPECT_THAT(fault({a, b, a, b, a, b, a, b, a, b, a, b, jump}), HasSubstr("too many waypoints"));
  EXPECT_THAT(fault({a, item(177, 2, {2, 1e9, 0, 0, 0, 0, 0})}), HasSubstr("without an end"));
}

TEST(QgcPlan, NamesWhatIsNotSimulated) {
  const json a = item(16, 3, {0, 0, 0, nullptr, 35.3110, -80.7402, 35}),
             b = item(16, 3, {0, 0, 0, nullptr, 35.3110, -80.7390, 35});
  json plan = plan_of({a, item(183, 2, {1, 2, 0, 0, 0, 0, 0}), item(183, 2, {1, 2, 0, 0, 0, 0, 0}),
                       item(2000, 2, {0, 2, 0, 0, 0, 0, 0}), b});
  plan["geoFence"] = {{"circles", json::array()}, {"polygons", {{{"inclusion", true}}}}, {"version", 2}};
  const Mission mission = read_plan(plan.dump(), "x.plan");
  EXPECT_THAT(mission.notes, Contains("commands that are not simulated: 183 (2 times)"));
  EXPECT_THAT(mission.notes, Contains(HasSubstr("2000 (1 time)")));
  EXPECT_THAT(mission.notes, Contains(HasSubstr("geofence")));
}

TEST(QgcPlan, ArduPilotIgnoresHeadingsOfWaypoints) {
  const json a = item(16, 3, {0, 0, 0, 0, 35.3110, -80.7402, 35}), b = item(16, 3, {0, 0, 0, 0, 35.3110, -80.7390, 35});
  EXPECT_EQ(read({a, b}, 3).waypoints[0].heading.kind, Heading::Kind::kAlong);
  EXPECT_EQ(read({a, b}, 12).waypoints[0].heading.kind, Heading::Kind::kFixed) << "0: north";
}

TEST(QgcPlan, Refusals) {
  const json a = item(16, 3, {0, 0, 0, nullptr, 35.3110, -80.7402, 35});
  EXPECT_THAT(fault({a, item(16, 1, {0, 0, 0, nullptr, 35.3110, -80.7390, 35})}), HasSubstr("coordinate frame 1"));
  EXPECT_THAT(fault({a, item(16, 3, {0, 0, 0, nullptr, 95.3110, -80.7390, 35})}), HasSubstr("no place"));
  EXPECT_THAT(fault({a, item(16, 3, {0, 0, 0, nullptr, 35.3110, -80.7390})}), HasSubstr("seven numbers"));
  EXPECT_THAT(fault({a, {{"type", "ComplexItem"}, {"complexItemType", "StructureScan"}}}), HasSubstr("StructureScan"));
  EXPECT_THAT(refusal_of([] { read_plan("{\"fileType\": \"Plan\"", "x.plan"); }), HasSubstr("cut off"));
  EXPECT_THAT(refusal_of([] { read_plan("{\"fileType\": \"Mission\"}", "x.plan"); }), HasSubstr("'Mission'"));
}

constexpr const char* kList =
    "QGC WPL 110\r\n"
    "0\t1\t0\t16\t0\t0\t0\t0\t35.3103\t-80.7402\t221.5\t1\r\n"
    "1\t0\t3\t22\t0\t0\t0\t0\t0\t0\t35\t1\r\n"
    "2\t0\t3\t16\t0\t0\t0\t0\t35.3110\t-80.7402\t35\t1\r\n"
    "3\t0\t0\t178\t0\t6\t0\t0\t0\t0\t0\t1\r\n"
    "4\t0\t3\t19\t2.5\t0\t0\t0\t35.3110\t-80.7390\t40\t1\r\n"
    "5\t0\t3\t21\t0\t0\t0\t0\t35.3096\t-80.7390\t0\t1\r\n";

TEST(WaypointList, IsReadAsArduPilotFlies) {
  const Mission mission = read_waypoint_list(kList, "x.waypoints");
  ASSERT_TRUE(mission.takeoff);
  EXPECT_EQ(mission.takeoff->height_above_sea_m, 221.5);
  ASSERT_EQ(mission.waypoints.size(), 4u);
  EXPECT_EQ(mission.waypoints[0].position.latitude_deg, 35.3103);
  EXPECT_EQ(mission.waypoints[0].position.height_m, 35);
  EXPECT_FALSE(mission.waypoints[0].speed_m_s) << "the file does not say";
  EXPECT_EQ(mission.waypoints[1].speed_m_s, 6);
  EXPECT_EQ(mission.waypoints[2].passing.kind, Passing::Kind::kStop);
  EXPECT_EQ(mission.waypoints[2].passing.hold_s, 2.5);
  EXPECT_EQ(mission.waypoints[3].position.height_m, 40) << "the descent is left out";
  EXPECT_EQ(mission.waypoints[3].position.latitude_deg, 35.3096);
}

TEST(WaypointList, Refusals) {
  const std::string list = kList;
  const auto fault_of = [](const std::string& text) {
    return refusal_of([&] { read_waypoint_list(text, "x.waypoints"); });
  };
  EXPECT_THAT(fault_of(list.substr(0, list.size() - 20)), HasSubstr("x.waypoints: line 7"));
  EXPECT_THAT(fault_of("QGC WPL 120\n"), HasSubstr("version 110"));
  EXPECT_THAT(fault_of("QGC WPL 110\n0\t1\t0\tx\t0\t0\t0\t0\t1\t2\t3\t1\n"), HasSubstr("'x' is no number"));
}

}  // namespace
}  // namespace tileflight::missions::mavlink_test
