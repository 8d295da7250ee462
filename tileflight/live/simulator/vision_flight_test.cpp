#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <random>

#include "tests/refusal.h"
#include "tileflight/core/base/files.h"
#include "tileflight/live/autopilot/test_vision_autopilot.h"
#include "tileflight/live/simulator/test_world.h"
#include "tileflight/live/simulator/vision_input.h"
#include "tileflight/tiles/demo_place/stadium.h"

/// Flights without a receiver, by the odometry of a camera's pictures.
namespace tileflight::simulator::vision_flight_test {
namespace {

using autopilot::test_support::VisionPx4;
using geometry::Vec3;
using test_world::LoggedLines;

constexpr const char* kWithoutReceiver = R"({"StepOnDemand": true, "Vehicles": {"PX4": {"VehicleType": "PX4Multirotor",
  "TcpPort": 0, "VisionOdometry": "FromPictures", "Sensors": {"gps": {"SensorType": 3, "Enabled": false}},
  "Cameras": {"bottom_center": {"Pitch": -90, "CaptureSettings": [{"ImageType": 0, "Width": 240, "Height": 180,
    "FOV_Degrees": 100}]}}}}})";
constexpr std::uint64_t kLatency_us = 100'000, kExposures_us = 68'000;  // 15 a second, in steps of 4 ms

std::uint16_t port_of(const Simulator& simulator) {
  return static_cast<std::uint16_t>(simulator.autopilots().at(0).port);
}

/// Ground with a random texture, and boxes on it.
std::vector<imaging::TexturedMesh> textured_ground() {
  std::mt19937 random(7);
  const auto colour = [&] {
    return imaging::Rgb8{static_cast<std::uint8_t>(60 + random() % 160), static_cast<std::uint8_t>(60 + random() % 160),
                         static_cast<std::uint8_t>(60 + random() % 160)};
  };
  constexpr double kHalf_m = 60.0;
  imaging::TexturedMesh ground;
  ground.name = "ground";
  ground.mesh.vertices = {
      {-kHalf_m, -kHalf_m, 0}, {kHalf_m, -kHalf_m, 0}, {kHalf_m, kHalf_m, 0}, {-kHalf_m, kHalf_m, 0}};
  ground.mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  ground.uv = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  imaging::RgbImage texture(256, 256);
  for (imaging::Rgb8& pixel : texture.pixels) pixel = colour();
  ground.texture = std::make_shared<const imaging::RgbImage>(std::move(texture));
  std::vector<imaging::TexturedMesh> meshes{ground};
  for (int i = 0; i < 60; ++i) {
    const double x = -30.0 + 60.0 * (random() % 1000) / 1000.0, y = -30.0 + 60.0 * (random() % 1000) / 1000.0;
    if (std::hypot(x, y) < 3.0) continue;  // the vehicle stands there
    const geometry::Box3 bounds(Vec3(x, y, 0), Vec3(x + 1.5, y + 1.5, 1.0 + random() % 3));
    meshes.push_back(test_world::box("box-" + std::to_string(i), bounds, colour()));
  }
  return meshes;
}

std::unique_ptr<Simulator> over_textured_ground(LoggedLines& lines) {
  SimulatorOptions options;
  options.settings = kWithoutReceiver;
  return std::make_unique<Simulator>(options, textured_ground(), lines.log());
}

/// The path by the messages, in the truth's frame where the first one was taken.
struct SeenPath {
  double worst_m = 0.0, worst_sigmas = 0.0, velocity2 = 0.0;
  int count = 0;
  std::optional<geometry::SE3> T_ned_vision;

