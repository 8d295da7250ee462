#include "tileflight/capture/vehicle/flight_plan.h"

#include <gmock/gmock.h>
#include <stdlib.h>

#include <fstream>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tests/test_data.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::vehicle::flight_plan_test {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

class FlightPlanFile : public testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  FlightPlan read(const std::string& text) { return read_flight_plan(write("flight.yaml", text)); }
  std::string fault(const std::string& text) {
    return tests::refusal_of([&] { read(text); });
  }
  tests::TemporaryFolder folder_;
};

constexpr const char* kMission = R"(camera: lens/camera.yaml
speed_m_s: 12
fps: 5
max_frames: 40
waypoints:
  - {position: [0, 0, 50], yaw_deg: 90, pitch_deg: -20}
  - {position: [80, 0, 55], look_at: [100, 40, 0], roll_deg: 2}
  - {position: [120, 60, 60], yaw_deg: 10}
)";

constexpr const char* kRoute =
    "<kml><Document><Placemark><LineString><altitudeMode>relativeToGround</"
    "altitudeMode><coordinates>-80.7402,35.3103,35 "
    "-80.7402,35.3110,35</coordinates></LineString></Placemark></Document></kml>";

missions::MissionPlace level_place() {
  return {geometry::LocalFrame({35.3103, -80.7402, {190.0}}), [](const std::vector<missions::GroundPoint>& points) {
            return std::vector<std::optional<double>>(points.size(), 190.0);
          }};
}

TEST_F(FlightPlanFile, MissionFiles) {
  write("route.kml", kRoute);
  FlightPlan plan =
      read("camera: camera.yaml\nfps: 4\nspeed_m_s: 6\nmission_file: {file: route.kml, pitch_deg: -40}\n");
  ASSERT_TRUE(plan.mission_file);
  EXPECT_EQ(plan.mission_file->options.pitch_deg, -40);
  EXPECT_THAT([&] { frame_poses(plan); }, ThrowsMessage<InputError>(HasSubstr("is flown at a place")));
  place_mission(plan, level_place());
  const geometry::Trajectory frames = frame_poses(plan);
  EXPECT_LT((frames.poses.front().T_local_camera.translation - geometry::Vec3(0, 0, 35)).norm(), 1e-6);
  // The latitude's 0.0007 degrees by the closed form of geodetic coordinates.
  EXPECT_LT((frames.poses.back().T_local_camera.translation - geometry::Vec3(0, 77.665141, 34.999526)).norm(), 0.5);
  EXPECT_LT((frames.poses[20].T_local_camera.rotation * geometry::Vec3::UnitZ() -
             geometry::Vec3(0, std::cos(0.698131701), -std::sin(0.698131701)))
                .norm(),
            1e-6);
  EXPECT_EQ(plan.limits.speed_m_s, 6);
  EXPECT_THAT(referenced_files(folder_ / "flight.yaml"), testing::Contains(folder_ / "route.kml"));
  EXPECT_TRUE(read("camera: c.yaml\nfps: 4\nmission_file: route.kml\nvehicle: {}\n").vehicle);
  EXPECT_THAT(fault("camera: c.yaml\nmission_file: route.kml\n"), HasSubstr("fps"));
  EXPECT_THAT(fault("camera: c.yaml\nfps: 4\nmission_file: {pitch_deg: 3}\n"), HasSubstr("name the mission file"));
  EXPECT_THAT(fault("camera: c.yaml\nfps: 4\nmission_file: {file: route.kml, pich_deg: 3}\n"), HasSubstr("pitch_deg"));
  EXPECT_THAT(fault("camera: c.yaml\nfps: 4\nmission_file: route.kml\nwaypoints: [{position: [0, 0, 9]}]\n"),
              HasSubstr("a path of its own"));
}

TEST_F(FlightPlanFile, AMissionInPlaceOfAFlightFile) {
  FlightPlan plan = read_flight_plan(write("route.kml", kRoute));
  EXPECT_TRUE(plan.camera.empty());
  EXPECT_EQ(plan.fps, kMissionFps);
  place_mission(plan, level_place());
  EXPECT_GT(frame_poses(plan).size(), 40u);
  EXPECT_THAT(plan.notes, testing::Contains(HasSubstr("without a flight file")));
  EXPECT_THAT(referenced_files(folder_ / "route.kml"), testing::ElementsAre(folder_ / "route.kml"));
}

