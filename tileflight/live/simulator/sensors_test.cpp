#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/test_world.h"

namespace tileflight::simulator::sensors_test {
namespace {

using namespace test_world;
using std::numbers::pi;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

/// Ten readings of each sensor kind, in any mode.
constexpr const char* kSensors = R"("Sensors": {
  "imu": {"SensorType": 2, "Enabled": true}, "gps": {"SensorType": 3, "Enabled": true},
  "barometer": {"SensorType": 1, "Enabled": true}, "magnetometer": {"SensorType": 4, "Enabled": true},
  "down": {"SensorType": 5, "Enabled": true, "Pitch": -90, "X": 0, "Y": 0, "Z": 0, "NoiseSigma": 0, "MaxDistance": 25},
  "local": {"SensorType": 6, "Enabled": true, "NumberOfChannels": 8, "PointsPerSecond": 28800, "VerticalFOVUpper": 10,
            "VerticalFOVLower": -25, "DataFrame": "SensorLocalFrame", "X": 0.5, "Y": 0, "Z": 0},
  "world": {"SensorType": 6, "Enabled": true, "NumberOfChannels": 8, "PointsPerSecond": 28800, "VerticalFOVUpper": 10,
            "VerticalFOVLower": -25, "X": 0.5, "Y": 0, "Z": 0}})";