  /// `truth`: at the time of the exposure.
  void add(const autopilot::Odometry& seen, const autopilot::test_support::Observation& truth) {
    const auto v = [](const auto& a) { return Vec3(a[0], a[1], a[2]); };
    const Eigen::Quaterniond q(seen.attitude_wxyz[0], seen.attitude_wxyz[1], seen.attitude_wxyz[2],
                               seen.attitude_wxyz[3]);
    if (!T_ned_vision) {
      const auto heading = [](const Eigen::Quaterniond& R) {
        return std::atan2((R * Vec3::UnitX()).y(), (R * Vec3::UnitX()).x());
      };
      const Eigen::Quaterniond turn(Eigen::AngleAxisd(heading(truth.R_ned_body) - heading(q), Vec3::UnitZ()));
      T_ned_vision = geometry::SE3(turn, truth.position_m - turn * v(seen.position_m));
    }
    const double error_m = (*T_ned_vision * v(seen.position_m) - truth.position_m).norm();
    const auto& c = seen.pose_covariance;
    worst_m = std::max(worst_m, error_m);
    worst_sigmas = std::max(worst_sigmas, error_m / std::sqrt(c[0] + c[6] + c[11]));
    velocity2 += (v(seen.velocity_m_s) - truth.R_ned_body.conjugate() * truth.velocity_m_s).squaredNorm() / 3.0;
    ++count;
  }
  double velocity_error_m_s() const { return std::sqrt(velocity2 / count); }
};

TEST(VisionFlight, ASquareOverTheStadiumWithoutAReceiver) {
  const auto folder = base::make_temporary_path(std::filesystem::temp_directory_path() / "tileflight-stadium");
  const base::RemovedOnExit removal(folder);
  demo_place::write_stadium(folder, {.seed = 1, .texture_scale = 0.15, .twin = false});
  LoggedLines lines;
  SimulatorOptions options;
  options.source = (folder / "world" / "tileset.json").string();
  options.settings = kWithoutReceiver;
  Simulator simulator(options, lines.log());
  constexpr double kSide_m = 14.0, kHeight_m = 12.0;
  std::vector<Vec3> points = autopilot::test_support::lively_start(kHeight_m);
  const std::size_t lively = points.size();
  for (const Vec3& point : autopilot::test_support::square(kSide_m, kHeight_m)) points.push_back(point);
  VisionPx4 px4(port_of(simulator), points);
  SeenPath path;
  Vec3 begun_m = Vec3::Zero();
  std::vector<autopilot::test_support::Observation> truth;  // at each step
  while (px4.autopilot().points_reached() < points.size() && px4.time_s() < 70.0) {
    const std::size_t before = px4.ears().odometries.size();
    ASSERT_TRUE(px4.round());
    truth.push_back(px4.truth());
    if (px4.autopilot().points_reached() <= lively) begun_m = px4.truth().position_m;
    if (px4.ears().odometries.size() == before) continue;
    const autopilot::Odometry& seen = px4.ears().odometries.back();
    EXPECT_EQ(px4.ears().sensor.time_us - seen.time_us, kLatency_us);
    EXPECT_EQ((seen.time_us - 1'000'000) % kExposures_us, 0U);
    EXPECT_EQ(seen.frame, 20);        // MAV_FRAME_LOCAL_FRD
    EXPECT_EQ(seen.child_frame, 12);  // MAV_FRAME_BODY_FRD
    EXPECT_EQ(seen.resets, 0);
    path.add(seen, truth[(seen.time_us - 1'000'000) / 4000]);
  }
  EXPECT_EQ(px4.autopilot().points_reached(), points.size());
  EXPECT_FALSE(px4.ears().gps.has_value());
  EXPECT_EQ(lines.count("is metric"), 1U);
  EXPECT_GT(path.count, 200);
  EXPECT_LT(path.worst_m, 0.03 * 4.0 * kSide_m);
  EXPECT_LT(path.worst_sigmas, 4.0);
  EXPECT_LT(path.velocity_error_m_s(), 0.15);
  EXPECT_LT((px4.truth().position_m - begun_m).norm(), 2.0);  // back where the square began
  RecordProperty("worst_m", std::to_string(path.worst_m));
  RecordProperty("velocity_error_m_s", std::to_string(path.velocity_error_m_s()));
  RecordProperty("worst_sigmas", std::to_string(path.worst_sigmas));
}

