// Datasets along the path that an outside autopilot has flown.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/run_program.h"
#include "tests/temporary_folder.h"
#include "tests/tiny_place.h"
#include "tileflight/core/geometry/trajectory.h"

namespace tileflight::autopilot_flight_test {
namespace {

using geometry::Vec3;
using nlohmann::json;
using testing::HasSubstr;
using tests::file_text;
using tests::ProgramResult;
using tests::run_tileflight;
using tests::TinyPlace;

class AutopilotFlights : public ::testing::Test {
 protected:
  AutopilotFlights() {
    TinyPlace::write(folder_ / "place");
    TinyPlace::write_file(folder_ / "camera.yaml", TinyPlace::kCamera);
  }

  /// `command`: of the scripted autopilot, without its name.
  static std::string flight(const std::string& kind, const std::string& command, const std::string& more = "") {
    return "fps: 2\nautopilot: {kind: " + kind + ", start: [-5, -4, 0], command: \"" TILEFLIGHT_SCRIPTED_AUTOPILOT " " +
           kind + " {port} " + command + "\"" + more + "}\n";
  }
  ProgramResult render(const std::string& flight, const std::string& out, std::vector<std::string> options = {}) const {
    TinyPlace::write_file(folder_ / "flight.yaml", "camera: camera.yaml\n" + flight);
    options.insert(options.begin(), {"render", (folder_ / "place").string(), "--flight",
                                     (folder_ / "flight.yaml").string(), "--out", (folder_ / out).string(), "--json"});
    return run_tileflight(options);
  }
  geometry::Trajectory truth(const std::string& out) const {
    return geometry::read_tum(folder_ / out / "groundtruth.txt");
  }

