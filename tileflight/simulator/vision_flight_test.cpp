#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <filesystem>

#include "tileflight/autopilot/test_vision_autopilot.h"
#include "tileflight/simulator/test_world.h"
#include "tileflight/stadium/stadium.h"

/// Flights without a receiver, by the odometry of a camera's pictures.
namespace tileflight::simulator::vision_flight_test {
namespace {

using autopilot::test_support::VisionPx4;
using geometry::Vec3;
using test_world::LoggedLines;

std::uint16_t port_of(const Simulator& simulator) {
  return static_cast<std::uint16_t>(simulator.autopilots().at(0).port);
}

const std::filesystem::path& stadium_place() {
  static const std::filesystem::path kPlace = [] {
    const std::filesystem::path folder =
        std::filesystem::temp_directory_path() / ("tileflight-vision-" + std::to_string(::getpid()));
    stadium::write_stadium(folder, {1, 0.25});
    return folder / "world" / "tileset.json";
  }();
  return kPlace;
}

TEST(VisionFlight, Try) {
  LoggedLines lines;
  SimulatorOptions options;
  options.source = stadium_place().string();
  options.settings = R"({"StepOnDemand": true, "Vehicles": {"PX4": {"VehicleType": "PX4Multirotor", "TcpPort": 0,
    "VisionOdometry": "FromPictures", "VisionRate": 15,
    "Sensors": {"gps": {"SensorType": 3, "Enabled": false}},
    "Cameras": {"bottom_center": {"Pitch": -90, "CaptureSettings": [{"ImageType": 0, "Width": 320, "Height": 240, "FOV_Degrees": 100}]}}}}})";
  Simulator simulator(options, lines.log());
  auto points = autopilot::test_support::lively_start(15);
  for (const Vec3& p : autopilot::test_support::square(20, 15)) points.push_back(p);
  VisionPx4 px4(port_of(simulator), points);
  double worst = 0;
  FILE* out = std::fopen("/tmp/vision_flight.csv", "w");
  FILE* odo = std::fopen("/tmp/vision_odometry.csv", "w");
  std::size_t seen = 0;
  const auto t0 = std::chrono::steady_clock::now();
  while (px4.time_s() < 50 && !px4.autopilot().landed() && px4.round()) {
    const auto& ears = px4.ears();
    const auto& t = px4.truth();
    const auto e = px4.estimator().observation();
    worst = std::max(worst, (t.position_m - e.position_m).norm());
    const auto& q = t.R_ned_body;
    std::fprintf(out, "%.3f %.3f %.3f %.3f %.3f %.3f %.3f %.2f %.2f %.2f %.5f %.5f %.5f %.5f\n", t.time_s, t.position_m.x(), t.position_m.y(), t.position_m.z(),
                 e.position_m.x(), e.position_m.y(), e.position_m.z(), t.velocity_m_s.x(), t.velocity_m_s.y(), t.velocity_m_s.z(), q.w(), q.x(), q.y(), q.z());
    for (; seen < ears.odometries.size(); ++seen) {
      const auto& o = ears.odometries[seen];
      std::fprintf(odo, "%.3f", 1e-6 * o.time_us - 1.0);
      for (float x : o.position_m) std::fprintf(odo, " %.4f", x);
      for (float x : o.attitude_wxyz) std::fprintf(odo, " %.5f", x);
      for (float x : o.velocity_m_s) std::fprintf(odo, " %.4f", x);
      for (float x : o.pose_covariance) std::fprintf(odo, " %.3g", x);
      for (float x : o.velocity_covariance) std::fprintf(odo, " %.3g", x);
      std::fprintf(odo, " %d %d\n", o.resets, o.quality);
    }
  }
  std::fclose(out);
  std::fclose(odo);
  std::printf("wall %.1f s worst %.2f odometries %zu points %zu t %.1f\n",
              std::chrono::duration<double>(std::chrono::steady_clock::now() - t0).count(), worst, seen,
              px4.autopilot().points_reached(), px4.time_s());
  for (const auto& line : lines.lines) std::printf("LOG %s\n", line.c_str());
}

}  // namespace
}  // namespace tileflight::simulator::vision_flight_test