TEST_F(FlightPlanFile, WaypointsWithSpeedsAndRests) {
  const FlightPlan plan = read(
      "camera: c.yaml\nfps: 10\nspeed_m_s: 8\nwaypoints:\n- {position: [0, 0, 9], speed_m_s: 3}\n"
      "- {position: [60, 0, 9], hold_s: 4}\n- {position: [120, 0, 9]}\n");
  EXPECT_EQ(plan.waypoints[0].speed_m_s, 3);
  EXPECT_EQ(plan.waypoints[1].hold_s, 4);
  const flight_path::Path path = build_path(plan);
  double resting_s = 0.0, first_m_s = 0.0, second_m_s = 0.0;
  for (double t = 0.0; t < path.end_s(); t += 0.01) {
    const double x = path.pose(t).translation.x(), speed_m_s = path.velocity(t).norm();
    if (std::abs(x - 60) < 1e-6 && speed_m_s < 1e-6) resting_s += 0.01;
    (x < 60 ? first_m_s : second_m_s) = std::max(x < 60 ? first_m_s : second_m_s, speed_m_s);
  }
  EXPECT_NEAR(resting_s, 4.0, 0.05);
  EXPECT_NEAR(first_m_s, 3.0, 0.05);
  EXPECT_NEAR(second_m_s, 8.0, 0.1);
  EXPECT_THAT(fault("camera: c.yaml\nfps: 10\nwaypoints:\n- {position: [0, 0, 9], hold_s: -1}\n"), HasSubstr("hold_s"));
}

TEST_F(FlightPlanFile, Waypoints) {
  const FlightPlan plan = read(kMission);
  EXPECT_EQ(plan.camera, folder_ / "lens/camera.yaml");
  EXPECT_FALSE(plan.poses.has_value());
  ASSERT_EQ(plan.waypoints.size(), 3u);
  EXPECT_EQ(plan.waypoints[0].yaw_deg, 90);
  EXPECT_EQ(plan.waypoints[0].pitch_deg, -20);
  EXPECT_EQ(plan.waypoints[1].look_at, geometry::Vec3(100, 40, 0));
  EXPECT_EQ(plan.waypoints[1].roll_deg, 2);
  EXPECT_EQ(plan.limits.speed_m_s, 12);
  EXPECT_EQ(plan.limits.acceleration_m_s2, flight_path::SpeedLimits{}.acceleration_m_s2);
  EXPECT_EQ(plan.fps, 5);
  EXPECT_EQ(plan.max_frames, 40);
  const geometry::Trajectory frames = frame_poses(plan);
  ASSERT_EQ(frames.size(), 40u);
  for (std::size_t i = 0; i < frames.size(); ++i)
    EXPECT_DOUBLE_EQ(frames.poses[i].time_s, 0.2 * static_cast<double>(i));
}

TEST_F(FlightPlanFile, PosesOfAFileAsTheyAreOrSampled) {
  write("poses.txt", "10 0 0 0 0 0 0 1\n11 1 0 0 0 0 0 1\n12 2 0 0 0 0 0 1\n");
  const geometry::Trajectory as_they_are = frame_poses(read("camera: c.yaml\ntrajectory: poses.txt\n"));
  ASSERT_EQ(as_they_are.size(), 3u);
  EXPECT_EQ(as_they_are.poses[1].time_s, 11);
  EXPECT_EQ(frame_poses(read("camera: c.yaml\ntrajectory: poses.txt\nmax_frames: 2\n")).size(), 2u);
  const geometry::Trajectory sampled = frame_poses(read("camera: c.yaml\ntrajectory: poses.txt\nfps: 4\n"));
  ASSERT_EQ(sampled.size(), 9u);
  EXPECT_DOUBLE_EQ(sampled.poses[8].time_s, 12);
  EXPECT_NEAR(sampled.poses[5].T_local_camera.translation.x(), 1.25, 1e-12);
}