/// The camera sees the stadium in the low sun, and is located in tiles without light and shadows.
TEST(VisionFlight, ASquareOverTheStadiumByItsTilesWithoutAReceiver) {
  const auto folder = base::make_temporary_path(std::filesystem::temp_directory_path() / "tileflight-stadium");
  const base::RemovedOnExit removal(folder);
  demo_place::write_stadium(folder, {.seed = 1, .texture_scale = 0.3, .twin = false});
  LoggedLines lines;
  SimulatorOptions options;
  options.source = (folder / "world" / "tileset.json").string();
  auto settings = nlohmann::json::parse(kWithoutReceiver);
  settings["Vehicles"]["PX4"].update({{"VisionOdometry", "FromPlace"}, {"VisionPlace", options.source}});
  options.settings = settings.dump();
  Simulator simulator(options, lines.log());
  simulator.environment().set_time_of_day(true, "2024-06-21 18:30:00", false, 1.0F, 60.0F, true);
  constexpr double kSide_m = 14.0, kHeight_m = 12.0;
  const std::vector<Vec3> points = autopilot::test_support::square(kSide_m, kHeight_m);
  VisionPx4 px4(port_of(simulator), points);
  std::vector<autopilot::test_support::Observation> truth;  // at each step
  double squares = 0.0, ratios = 0.0, worst_m = 0.0, velocity2 = 0.0, count = 0.0, high = 0.0, aloft_s = 0.0;
  while (px4.autopilot().points_reached() < points.size() && px4.time_s() < 60.0) {
    const std::size_t before = px4.ears().odometries.size();
    ASSERT_TRUE(px4.round());
    truth.push_back(px4.truth());
    if (px4.ears().odometries.size() == before) continue;
    const autopilot::Odometry& seen = px4.ears().odometries.back();
    EXPECT_EQ(px4.ears().sensor.time_us - seen.time_us, kLatency_us);
    EXPECT_EQ(seen.frame, 1);  // MAV_FRAME_LOCAL_NED
    const auto& then = truth[(seen.time_us - 1'000'000) / 4000];
    const auto v = [](const auto& a) { return Vec3(a[0], a[1], a[2]); };
    const double error2 = (v(seen.position_m) - then.position_m).squaredNorm();
    const auto& c = seen.pose_covariance;
    squares += error2, count += 1.0;
    constexpr double kHigh_m = 6.0;  // below, a texel is larger than a pixel, and the sigmas are too small
    if (then.position_m.z() < -kHigh_m) ratios += error2 / (c[0] + c[6] + c[11]), high += 1.0;
    velocity2 += (v(seen.velocity_m_s) - then.R_ned_body.conjugate() * then.velocity_m_s).squaredNorm() / 3.0;
    worst_m = std::max(worst_m, std::sqrt(error2));
    aloft_s = px4.time_s();
  }
  EXPECT_EQ(px4.autopilot().points_reached(), points.size());
  EXPECT_EQ(lines.count("is located in the place"), 1U);
  EXPECT_EQ(lines.count("is lost"), 0U);
  ASSERT_GT(count, 200.0);
  EXPECT_LT(px4.time_s() - aloft_s, 0.5);
  EXPECT_LT(std::sqrt(squares / count), 0.05);
  EXPECT_LT(worst_m, 0.3);
  EXPECT_LT(ratios / high, 4.0);
  EXPECT_LT(std::sqrt(velocity2 / count), 0.1);
  const ObservedVehicle viewed = simulator.viewer().observe().vehicles.at(0);
  ASSERT_TRUE(viewed.location);
  EXPECT_LT((viewed.location->T_local_body.translation - viewed.T_local_body.translation).norm(), 1.0)
      << "a moment ago";
  EXPECT_LT(viewed.location->T_local_body.rotation.angularDistance(viewed.T_local_body.rotation), 0.1);
  EXPECT_GT(viewed.location->position_covariance_m2.trace(), 0.0);
  EXPECT_LT((viewed.location->velocity_m_s - viewed.velocity_m_s).norm(), 1.5);
  RecordProperty("rms_m", std::to_string(std::sqrt(squares / count)));
  RecordProperty("worst_m", std::to_string(worst_m));
  RecordProperty("ratio", std::to_string(ratios / high));
  RecordProperty("velocity_error_m_s", std::to_string(std::sqrt(velocity2 / count)));
}

