#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/capture/missions/mission.h"
#include "tileflight/tiles/fetch/test_tilesets.h"

namespace tileflight::missions::kml_test {
namespace {

using fetch::test_support::make_zip;
using testing::Contains;
using testing::HasSubstr;
using tests::refusal_of;

std::string kml(const std::string& content) {
  return "<?xml version=\"1.0\" encoding=\"UTF-8\"?><kml xmlns=\"http://www.opengis.net/kml/2.2\" "
         "xmlns:wpml=\"http://www.dji.com/wpmz/1.0.2\"><Document>" +
         content + "</Document></kml>";
}

std::string waylines(const std::string& height_mode, const std::string& placemarks) {
  return kml(
      "<wpml:missionConfig><wpml:finishAction>goHome</wpml:finishAction>"
      "<wpml:takeOffRefPoint>35.310300,-80.740200,0.000000</wpml:takeOffRefPoint></wpml:missionConfig>"
      "<Folder><wpml:templateId>0</wpml:templateId><wpml:executeHeightMode>" +
      height_mode + "</wpml:executeHeightMode><wpml:autoFlightSpeed>7</wpml:autoFlightSpeed>" + placemarks +
      "</Folder>");
}

std::string element(const std::string& name, const std::string& content) {
  return "<wpml:" + name + ">" + content + "</wpml:" + name + ">";
}

std::string placemark(const std::string& place, double height_m, const std::string& more) {
  return "<Placemark><Point><coordinates>\n " + place + "\n</coordinates></Point>" +
         element("executeHeight", std::to_string(height_m)) + more + "</Placemark>";
}

std::string action(const std::string& name, const std::string& params) {
  return element("actionGroup", element("actionTrigger", element("actionTriggerType", "reachPoint")) +
                                    element("action", element("actionActuatorFunc", name) +
                                                          element("actionActuatorFuncParam", params)));
}

std::string wpml_mission() {
  const std::string rounded = element(
      "waypointTurnParam", element("waypointTurnMode", "coordinateTurn") + element("waypointTurnDampingDist", "3.5"));
  const std::string smooth = element("waypointHeadingParam", element("waypointHeadingMode", "smoothTransition") +
                                                                 element("waypointHeadingAngle", "-45"));
  const std::string poi =
      element("waypointHeadingParam", element("waypointHeadingMode", "towardPOI") +
                                          element("waypointPoiPoint", "35.310300,-80.740000,0.000000"));
  const std::string tilt =
      action("gimbalRotate", element("gimbalRotateMode", "absoluteAngle") + element("gimbalPitchRotateEnable", "1") +
                                 element("gimbalPitchRotateAngle", "-60"));
  const std::string evenly = action("gimbalEvenlyRotate", element("gimbalPitchRotateAngle", "-20"));
  return waylines("relativeToStartPoint",
                  placemark("-80.7402,35.3110", 35, element("waypointSpeed", "4") + smooth + rounded + tilt) +
                      placemark("-80.7390,35.3110", 40, poi + evenly + action("takePhoto", "")) +
                      placemark("-80.7390,35.3096", 40, action("hover", element("hoverTime", "3"))) +
                      placemark("-80.7402,35.3096", 40, ""));
}

TEST(Wpml, WaylinesAreFlown) {
  const Mission mission = read_kml_mission(wpml_mission(), "x.kmz");
  const auto& w = mission.waypoints;
  ASSERT_EQ(w.size(), 4u);
  ASSERT_TRUE(mission.takeoff);
  EXPECT_EQ(mission.takeoff->longitude_deg, -80.7402);
  EXPECT_FALSE(mission.takeoff->height_above_sea_m) << "its reference is not stated";
  EXPECT_EQ(w[0].position.latitude_deg, 35.3110);
  EXPECT_EQ(w[0].position.longitude_deg, -80.7402);
  EXPECT_EQ(w[0].position.height_m, 35);
  EXPECT_EQ(w[0].position.above, HeightAbove::kTakeoff);
  EXPECT_EQ(w[0].speed_m_s, 4);
  EXPECT_EQ(w[1].speed_m_s, 7) << "autoFlightSpeed";
  EXPECT_EQ(w[0].heading.kind, Heading::Kind::kBlend);
  EXPECT_EQ(w[0].heading.deg, -45);
  EXPECT_EQ(w[0].passing.kind, Passing::Kind::kRounded);
  EXPECT_EQ(w[0].passing.distance_m, 3.5);
  EXPECT_EQ(w[0].pitch.kind, Pitch::Kind::kFixed);
  EXPECT_EQ(w[0].pitch.deg, -60);
  EXPECT_EQ(w[1].heading.kind, Heading::Kind::kTarget);
  ASSERT_TRUE(w[1].target);
  EXPECT_EQ(w[1].target->longitude_deg, -80.74);
  EXPECT_EQ(w[1].pitch.kind, Pitch::Kind::kBlend) << "turns evenly up to the next waypoint";
  EXPECT_EQ(w[1].pitch.deg, -60);
  EXPECT_EQ(w[2].pitch.deg, -20);
  EXPECT_EQ(w[2].passing.kind, Passing::Kind::kStop);
  EXPECT_EQ(w[2].passing.hold_s, 3);
  EXPECT_THAT(mission.notes, Contains(HasSubstr("takePhoto (1 time)")));
}

TEST(Wpml, ATakeoffPlaceOfZerosIsNotSet) {
  std::string text = wpml_mission();
  const std::string place = "35.310300,-80.740200,0.000000";
  text.replace(text.find(place), place.size(), "0.000000,0.000000,0.000000");
  const Mission mission = read_kml_mission(text, "x.kmz");
  EXPECT_FALSE(mission.takeoff);
  EXPECT_EQ(mission.waypoints.size(), 4u);
}

TEST(Wpml, TurnsSmoothlyThroughWaypointsWithoutAnAngle) {
  const auto heading = [](const std::string& angle, const std::string& enable) {
    return element("waypointHeadingParam", element("waypointHeadingMode", "smoothTransition") +
                                               element("waypointHeadingAngle", angle) +
                                               element("waypointHeadingAngleEnable", enable));
  };
  const auto headings = [&](const std::vector<std::string>& params) {
    std::string points;
    for (std::size_t i = 0; i < params.size(); ++i)
      points += placemark("-80.7402,35.311" + std::to_string(i), 35, params[i]);
    std::vector<double> all;
    for (const MissionWaypoint& waypoint : read_kml_mission(waylines("WGS84", points), "x.kmz").waypoints)
      all.push_back(waypoint.heading.kind == Heading::Kind::kBlend ? waypoint.heading.deg : -999.0);
    return all;
  };
  EXPECT_THAT(
      headings({heading("10", "1"), heading("0", "0"), heading("0", "0"), heading("40", "1"), heading("0", "0")}),
      testing::ElementsAre(10, 20, 30, 40, 40));
  EXPECT_THAT(headings({heading("0", "0"), heading("0", "0")}), testing::ElementsAre(-999, -999)) << "along the route";
}

TEST(Wpml, HeightModesAreNotMixedUp) {
  const std::string points = placemark("-80.7402,35.3110", 235, "") + placemark("-80.7390,35.3110", 240, "");
  const auto above = [&](const std::string& mode) {
    return read_kml_mission(waylines(mode, points), "x.kmz").waypoints[0].position.above;
  };
  EXPECT_EQ(above("WGS84"), HeightAbove::kEllipsoid);
  EXPECT_EQ(above("relativeToStartPoint"), HeightAbove::kTakeoff);
  EXPECT_EQ(above("realTimeFollowSurface"), HeightAbove::kGround);
  EXPECT_EQ(above("EGM96"), HeightAbove::kSeaLevel);
  EXPECT_THAT(refusal_of([&] { above("GCJ02"); }), HasSubstr("executeHeightMode is 'GCJ02'"));
}

TEST(Wpml, TemplateOfWaypoints) {
  const auto document = [](const std::string& mode) {
    const auto point = [](const std::string& place, const std::string& more) {
      return "<Placemark><Point><coordinates>" + place + "</coordinates></Point>" + more + "</Placemark>";
    };
    return kml("<Folder><wpml:templateType>waypoint</wpml:templateType>" +
               element("waylineCoordinateSysParam", element("coordinateMode", "WGS84") + element("heightMode", mode)) +
               element("globalHeight", "80") + element("autoFlightSpeed", "9") +
               point("-80.7402,35.3110", element("useGlobalHeight", "1") + element("height", "5")) +
               point("-80.7390,35.3110", element("ellipsoidHeight", "202") + element("height", "235")) + "</Folder>");
  };
  const Mission by_sea = read_kml_mission(document("EGM96"), "template.kml");
  ASSERT_EQ(by_sea.waypoints.size(), 2u);
  EXPECT_EQ(by_sea.waypoints[0].position.height_m, 80);
  EXPECT_EQ(by_sea.waypoints[1].position.height_m, 235);
  EXPECT_EQ(by_sea.waypoints[1].position.above, HeightAbove::kSeaLevel);
  EXPECT_EQ(by_sea.waypoints[1].speed_m_s, 9);
  const Mission by_ellipsoid = read_kml_mission(document("WGS84"), "template.kml");
  EXPECT_EQ(by_ellipsoid.waypoints[1].position.height_m, 202);
}

std::string line(const std::string& mode, const std::string& coordinates) {
  return "<Placemark><LineString>" + (mode.empty() ? "" : "<altitudeMode>" + mode + "</altitudeMode>") +
         "<coordinates>" + coordinates + "</coordinates></LineString></Placemark>";
}

TEST(KmlRoute, LinesByTheirAltitudeMode) {
  const std::string tuples = "-80.7402,35.3110,235\n\t-80.7390,35.3110,240 ";
  const Mission absolute = read_kml_mission(kml(line("absolute", tuples)), "x.kml");
  ASSERT_EQ(absolute.waypoints.size(), 2u);
  EXPECT_EQ(absolute.waypoints[1].position.longitude_deg, -80.7390);
  EXPECT_EQ(absolute.waypoints[1].position.height_m, 240);
  EXPECT_EQ(absolute.waypoints[1].position.above, HeightAbove::kSeaLevel);
  const Mission ground = read_kml_mission(kml(line("relativeToGround", tuples)), "x.kml");
  EXPECT_EQ(ground.waypoints[0].position.above, HeightAbove::kGround);
  EXPECT_EQ(ground.waypoints[0].position.height_m, 235);
  for (const char* mode : {"", "clampToGround"})
    EXPECT_FALSE(read_kml_mission(kml(line(mode, tuples)), "x.kml").waypoints[0].position.height_m);
  EXPECT_THAT(refusal_of([&] { read_kml_mission(kml(line("relativeToSeaFloor", tuples)), "x.kml"); }),
              HasSubstr("relativeToSeaFloor"));
  EXPECT_THAT(refusal_of([&] { read_kml_mission(kml(line("absolute", "-80,35 -80.1,35")), "x.kml"); }),
              HasSubstr("without a height"));
}

TEST(KmlRoute, LongLinesAndPoints) {
  std::string tuples;
  for (int i = 0; i < 1000; ++i) tuples += "-80.74,35.3" + std::to_string(1000 + i) + ",200 ";
  EXPECT_EQ(read_kml_mission(kml(line("absolute", tuples)), "x.kml").waypoints.size(), 1000u);
  std::string points;
  for (int i = 0; i < 3; ++i)
    points += "<Placemark><Point><altitudeMode>absolute</altitudeMode><coordinates>-80.74,35.31" + std::to_string(i) +
              ",200</coordinates></Point></Placemark>";
  const Mission mission = read_kml_mission(kml(points), "x.kml");
  ASSERT_EQ(mission.waypoints.size(), 3u);
  EXPECT_EQ(mission.waypoints[2].position.latitude_deg, 35.312);
}

TEST(KmlRoute, Refusals) {
  const auto fault_of = [](const std::string& text) { return refusal_of([&] { read_kml_mission(text, "x.kml"); }); };
  EXPECT_THAT(fault_of(kml("<Placemark><Track><when>x</when></Track></Placemark>")), HasSubstr("recorded track"));
  EXPECT_THAT(fault_of(kml("<Placemark><Polygon/></Placemark>")), HasSubstr("neither a LineString"));
  EXPECT_THAT(fault_of(kml(line("absolute", "-80,35,1,2"))), HasSubstr("longitude,latitude"));
  EXPECT_THAT(fault_of(kml(line("absolute", "35,-80.5,x"))), HasSubstr("'35,-80.5,x'"));
  const std::string whole = wpml_mission();
  EXPECT_THAT(fault_of(whole.substr(0, whole.size() / 2)), HasSubstr("is damaged at line"));
  EXPECT_THAT(fault_of("<!DOCTYPE kml [<!ENTITY a \"b\">]><kml>&a;</kml>"), HasSubstr("document types"));
  EXPECT_THAT(fault_of("<gpx/>"), HasSubstr("not KML"));
}

class MissionFile : public testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const std::string& bytes) {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
    return folder_ / name;
  }
  std::string fault(const std::string& name, const std::string& bytes) {
    return refusal_of([&] { read_mission(write(name, bytes)); });
  }
  tests::TemporaryFolder folder_;
};