std::unique_ptr<Simulator> seeing() {
  return simulator(R"({"SimMode": "ComputerVision", "StepOnDemand": true,
    "OriginGeopoint": {"Latitude": -0.2, "Longitude": -78.5, "Altitude": 2800}, "Vehicles": {"Eye": {)" +
                   std::string(kSensors) + "}}}");
}

TEST(ApiSensors, AnImuAtRestFeelsGravityUpwards) {
  const auto world = seeing();
  world->vehicles().set_vehicle_pose(pose(0, 0, -10, pi / 2), true, "");
  const ImuData imu = world->sensors().get_imu_data("", "");
  EXPECT_NEAR(imu.linear_acceleration.z_val, -9.80665, 0.5);
  EXPECT_NEAR(imu.linear_acceleration.x_val, 0.0, 0.5);
  EXPECT_NEAR(imu.angular_velocity.x_val, 0.0, 0.02);
  EXPECT_NEAR(imu.orientation.z_val, std::sin(pi / 4), 1e-6);
}

TEST(ApiSensors, PlaceAndPressureAreThoseOfTheOrigin) {
  const auto world = seeing();
  world->vehicles().set_vehicle_pose(pose(100, 0, -10), true, "");
  const GpsData gps = world->sensors().get_gps_data("", "");
  EXPECT_TRUE(gps.is_valid);
  EXPECT_EQ(gps.gnss.fix_type, 3);
  constexpr double kMeridianRadius_m = 6335439.3;  // of WGS84 at the equator, a (1 - e^2)
  EXPECT_NEAR(gps.gnss.geo_point.latitude, -0.2 + 100.0 / (kMeridianRadius_m + 2810.0) * 180 / pi, 3e-8);
  EXPECT_NEAR(gps.gnss.geo_point.longitude, -78.5, 1e-9);
  EXPECT_NEAR(gps.gnss.geo_point.altitude, 2810.0, 0.01);
  EXPECT_NEAR(world->sensors().get_barometer_data("", "").altitude, 2810.0, 40.0) << "its factor may be 0.2 % off";
  EXPECT_NEAR(world->vehicles().get_ground_truth_environment("").air_pressure, 71800.0, 300.0);
  EXPECT_NEAR(world->vehicles().get_home_geo_point("").latitude, -0.2, 1e-9);
  const GeodeticPose own = world->vehicles().geodetic_pose("");
  EXPECT_NEAR(own.altitude, 2810.0, 0.01);
  EXPECT_NEAR(own.heading, 0.0, 1e-4);
}

TEST(ApiSensors, TheMagnetometerTurnsWithTheBody) {
  const auto world = seeing();
  const Vector3r north = world->sensors().get_magnetometer_data("", "").magnetic_field_body;
  world->vehicles().set_vehicle_pose(pose(0, 0, 0, pi / 2), true, "");
  const Vector3r east = world->sensors().get_magnetometer_data("", "").magnetic_field_body;
  EXPECT_GT(north.x_val, 0.2) << "the field points north in Quito";
  EXPECT_NEAR(east.y_val, -north.x_val, 0.05);
  EXPECT_NEAR(east.x_val, north.y_val, 0.05);
}

TEST(ApiSensors, TheDistanceSensorMeasuresTheHeight) {
  const auto world = seeing();
  world->vehicles().set_vehicle_pose(pose(0, 0, -12.5F), true, "");
  const DistanceSensorData data = world->sensors().get_distance_sensor_data("down", "");
  EXPECT_NEAR(data.distance, 12.5, 1e-4);
  EXPECT_FLOAT_EQ(data.max_distance, 25.0F);
  world->vehicles().set_vehicle_pose(pose(0, 0, -80), true, "");
  EXPECT_FLOAT_EQ(world->sensors().get_distance_sensor_data("down", "").distance, 25.0F) << "out of reach";
}

TEST(ApiSensors, EveryPointOfAScanLiesOnASurfaceAndInBothFramesItIsTheSame) {
  const auto world = seeing();
  world->vehicles().set_vehicle_pose(pose(2, 1, -6, 0.4), true, "");
  const LidarData own = world->sensors().get_lidar_data("local", ""),
                  all = world->sensors().get_lidar_data("world", "");
  ASSERT_EQ(own.point_cloud.size(), all.point_cloud.size());
  ASSERT_EQ(own.segmentation.size() * 3, own.point_cloud.size());
  EXPECT_GT(own.segmentation.size(), 1000U) << "of 2880 rays";
  const geometry::SE3 T(to_quaternion(own.pose.orientation), to_vec3(own.pose.position));
  std::size_t on_wall = 0;
  for (std::size_t i = 0; i + 2 < all.point_cloud.size(); i += 3) {
    const geometry::Vec3 p(all.point_cloud[i], all.point_cloud[i + 1], all.point_cloud[i + 2]);
    const double off = std::min({std::abs(p.x() - kWallNorth_m), std::abs(p.y() - kWallEast_m), std::abs(p.z()),
                                 std::abs(p.y() - 25.0), std::abs(p.x() - 15.0)});
    EXPECT_LT(off, 2e-4);
    on_wall += std::abs(p.x() - kWallNorth_m) < 2e-4 ? 1 : 0;
    const geometry::Vec3 moved = T * geometry::Vec3(own.point_cloud[i], own.point_cloud[i + 1], own.point_cloud[i + 2]);
    EXPECT_LT((moved - p).norm(), 1e-3);
  }
  EXPECT_GT(on_wall, 100U);
}

TEST(ApiSensors, AScansRingsRiseAndItsFirstColumnIsAhead) {
  const auto world = seeing();
  world->vehicles().set_vehicle_pose(pose(0, 0, -6), true, "");
  const LidarScanData scan = world->sensors().lidar_scan("local", "");
  ASSERT_EQ(scan.ring.size() * 3, scan.point_cloud.size());
  ASSERT_EQ(scan.intensity.size(), scan.ring.size());
  for (std::size_t i = 0; i < scan.ring.size(); ++i) {
    const geometry::Vec3 p(scan.point_cloud[3 * i], scan.point_cloud[3 * i + 1], scan.point_cloud[3 * i + 2]);
    const double elevation_deg = std::atan2(-p.z(), p.head<2>().norm()) * 180 / pi;
    EXPECT_NEAR(elevation_deg, -25.0 + 5.0 * scan.ring[i], 1e-2);
    EXPECT_GE(scan.intensity[i], 0.0F);
    EXPECT_LE(scan.intensity[i], 1.0F);
    if (scan.time_offset[i] == 0.0F) {
      EXPECT_NEAR(p.y(), 0.0, 1e-4);
    }
    const double azimuth = std::fmod(std::atan2(p.y(), p.x()) + 2 * pi, 2 * pi);
    if (azimuth < 6.0) {
      EXPECT_NEAR(scan.time_offset[i], 0.1 * azimuth / (2 * pi), 1e-4) << "clockwise, ten turns a second";
    }
  }
}

TEST(ApiSensors, AGpuLidarIsTheLidarWithColoursAndIntensities) {
  const auto world = seeing();
  world->vehicles().set_vehicle_pose(pose(2, 1, -6, 0.4), true, "");
  world->labels().set_segmentation_object_id(".*", 7, true);
  const GPULidarData gpu = world->sensors().get_gpu_lidar_data("local", "");
  const LidarScanData scan = world->sensors().lidar_scan("local", "");
  ASSERT_EQ(gpu.point_cloud.size(), 5 * scan.intensity.size());
  for (std::size_t i = 0; i < scan.intensity.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) ASSERT_EQ(gpu.point_cloud[5 * i + k], scan.point_cloud[3 * i + k]);
    ASSERT_EQ(gpu.point_cloud[5 * i + 3], static_cast<float>((115 << 16) + (176 << 8) + 195)) << "the colour of 7";
    ASSERT_EQ(gpu.point_cloud[5 * i + 4], scan.intensity[i]);
  }
  EXPECT_FLOAT_EQ(gpu.pose.position.x_val, 0.5F) << "of the sensor on the body";
}

