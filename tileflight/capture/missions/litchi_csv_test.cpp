#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/refusal.h"
#include "tileflight/capture/missions/mission.h"

namespace tileflight::missions::litchi_test {
namespace {

using testing::Contains;
using testing::HasSubstr;
using tests::refusal_of;

constexpr const char* kMetres =
    "latitude,longitude,altitude(m),heading(deg),curvesize(m),rotationdir,gimbalmode,gimbalpitchangle,actiontype1,"
    "actionparam1,actiontype2,actionparam2,altitudemode,speed(m/s),poi_latitude,poi_longitude,poi_altitude(m),"
    "poi_altitudemode,photo_timeinterval,photo_distinterval\n"
    "35.3110,-80.7402,35,350,5,0,2,-30,-1,0,-1,0,0,6,0,0,0,0,-1,-1\r\n"
    "35.3110,-80.7390,40,10,0.2,0,2,-50,0,1500,1,0,1,0,0,0,0,0,-1,-1\n"
    "35.3096,-80.7390,40,120,0,0,1,0,-1,0,-1,0,0,4,35.3103,-80.7400,3,1,-1,-1\n"
    "35.3096,-80.7402,40,0,0,0,0,0,5,-75,4,200,0,4,0,0,0,0,-1,-1\n";

TEST(Litchi, RowsInMetres) {
  const Mission mission = read_litchi(kMetres, "x.csv");
  const auto& w = mission.waypoints;
  ASSERT_EQ(w.size(), 4u);
  EXPECT_FALSE(mission.takeoff);
  EXPECT_EQ(w[0].position.latitude_deg, 35.3110);
  EXPECT_EQ(w[0].position.longitude_deg, -80.7402);
  EXPECT_EQ(w[0].position.height_m, 35);
  EXPECT_EQ(w[0].position.above, HeightAbove::kTakeoff);
  EXPECT_EQ(w[0].speed_m_s, 6);
  EXPECT_EQ(w[0].heading.kind, Heading::Kind::kBlend);
  EXPECT_EQ(w[0].heading.deg, 350);
  EXPECT_EQ(w[0].pitch.kind, Pitch::Kind::kBlend);
  EXPECT_EQ(w[0].pitch.deg, -30);
  EXPECT_EQ(w[0].passing.distance_m, 5);
  EXPECT_EQ(w[1].position.above, HeightAbove::kGround);
  EXPECT_FALSE(w[1].speed_m_s) << "0: the mission's cruising speed, which the file does not hold";
  EXPECT_EQ(w[1].passing.kind, Passing::Kind::kStop) << "stays for 1500 ms";
  EXPECT_EQ(w[1].passing.hold_s, 1.5);
  ASSERT_TRUE(w[2].target);
  EXPECT_EQ(w[2].target->latitude_deg, 35.3103);
  EXPECT_EQ(w[2].target->height_m, 3);
  EXPECT_EQ(w[2].target->above, HeightAbove::kGround);
  EXPECT_EQ(w[2].heading.kind, Heading::Kind::kTarget);
  EXPECT_EQ(w[2].pitch.kind, Pitch::Kind::kTarget);
  EXPECT_EQ(w[3].pitch.kind, Pitch::Kind::kFixed) << "tilted by an action";
  EXPECT_EQ(w[3].pitch.deg, -75);
  EXPECT_EQ(w[3].heading.deg, 200) << "turned by an action";
  EXPECT_THAT(mission.notes, Contains(HasSubstr("1 actions of the camera")));
}

TEST(Litchi, Feet) {
  const Mission mission = read_litchi(
      "latitude,longitude,altitude(ft),heading(deg),curvesize(ft),rotationdir,gimbalmode,gimbalpitchangle,altitudemode,"
      "speed(m/s),poi_latitude,poi_longitude,poi_altitude(ft),poi_altitudemode\n"
      "41.73272,-111.83423,100,249,50,0,1,-35,0,8.85,41.73231,-111.83423,-35,0\n"
      "41.73256,-111.83481,141.91,189,81.87,0,2,-33,0,8.85,41.73231,-111.83423,-35,0\n",
      "x.csv");
  ASSERT_EQ(mission.waypoints.size(), 2u);
  EXPECT_DOUBLE_EQ(*mission.waypoints[0].position.height_m, 30.48);
  EXPECT_DOUBLE_EQ(mission.waypoints[0].passing.distance_m, 15.24);
  EXPECT_DOUBLE_EQ(*mission.waypoints[0].target->height_m, -10.668);
  EXPECT_EQ(mission.waypoints[0].speed_m_s, 8.85) << "speeds are in m/s in both kinds of files";
}

TEST(Litchi, WithoutHeadingsLooksAlong) {
  const Mission mission = read_litchi(
      "latitude,longitude,altitude(m),heading(deg)\n35.3110,-80.7402,35,0\n35.3110,-80.7390,40,0\n", "x.csv");
  EXPECT_EQ(mission.waypoints[0].heading.kind, Heading::Kind::kAlong);
  EXPECT_THAT(mission.notes, Contains(HasSubstr("no headings")));
}

TEST(Litchi, Refusals) {
  const auto fault_of = [](const std::string& text) { return refusal_of([&] { read_litchi(text, "x.csv"); }); };
  EXPECT_THAT(fault_of("latitude,longitude,altitude(yd)\n1,2,3\n"), HasSubstr("unit of column 'altitude(yd)'"));
  EXPECT_THAT(fault_of("latitude,altitude(m)\n1,2\n"), HasSubstr("no column 'longitude'"));
  EXPECT_THAT(fault_of("latitude,longitude,altitude(m)\n1,2\n"), HasSubstr("x.csv:2"));
  EXPECT_THAT(fault_of("latitude,longitude,altitude(m)\n1,2,high\n"), HasSubstr("'high' is no number"));
  EXPECT_THAT(fault_of("latitude,longitude,altitude(m)\n0,0,10\n"), HasSubstr("no place"));
}

}  // namespace
}  // namespace tileflight::missions::litchi_test