  tests::TemporaryFolder folder_;
};

/// Up to 8 m, 6 m north, and down again.
void check_flight(const geometry::Trajectory& truth) {
  double highest_m = -1e9, northernmost_m = -1e9;
  const Vec3 first = truth.poses.front().T_local_camera.translation;
  for (const geometry::StampedPose& pose : truth.poses) {
    highest_m = std::max(highest_m, pose.T_local_camera.translation.z() - first.z());
    northernmost_m = std::max(northernmost_m, pose.T_local_camera.translation.y() - first.y());
  }
  EXPECT_NEAR(highest_m, 8.0, 0.8);
  EXPECT_NEAR(northernmost_m, 6.0, 0.8);
  // It stands on its feet 0.2 m below its centre at the start, and again at the end.
  EXPECT_NEAR(first.x(), -5.0, 0.1);  // it settles on a slope
  EXPECT_NEAR(first.z(), TinyPlace::height(-5.0, -4.0) + 0.2, 0.15);
  const Vec3 last = truth.poses.back().T_local_camera.translation;
  EXPECT_NEAR(last.z(), TinyPlace::height(last.x(), last.y()) + 0.2, 0.4);
}

TEST_F(AutopilotFlights, ArduPilotsFlightIsADatasetAndTheSameBytesTwice) {
  const std::string plan =
      flight("ardupilot", "lands 0 0,0,-8 6,0,-8", ", wind_m_s: [2, 0, 0], mount: fixed, pitch_deg: -60") +
      "sensors: {imu: {}, gnss: {}}\n";
  const ProgramResult result = render(plan, "first");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json told = json::parse(file_text(folder_ / "first/vehicle.json"));
  EXPECT_EQ(told["outcome"], "finished");
  EXPECT_GT(told["autopilot"]["airborne_s"], 1.0);
  check_flight(truth("first"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "first/imu.csv"));
  ASSERT_EQ(render(plan, "second").exit_code, 0);
  for (const char* file : {"groundtruth.txt", "imu.csv", "times.txt", "images/000010.jpg"})
    EXPECT_EQ(file_text(folder_ / "first" / file), file_text(folder_ / "second" / file)) << file;
}

TEST_F(AutopilotFlights, Px4sFlightIsADatasetAndTheSameBytesTwice) {
  const std::string plan = flight("px4", "lands 0 0,0,-8 6,0,-8");
  ASSERT_EQ(render(plan, "first").exit_code, 0);
  check_flight(truth("first"));
  ASSERT_EQ(render(plan, "second").exit_code, 0);
  EXPECT_EQ(file_text(folder_ / "first/groundtruth.txt"), file_text(folder_ / "second/groundtruth.txt"));
  EXPECT_EQ(file_text(folder_ / "first/images/000010.jpg"), file_text(folder_ / "second/images/000010.jpg"));
}

TEST_F(AutopilotFlights, EndAtTheirDurationInTheAir) {
  const ProgramResult result = render(flight("ardupilot", "lands 0 0,0,-8 6,0,-8", ", duration_s: 5"), "data");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(json::parse(file_text(folder_ / "data/vehicle.json"))["outcome"], "time is over");
  EXPECT_EQ(truth("data").size(), 11U);
  EXPECT_NEAR(truth("data").poses.back().time_s, 5.0, 1e-9);
}

TEST_F(AutopilotFlights, ThatFailAreOneLine) {
  const auto refused = [&](const std::string& plan) {
    const ProgramResult result = render(plan, "data", {"--quiet"});
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    EXPECT_FALSE(std::filesystem::exists(folder_ / "data"));
    return result.err;
  };
  const std::string died = refused(flight("ardupilot", "dies 3 0,0,-8"));
  EXPECT_THAT(died, HasSubstr("has ended (exit status 3) before it had landed, 3.0 s after its start"));
  EXPECT_THAT(died, HasSubstr("it printed last: battery empty at 3 s"));
  EXPECT_THAT(refused(flight("px4", "hangs 3 0,0,-8", ", silence_s: 0.5")), HasSubstr("has been silent for 0.5 s"));
  EXPECT_THAT(refused("fps: 2\nautopilot: {kind: px4, command: sleep 60, connect_timeout_s: 0.5}\n"),
              HasSubstr("(connect_timeout_s)"));
  EXPECT_THAT(refused("fps: 2\nautopilot: {kind: ardupilot, command: no-such-program}\n"),
              HasSubstr("has ended (exit status 127) without a step"));
  EXPECT_THAT(refused("fps: 2\nautopilot: {kind: betaflight}\n"), HasSubstr("ardupilot"));
  EXPECT_THAT(refused("fps: 2\nautopilot: {kind: ardupilot, vision: {source: odometry}}\n"), HasSubstr("px4 only"));
  EXPECT_THAT(refused("fps: 2\nautopilot: {kind: px4, vision: {source: gps}}\n"), HasSubstr("odometry"));
  EXPECT_THAT(refused("fps: 2\nautopilot: {kind: px4, vision: {width: 10}}\n"), HasSubstr("64"));
  EXPECT_THAT(refused("fps: 2\nvehicle: {}\nautopilot: {kind: px4}\n"), HasSubstr("a mission of its own"));
}

TEST_F(AutopilotFlights, WhatTheSimulatorSaysOfThemIsKeptAndANote) {
  const ProgramResult result = render(flight("ardupilot", "stammers 1 0,0,-8", ", duration_s: 3"), "data");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json told = json::parse(file_text(folder_ / "data/vehicle.json"))["autopilot"]["log"];
  ASSERT_EQ(told.size(), 1U) << told;
  EXPECT_THAT(told[0].get<std::string>(), HasSubstr("servo packet"));
  EXPECT_THAT(json::parse(result.out)["warnings"], testing::Contains(told[0]));
}

TEST_F(AutopilotFlights, AreFlownOnce) {
  const ProgramResult result = render(flight("ardupilot", "lands 0 0,0,-8"), "data", {"--frames", "0:4", "--quiet"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("an autopilot flies once"));
}

}  // namespace
}  // namespace tileflight::autopilot_flight_test
