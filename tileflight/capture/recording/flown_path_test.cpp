#include "tileflight/capture/recording/flown_path.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tests/tiny_place.h"
#include "tileflight/capture/recording/flight_cameras.h"

namespace tileflight::recording::flown_path_test {
namespace {

using testing::HasSubstr;
using tests::refusal_of;

/// A mission over the tiny place, whose own frame is east-north-up at 47.0 N, 8.0 E, at height 400 m.
class PlacedMissionFile : public testing::Test {
 protected:
  PlacedMissionFile() {
    tests::TinyPlace::write(folder_ / "place");
    load_.origin = geometry::Geodetic{47.0, 8.0, {400.0}};
  }
  vehicle::FlightPlan plan_of(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
    return vehicle::read_flight_plan(folder_ / name);
  }
  std::string source() const { return (folder_ / "place").string(); }

  tests::TemporaryFolder folder_;
  tileset::LoadOptions load_;
};

// 0.0001 degrees of latitude are 11.118 m here, of longitude 7.606 m (closed form, WGS84).
TEST_F(PlacedMissionFile, CountsHeightsFromTheSurface) {
  vehicle::FlightPlan plan = plan_of("x.waypoints",
                                     "QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t47.0001\t8.0001\t500\t1\n"
                                     "1\t0\t3\t16\t1\t0\t0\t0\t47.0001\t8.0001\t30\t1\n"
                                     "2\t0\t10\t16\t1\t0\t0\t0\t46.9999\t7.9998\t20\t1\n");
  place_mission(plan, source(), load_, {});
  const geometry::Vec3 first = plan.waypoints.front().position, last = plan.waypoints.back().position;
  EXPECT_NEAR(first.x(), 7.606, 2e-3);
  EXPECT_NEAR(first.y(), 11.118, 2e-3);
  EXPECT_NEAR(first.z(), tests::TinyPlace::height(7.606, 11.118) + 30.0, 0.2);
  EXPECT_NEAR(last.x(), -15.212, 3e-3);
  EXPECT_NEAR(last.y(), -11.118, 2e-3);
  EXPECT_NEAR(last.z(), tests::TinyPlace::height(-15.212, -11.118) + 20.0, 0.2);
  EXPECT_THAT(plan.notes, testing::Contains(HasSubstr("take-off")));
}

TEST_F(PlacedMissionFile, NeedsAGeoreferencedPlace) {
  const std::string route =
      "<kml><LineString><altitudeMode>relativeToGround</altitudeMode><coordinates>8,47,9 8,47.0002,9</coordinates>"
      "</LineString></kml>";
  vehicle::FlightPlan plan = plan_of("route.kml", route);
  load_.origin.reset();
  EXPECT_THAT(refusal_of([&] { place_mission(plan, source(), load_, {}); }), HasSubstr("not georeferenced"));
  plan = plan_of("far.kml",
                 "<kml><LineString><altitudeMode>relativeToGround</altitudeMode><coordinates>9,47,9 9,47.1,9"
                 "</coordinates></LineString></kml>");
  load_.origin = geometry::Geodetic{47.0, 8.0, {400.0}};
  EXPECT_THAT(refusal_of([&] { place_mission(plan, source(), load_, {}); }), HasSubstr("no surface"));
}

TEST_F(PlacedMissionFile, CameraOfTheSurveyOrAUsualOne) {
  plan_of("route.kml", "<kml><LineString><coordinates>8,47 8,47.0002</coordinates></LineString></kml>");
  RenderedFlightConfig flight;
  flight.flight = folder_ / "route.kml";
  const MountedCamera usual = read_flight_cameras(flight).at(0);
  EXPECT_EQ(usual.calibration.camera.width(), 1280);
  EXPECT_THAT(usual.calibration.notes, testing::ElementsAre(HasSubstr("names no camera")));
  const std::string parts =
      R"({"command": 16, "frame": 3, "params": [0,0,0,0,47,8,30]}, {"command": 16, "frame": 3, "params": [0,0,0,0,47.001,8,30]})";
  plan_of("survey.plan",
          R"({"fileType": "Plan", "mission": {"items": [{"type": "ComplexItem", "complexItemType": "survey",
          "TransectStyleComplexItem": {"CameraCalc": {"FocalLength": 10, "SensorWidth": 20, "SensorHeight": 15,
          "ImageWidth": 800, "ImageHeight": 600}, "Items": [)" +
              parts + "]}}]}}");
  flight.flight = folder_ / "survey.plan";
  const MountedCamera planned = read_flight_cameras(flight).at(0);
  EXPECT_EQ(planned.calibration.camera.width(), 800);
  EXPECT_EQ(planned.calibration.camera.height(), 600);
  std::ofstream(folder_ / "camera.yaml") << tests::TinyPlace::kCamera;
  flight.camera = folder_ / "camera.yaml";
  EXPECT_EQ(read_flight_cameras(flight).at(0).calibration.camera.width(), 320);
}

}  // namespace
}  // namespace tileflight::recording::flown_path_test