TEST_F(FlightPlanFile, PosesOfAFileSmoothed) {
  std::string poses;
  for (int i = 0; i < 40; ++i)
    poses += std::to_string(i) + " " + std::to_string(2 * i) + (i % 2 == 0 ? " 0.1" : " -0.1") + " 0 0 0 0 1\n";
  write("poses.txt", poses);
  const std::string plan = "camera: c.yaml\ntrajectory: poses.txt\n";
  EXPECT_EQ(frame_poses(read(plan + "smooth: none\n")).poses[20].T_local_camera.translation.y(), 0.1);
  for (const std::string smooth : {"smooth: auto\n", "smooth: 10\n"}) {
    const geometry::Trajectory frames = frame_poses(read(plan + smooth));
    ASSERT_EQ(frames.size(), 40u);
    EXPECT_LT(frames.poses[20].T_local_camera.translation.cwiseAbs().y(), 0.03);
    EXPECT_NEAR(frames.poses[20].T_local_camera.translation.x(), 40, 1e-5);
    EXPECT_EQ(frame_poses(read(plan + smooth + "fps: 2\n")).size(), 79u);
  }
  EXPECT_THAT(fault(plan + "smooth: 0\n"), HasSubstr("must be 'auto', 'none' or the seconds between two knots"));
  EXPECT_THAT(fault(std::string(kMission) + "smooth: auto\n"), HasSubstr("applies to a 'trajectory'"));
}

TEST_F(FlightPlanFile, VariablesAreFilledIn) {
  setenv("TILEFLIGHT_FLIGHT_TEST", (folder_ / "deep").c_str(), 1);
  EXPECT_EQ(read(std::string(kMission).replace(8, 4, "${TILEFLIGHT_FLIGHT_TEST}")).camera,
            folder_ / "deep/camera.yaml");
  EXPECT_EQ(read(std::string(kMission).replace(8, 4, "${TILEFLIGHT_NOT_SET:-other}")).camera,
            folder_ / "other/camera.yaml");
  EXPECT_THAT(fault("camera: ${TILEFLIGHT_NOT_SET}/c.yaml\n"),
              HasSubstr("flight.yaml:1: the environment variable TILEFLIGHT_NOT_SET is not set"));
  EXPECT_THAT(fault("camera: ${TILEFLIGHT\n"), HasSubstr("'${' without '}'"));
}

TEST_F(FlightPlanFile, MistakesAreNamedWithTheirLine) {
  const std::string waypoints = "waypoints:\n  - {position: [0, 0, 1]}\n  - {position: [9, 0, 1]}\n";
  const std::string start = "camera: c.yaml\nfps: 5\n";
  EXPECT_THAT(fault(start + "sped_m_s: 3\n" + waypoints),
              HasSubstr("flight.yaml:3: 'sped_m_s' is not a key here; did you mean 'speed_m_s'?"));
  EXPECT_THAT(fault(start + "waypoints:\n  - {position: [0, 0, 1], lok_at: [1, 2, 3]}\n"),
              HasSubstr("flight.yaml:4: 'waypoints[0].lok_at' is not a key here; did you mean 'look_at'?"));
  EXPECT_THAT(fault(start + "waypoints:\n  - {position: [0, 0]}\n"),
              HasSubstr("'waypoints[0].position' must be a list of 3 numbers"));
  EXPECT_THAT(fault(start + "waypoints:\n  - {position: [0, 0, .nan]}\n"), HasSubstr("must be a list of numbers"));
  EXPECT_THAT(fault(start + "waypoints:\n  - {yaw_deg: 3}\n"), HasSubstr("'waypoints[0].position' is missing"));
  EXPECT_THAT(fault(start + "waypoints:\n  - 7\n"), HasSubstr("'waypoints[0]' must be a map of keys"));
  EXPECT_THAT(fault(start + "waypoints:\n  - {position: [0, 0, 1], look_at: [1, 0, 0], yaw_deg: 4}\n"),
              HasSubstr("'waypoints[0].look_at' and yaw_deg or pitch_deg are both given"));
  EXPECT_THAT(fault(start + "waypoints: 5\n"), HasSubstr("'waypoints' must be a list"));
  EXPECT_THAT(fault(start), HasSubstr("'waypoints' must be at least two, or 'trajectory' must name a TUM file"));
  EXPECT_THAT(fault("camera: c.yaml\n" + waypoints), HasSubstr("'fps' is missing"));
  EXPECT_THAT(fault("fps: 5\n" + waypoints), HasSubstr("'camera' is missing"));
  EXPECT_THAT(fault("camera: c.yaml\nfps: -5\n" + waypoints), HasSubstr("flight.yaml:2: 'fps' must be more than 0"));
  EXPECT_THAT(fault(start + "max_frames: 2.5\n" + waypoints), HasSubstr("'max_frames' must be a whole number"));
  EXPECT_THAT(fault(start + "trajectory: absent.txt\n"), HasSubstr("absent.txt"));
  EXPECT_THAT(fault("camera: [\n"), HasSubstr("not valid YAML"));
  EXPECT_THAT(fault("just text"), HasSubstr("the file must be a map of keys"));
  EXPECT_THAT(fault(""), HasSubstr("the file must be a map of keys"));
}