/// Facing a wall, a ray at an angle of t to the wall's normal is mirrored 2 t away from the way back: with an opening
/// angle of 10 degrees the echoes are those of a disc of 5 degrees.
TEST(ApiSensors, TheEchoesOfAWallAreThoseOfTheDiscThatScattersBack) {
  constexpr double kAhead_m = 5.0;
  const auto world = simulator(R"({"SimMode": "ComputerVision", "Vehicles": {"Eye": {"Sensors": {"echo":
    {"SensorType": 7, "Enabled": true, "X": 0, "Y": 0, "Z": 0, "NumberOfTraces": 20000, "DistanceLimit": 12,
     "AttenuationPerDistance": 0.5, "AttenuationPerReflection": 2}}}}})");
  world->vehicles().set_vehicle_pose(pose(static_cast<float>(kWallNorth_m - kAhead_m), 0, -20), true, "");
  const EchoData data = world->sensors().get_echo_data("echo", "");
  const std::size_t count = data.groundtruth.size();
  ASSERT_EQ(data.point_cloud.size(), 6 * count);
  const double share = (1.0 - std::cos(5.0 * pi / 180)) / 1.0;  // of the half sphere
  EXPECT_NEAR(static_cast<double>(count), 20000 * share, 4.0);
  double widest_rad = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    const float* p = &data.point_cloud[6 * i];
    EXPECT_EQ(data.groundtruth[i], "north_wall");
    EXPECT_NEAR(p[0], kAhead_m, 1e-3);
    const double way_m = 2 * std::hypot(p[0], p[1], p[2]);
    EXPECT_NEAR(p[3], -(0.5 * way_m + 2.0), 1e-3);
    EXPECT_NEAR(p[4], way_m, 1e-3);
    EXPECT_EQ(p[5], 1.0F);
    widest_rad = std::max<double>(widest_rad, std::atan2(std::hypot(p[1], p[2]), p[0]));
  }
  EXPECT_LE(widest_rad, 5.0 * pi / 180 + 1e-6);
}

/// A ray into a right-angled corner comes back along itself after two reflections. The way is that to the sensor's
/// mirror image.
TEST(ApiSensors, ACornerEchoesByTwoReflections) {
  const auto world = simulator(R"({"SimMode": "ComputerVision", "Vehicles": {"Eye": {"Sensors": {"echo":
    {"SensorType": 7, "Enabled": true, "X": 0, "Y": 0, "Z": 0, "NumberOfTraces": 20000, "DistanceLimit": 20,
     "ReflectionDistanceLimit": 20}}}}})");
  const double ahead_m = 3.0, height_m = 2.0;
  world->vehicles().set_vehicle_pose(pose(static_cast<float>(kWallNorth_m - ahead_m), 0, static_cast<float>(-height_m)),
                                     true, "");
  const EchoData data = world->sensors().get_echo_data("", "");
  int by_two = 0;
  for (std::size_t i = 0; i < data.groundtruth.size(); ++i) {
    const float* p = &data.point_cloud[6 * i];
    if (p[5] != 2.0F) continue;
    ++by_two;
    const bool on_ground = data.groundtruth[i] == "ground";
    const geometry::Vec3 last(p[0], p[1], p[2]);
    const geometry::Vec3 image = on_ground ? geometry::Vec3(2 * ahead_m, 0, 0) : geometry::Vec3(0, 0, 2 * height_m);
    EXPECT_NEAR(p[4], (last - image).norm() + last.norm(), 2e-3);
  }
  EXPECT_GT(by_two, 20);
}