/// The camera looks at the sky, which no tiles show.
TEST(VisionFlight, TilesInWhichNoPictureIsFoundAreTold) {
  const auto folder = base::make_temporary_path(std::filesystem::temp_directory_path() / "tileflight-stadium");
  const base::RemovedOnExit removal(folder);
  demo_place::write_stadium(folder, {.seed = 1, .texture_scale = 0.15, .twin = false});
  LoggedLines lines;
  SimulatorOptions options;
  options.source = (folder / "world" / "tileset.json").string();
  auto settings = nlohmann::json::parse(kWithoutReceiver);
  settings["Vehicles"]["PX4"].update({{"VisionOdometry", "FromPlace"}, {"VisionPlace", options.source}});
  options.settings = settings.dump();
  Simulator simulator(options, lines.log());
  simulator.cameras().set_camera_pose("bottom_center", {{}, {std::sqrt(0.5F), 0.0F, std::sqrt(0.5F), 0.0F}}, "PX4",
                                      false);
  VisionPx4 px4(port_of(simulator), {{0, 0, -5}, {5, 0, -5}, {0, 0, -5}, {5, 0, -5}});
  while (lines.count("is lost") == 0 && px4.time_s() < 40.0) ASSERT_TRUE(px4.round());
  EXPECT_EQ(lines.count("ODOMETRY stops until it is located again"), 1U);
  EXPECT_EQ(lines.count("is located in the place"), 0U);
  const double told_s = px4.time_s();
  while (px4.time_s() < told_s + 2.0) ASSERT_TRUE(px4.round());
  EXPECT_EQ(lines.count("is lost"), 1U);
  EXPECT_TRUE(px4.ears().odometries.empty());
}

/// Flown twice for as long as it takes until some messages have come; then the camera looks at the sky.
TEST(VisionFlight, SamePacketsSameBytesAndLostVisionIsToldOnceAndStops) {
  constexpr std::size_t kMessages = 12;
  double compared_s = 0.0;
  std::string first;
  for (int run = 0; run < 2; ++run) {
    LoggedLines lines;
    const auto simulator = over_textured_ground(lines);
    VisionPx4 px4(port_of(*simulator), autopilot::test_support::lively_start(10.0));
    if (run == 0) {
      while (px4.ears().odometries.size() < kMessages && px4.time_s() < 30.0) ASSERT_TRUE(px4.round());
      compared_s = px4.time_s();
      first = px4.ears().heard();
      continue;
    }
    while (px4.time_s() < compared_s) ASSERT_TRUE(px4.round());
    EXPECT_TRUE(first == px4.ears().heard());
    ASSERT_GE(px4.ears().odometries.size(), kMessages);
    EXPECT_EQ(lines.count("is metric"), 1U);
    simulator->cameras().set_camera_pose("bottom_center", {{}, {std::sqrt(0.5F), 0.0F, std::sqrt(0.5F), 0.0F}}, "PX4",
                                         false);
    while (px4.time_s() < compared_s + 0.5) ASSERT_TRUE(px4.round());
    const std::size_t seen = px4.ears().odometries.size();
    while (px4.time_s() < compared_s + 3.0) ASSERT_TRUE(px4.round());
    EXPECT_EQ(px4.ears().odometries.size(), seen);
    EXPECT_EQ(lines.count("is lost"), 1U);
    EXPECT_TRUE(simulator->ping());
    RecordProperty("compared_s", std::to_string(compared_s));
  }
}

