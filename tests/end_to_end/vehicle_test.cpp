// A quadrotor that carries the camera over a small place whose height is known everywhere.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/run_program.h"
#include "tests/temporary_folder.h"
#include "tests/tiny_place.h"
#include "tileflight/core/geometry/trajectory.h"

namespace tileflight::vehicle_test {
namespace {

using geometry::Vec3;
using nlohmann::json;
using tests::file_text;
using tests::ProgramResult;
using tests::run_tileflight;
using tests::TinyPlace;

class VehicleFlights : public ::testing::Test {
 protected:
  VehicleFlights() {
    TinyPlace::write(folder_ / "place");
    TinyPlace::write_file(folder_ / "camera.yaml", TinyPlace::kCamera);
  }

  ProgramResult render(const std::string& flight) const {
    TinyPlace::write_file(folder_ / "flight.yaml", "camera: camera.yaml\n" + flight);
    return run_tileflight({"render", (folder_ / "place").string(), "--flight", (folder_ / "flight.yaml").string(),
                           "--out", (folder_ / "data").string(), "--json", "--force"});
  }
  json vehicle() const { return json::parse(file_text(folder_ / "data/vehicle.json")); }
  geometry::Trajectory truth() const { return geometry::read_tum(folder_ / "data/groundtruth.txt"); }

  tests::TemporaryFolder folder_;
};

TEST_F(VehicleFlights, WaypointsInWindAndHowNearItCameToThem) {
  const ProgramResult result = render(R"(fps: 4
speed_m_s: 6
waypoints:
  - {position: [-20, -10, 115], yaw_deg: 90, pitch_deg: -50}
  - {position: [0, 5, 118], yaw_deg: 60, pitch_deg: -60}
vehicle: {wind_m_s: [4, 0, 0], turbulence: light, collision: stop}
)");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json told = vehicle();
  EXPECT_EQ(told["outcome"], "finished");
  EXPECT_EQ(told["collisions"], 0);
  EXPECT_LT(told["tracking"]["rms_m"], 0.4);
  EXPECT_GT(told["tracking"]["max_m"], 0.001);
  ASSERT_EQ(told["tracking"]["waypoints_m"].size(), 2U);
  EXPECT_THAT(result.out, testing::Not(testing::HasSubstr("off its plan")));
  EXPECT_LT((truth().poses.front().T_local_camera.translation - Vec3(-20, -10, 115)).norm(), 0.3);
}

TEST_F(VehicleFlights, AWindThatIsTooStrongForItIsTold) {
  const ProgramResult result = render(R"(fps: 2
waypoints:
  - {position: [-10, -10, 115], pitch_deg: -50}
  - {position: [0, 0, 118], pitch_deg: -60}
vehicle: {wind_m_s: [28, 0, 0]}
)");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, testing::HasSubstr("m off its plan"));
  EXPECT_GT(vehicle()["tracking"]["max_m"], 5.0);
}

TEST_F(VehicleFlights, AMissionIntoTheGroundEndsWhereItTouches) {
  const ProgramResult result = render(R"(fps: 5
mission:
  - {do: go_to, position: [12, 6, 80], speed_m_s: 6}
vehicle: {start: [-5, -4, 112], collision: stop, radius_m: 0.4, pitch_deg: -40}
)");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, testing::HasSubstr("the vehicle did not finish: collided"));
  const json told = vehicle();
  EXPECT_EQ(told["outcome"], "collided");
  EXPECT_EQ(told["mission"][0]["do"], "go_to");
  const json& point = told["last_collision"]["point"];
  EXPECT_NEAR(point[2], TinyPlace::height(point[0], point[1]), 0.1);
  for (const geometry::StampedPose& pose : truth().poses) {
    const Vec3& p = pose.T_local_camera.translation;
    EXPECT_GT(p.z(), TinyPlace::height(p.x(), p.y()) + 0.3);
  }
  EXPECT_NEAR(truth().poses.back().time_s, told["duration_s"], 0.21);
}

TEST_F(VehicleFlights, AKeyThatIsNotOneIsRefused) {
  const ProgramResult result = render("fps: 5\nmission: [{do: hover}]\nvehicle: {colision: stop}\n");
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, testing::HasSubstr("did you mean 'collision'?"));
}

}  // namespace
}  // namespace tileflight::vehicle_test