TEST_F(FlightPlanFile, AVehicleFliesWaypointsOrAMission) {
  const FlightPlan plan = read(std::string(kMission) + "vehicle: {wind_m_s: [3, 0, 0]}\n");
  ASSERT_TRUE(plan.vehicle.has_value());
  const geometry::Trajectory frames = frame_poses(plan), planned = frame_poses(read(kMission));
  ASSERT_EQ(frames.size(), planned.size());
  double furthest = 0;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const geometry::Vec3& is = frames.poses[i].T_local_camera.translation;
    furthest = std::max(furthest, (is - planned.poses[i].T_local_camera.translation).norm());
  }
  EXPECT_GT(furthest, 1e-3);
  EXPECT_LT(furthest, 1.0);
  const std::string start = "camera: c.yaml\nfps: 5\n", hover = "mission:\n  - {do: hover, duration_s: 2}\n";
  EXPECT_EQ(frame_poses(read(start + "vehicle: {start: [0, 0, 9]}\n" + hover)).size(), 11u);
  EXPECT_THAT(fault(start + hover), HasSubstr("'mission' is flown by a vehicle"));
  EXPECT_THAT(fault(std::string(kMission) + "vehicle: {}\n" + hover), HasSubstr("'mission' and 'waypoints'"));
  EXPECT_THAT(fault(std::string(kMission) + "vehicle: {wind_m_s: [1e9, 0, 0]}\n"), HasSubstr("at most 100 m/s"));
  for (const char* step :
       {"do: hover, duration_s: 1e12", "do: hover, duration_s: -1", "do: takeoff, timeout_s: 3601",
        "do: turn_rate, yaw_rate_deg_s: 5, duration_s: 4e3", "do: velocity, velocity_m_s: [0, 0, 1], duration_s: .inf"})
    EXPECT_NE(fault(start + "vehicle: {}\nmission: [{" + step + "}]\n"), "no error") << step;
  EXPECT_THAT(fault(start + "vehicle: {}\nmission: [{do: hover, duration_s: 1e12}]\n"),
              HasSubstr("'mission[0].duration_s' must be from 0 to 3600 seconds"));
  EXPECT_THAT(fault(std::string(kMission) + "vehicle: {wnd: 3}\n"), HasSubstr("'vehicle.wnd' is not a key here"));
}

TEST_F(FlightPlanFile, TooManyFramesAreRefused) {
  EXPECT_THAT(
      [&] {
        frame_poses(
            read("camera: c.yaml\nfps: 1e9\nwaypoints:\n  - {position: [0, 0, 1]}\n  - {position: [9, 0, 1]}\n"));
      },
      ThrowsMessage<InputError>(HasSubstr("more than ten million frames")));
}

TEST(RealFlight, MachangaraPosesComeBackAtTheirFrames) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "flights/machangara-a");
  FlightPlan plan;
  plan.poses = geometry::read_tum(folder / "groundtruth.txt");
  EXPECT_EQ(frame_poses(plan).size(), 600u);
  plan.fps = 30;
  const geometry::Trajectory frames = frame_poses(plan);
  ASSERT_EQ(frames.size(), 600u);
  for (std::size_t i = 0; i < 600; ++i) {  // the file's times are rounded to a microsecond
    EXPECT_LT((frames.poses[i].T_local_camera.translation - plan.poses->poses[i].T_local_camera.translation).norm(),
              1e-4);
  }
}

}  // namespace
}  // namespace tileflight::vehicle::flight_plan_test