TEST(VisionFlight, SettingsNameACameraOfTheVehicle) {
  const auto read = [](const std::string& keys) {
    return read_settings(
        R"({"Vehicles": {"PX4": {"VehicleType": "PX4Multirotor", "VisionOdometry": "FromPictures")" + keys + "}}}",
        "s");
  };
  const VisionSettings plain = read("").vehicles.at(0).autopilot->vision;
  EXPECT_EQ(plain.source, VisionSource::kPictures);
  EXPECT_EQ(plain.camera, "bottom_center");
  EXPECT_EQ(plain.rate_hz, 15.0);
  EXPECT_EQ(plain.latency_s, 0.1);
  EXPECT_EQ(read(R"(, "VisionCamera": "0")").vehicles.at(0).autopilot->vision.camera, "front_center");
  const auto refused = [&](const std::string& keys, const std::string& why) {
    EXPECT_THAT(tests::refusal_of([&] { read(", " + keys); }), testing::HasSubstr(why)) << keys;
  };
  refused(R"("VisionCamera": "belly")", "the vehicle has no camera 'belly'");
  refused(R"("VisionPlace": "tiles")", "VisionPlace' is of VisionOdometry FromPlace only");
  refused(R"("VisionRate": 0)", "VisionRate' is 0, out of range: from 1 to 125");
  refused(R"("VisionLatency": 2)", "VisionLatency' is 2, out of range: from 0 to 1");
  refused(R"("VisionCamera": "a", "Cameras": {"a": {"CaptureSettings": [{"Width": 32}]}})",
          "VisionCamera' its images are too small");
  const auto read_ardupilot = [] {
    read_settings(R"({"Vehicles": {"A": {"VehicleType": "ArduCopter", "VisionOdometry": "FromPictures"}}})", "s");
  };
  EXPECT_THAT(tests::refusal_of(read_ardupilot), testing::HasSubstr("JSON interface has no message for it"));
}

/// A pitch of 30 degrees up and a heading of 90 degrees to the right, with distinct numbers for every field.
TEST(VisionFlight, TheMessageIsTheEstimateWithZDown) {
  odometry::MetricEstimate estimate;
  // The body's axes (forward, right, down) in a world whose z axis points up and whose y axis points left.
  const Eigen::Quaterniond R_down_body =
      Eigen::AngleAxisd(0.5 * M_PI, Vec3::UnitZ()) * Eigen::AngleAxisd(M_PI / 6.0, Vec3::UnitY());
  estimate.T_world_imu = geometry::SE3(Eigen::Quaterniond(0, 1, 0, 0) * R_down_body, Vec3(1, 2, 3));
  estimate.velocity_m_s = Vec3(0, -2, 0);  // to the right of the world's x axis: where the body heads
  estimate.position_covariance_m2 << 1, 0.1, 0.2, 0.1, 2, 0.3, 0.2, 0.3, 3;
  estimate.rotation_covariance_rad2 = Vec3(0.01, 0.02, 0.03).asDiagonal();
  estimate.velocity_covariance_m2_s2 = Vec3(4, 5, 4).asDiagonal();
  estimate.saturated_share = 0.25;
  const autopilot::Odometry message = vision_message(estimate, 1234, 300, 0.5);
  EXPECT_EQ(message.time_us, 1234U);
  EXPECT_THAT(message.position_m, testing::ElementsAre(1, -2, -3));
  const Eigen::Quaterniond q(message.attitude_wxyz[0], message.attitude_wxyz[1], message.attitude_wxyz[2],
                             message.attitude_wxyz[3]);
  EXPECT_LT(q.angularDistance(R_down_body), 1e-6);
  EXPECT_NEAR(message.velocity_m_s[0], 2.0 * std::cos(M_PI / 6.0), 1e-5);
  EXPECT_NEAR(message.velocity_m_s[2], 2.0 * std::sin(M_PI / 6.0), 1e-5);  // nose up: along the body's z axis, too
  // x x, x y, x z, …, y y, y z, …, z z, then the rotation's diagonal.
  const auto& c = message.pose_covariance;
  EXPECT_FLOAT_EQ(c[0], 1.0F);
  EXPECT_FLOAT_EQ(c[1], -0.1F);
  EXPECT_FLOAT_EQ(c[6], 2.0F);
  EXPECT_FLOAT_EQ(c[7], 0.3F);
  EXPECT_FLOAT_EQ(c[11], 3.0F);
  EXPECT_FLOAT_EQ(c[15], 0.01F);
  EXPECT_FLOAT_EQ(c[18], 0.02F);
  EXPECT_FLOAT_EQ(c[20], 0.03F);
  EXPECT_NEAR(message.velocity_covariance[6], 4.0, 1e-5);  // the body's y axis is the world's x axis, backwards
  EXPECT_FLOAT_EQ(message.velocity_covariance[20], 0.25F);
  EXPECT_EQ(message.resets, 300 - 256);
  EXPECT_EQ(message.quality, 75);
}

}  // namespace
}  // namespace tileflight::simulator::vision_flight_test