TEST_F(MissionFile, KmzIsReadByWhatTheVehicleExecutes) {
  const std::string archive =
      make_zip({{"wpmz/template.kml", kml("<Folder/>")}, {"wpmz/waylines.wpml", wpml_mission()}});
  const auto file = write("mission.kmz", archive);
  EXPECT_TRUE(is_mission_file(file));
  EXPECT_EQ(read_mission(file).waypoints.size(), 4u);
  const auto route = write("route.kmz", make_zip({{"doc.kml", kml(line("absolute", "-80,35,100 -80,35.001,100"))}}));
  EXPECT_EQ(read_mission(route).waypoints.size(), 2u);
}

TEST_F(MissionFile, OtherFilesAreNoMissions) {
  EXPECT_FALSE(is_mission_file(write("flight.yaml", "camera: camera.yaml\nfps: 5\n")));
  EXPECT_FALSE(is_mission_file(write("flow.yaml", "{camera: camera.yaml, fps: 5}")));
  EXPECT_FALSE(is_mission_file(folder_ / "missing.plan"));
  EXPECT_THAT(fault("x.kmz", make_zip({{"readme.txt", "x"}})), HasSubstr("without waylines.wpml"));
  EXPECT_THAT(fault("x.plan", "hello"), HasSubstr("is no mission"));
  EXPECT_THAT(fault("one.kml", kml(line("absolute", "-80,35,100"))), HasSubstr("1 waypoints"));
}

TEST_F(MissionFile, HostileArchivesAreBounded) {
  fetch::test_support::ZipEntry bomb{"doc.kml", std::string(200, 'x')};
  std::string archive = make_zip({bomb});
  // The directory claims 4 GB for the entry.
  const std::size_t directory = archive.find("PK\1\2");
  archive.replace(directory + 24, 4, "\xFF\xFF\xFF\xF0");
  EXPECT_THAT(fault("bomb.kmz", archive), HasSubstr("more than the limit"));
  EXPECT_THAT(fault("cut.kmz", make_zip({bomb}).substr(0, 60)), HasSubstr("ZIP"));
  EXPECT_THAT(fault("path.kmz", make_zip({{"../../doc.kml", kml(line("absolute", "-80,35,9 -80,35.1,x"))}})),
              HasSubstr("'-80,35.1,x'"))
      << "names of entries are only names";
}

}  // namespace
}  // namespace tileflight::missions::kml_test