TEST(ApiSensors, EchoesBeyondTheLimitsAreNotHeard) {
  const auto count = [](const std::string& limits) {
    const auto world = simulator(R"({"SimMode": "ComputerVision", "Vehicles": {"Eye": {"Sensors": {"echo": {"Z": 0,
      "SensorType": 7, "Enabled": true, "NumberOfTraces": -1000)" +
                                 limits + "}}}}}");
    world->vehicles().set_vehicle_pose(pose(static_cast<float>(kWallNorth_m - 5.0), 0, -20), true, "");
    return world->sensors().get_echo_data("", "").groundtruth.size();
  };
  EXPECT_NEAR(static_cast<double>(count(R"(, "DistanceLimit": 12)")), 1000 * 10.0 / 180.0, 2.0) << "in its plane";
  EXPECT_EQ(count(R"(, "DistanceLimit": 9.9)"), 0U) << "there and back is 10 m";
  EXPECT_EQ(count(R"(, "DistanceLimit": 12, "AttenuationPerDistance": 11)"), 0U) << "110 dB";
  EXPECT_EQ(count(R"(, "DistanceLimit": 12, "SensorLowerAzimuthLimit": 10)"), 0U) << "it looks past the wall's middle";
}

TEST(ApiSensors, InFlightTheGpsIsLateAndTheImuFeelsTheThrust) {
  const auto world = simulator(kMultirotor);
  EXPECT_TRUE(world->sensors().get_gps_data("", "").is_valid);
  world->vehicles().enable_api_control(true, "");
  world->vehicles().arm_disarm(true, "");
  world->flight().takeoff(20, "");
  EXPECT_NEAR(world->sensors().get_imu_data("", "").linear_acceleration.z_val, -9.8, 1.5);
  const MultirotorState now = world->vehicles().get_multirotor_state("");
  const GpsData gps = world->sensors().get_gps_data("", "");
  EXPECT_EQ(gps.gnss.fix_type, 3);
  EXPECT_NEAR(static_cast<double>(now.timestamp - gps.time_stamp), 0.2e9, 0.025e9);
}

TEST(ApiSensors, SensorsThatAreNotThereAreNamed) {
  const auto world = simulator(kComputerVision);
  EXPECT_THAT([&] { world->sensors().get_imu_data("", ""); },
              ThrowsMessage<std::runtime_error>(HasSubstr("No IMU with name")));
  EXPECT_THAT([&] { world->sensors().get_lidar_data("nope", ""); },
              ThrowsMessage<std::runtime_error>(HasSubstr("No lidar with name nope exist on vehicle")));
}

TEST(ApiSensors, LinesOfSightEndAtWalls) {
  const auto world = seeing();
  world->vehicles().set_vehicle_pose(pose(0, 0, -5), true, "");
  const GeoPoint here = world->vehicles().geodetic_pose("").geo_point;
  world->vehicles().set_vehicle_pose(pose(15, 0, -5), true, "");
  EXPECT_TRUE(world->place().test_line_of_sight_to_point(here, ""));
  const GeoPoint before = world->vehicles().geodetic_pose("").geo_point;
  world->vehicles().set_vehicle_pose(pose(40, 0, -5), true, "");
  EXPECT_FALSE(world->place().test_line_of_sight_to_point(here, "")) << "behind the wall";
  EXPECT_TRUE(world->place().test_line_of_sight_between_points(here, before));
}

}  // namespace
}  // namespace tileflight::simulator::sensors_test
