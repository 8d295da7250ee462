#include "tileflight/live/simulator/world_objects.h"

#include <gmock/gmock.h>

#include <cmath>
#include <fstream>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/glb_writer.h"
#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/object_labels.h"
#include "tileflight/live/simulator/test_world.h"
#include "tileflight/world/scene/models.h"

namespace tileflight::simulator::world_objects_test {
namespace {

using namespace test_world;
using geometry::Box3;
using geometry::Vec3;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

constexpr const char* kCamera = R"({"SimMode": "ComputerVision", "StepOnDemand": true, "CameraDefaults": {
  "CaptureSettings": [{"ImageType": 0, "Width": 160, "Height": 120, "FOV_Degrees": 90},
                      {"ImageType": 1, "Width": 160, "Height": 120, "FOV_Degrees": 90},
                      {"ImageType": 5, "Width": 160, "Height": 120, "FOV_Degrees": 90},
                      {"ImageType": 8, "Width": 160, "Height": 120, "FOV_Degrees": 90}]}})";

/// A camera 2 m above the ground that looks north.
std::unique_ptr<Simulator> looking_north(SimulatorOptions options = {}) {
  auto world = simulator(kCamera, std::move(options));
  world->vehicles().set_vehicle_pose(pose(0, 0, -2), true, "");
  return world;
}

std::vector<float> depth(Simulator& world) {
  return world.cameras().get_images({{"0", 1, true, false}}, "", false)[0].image_data_float;
}
float depth_at(Simulator& world, int x, int y) { return depth(world)[static_cast<std::size_t>(160 * y + x)]; }
std::vector<std::uint8_t> bytes(Simulator& world, int type) {
  return world.cameras().get_images({{"0", type, false, false}}, "", false)[0].image_data_uint8;
}

constexpr Vector3r kOnce{1, 1, 1};

TEST(WorldObjects, ASpawnedBoxIsSeenAsWhatItMeasures) {
  const auto world = looking_north();
  EXPECT_NEAR(depth_at(*world, 80, 58), kWallNorth_m, 0.02);
  EXPECT_EQ(world->objects().spawn_object("crate", "Cube", pose(10, 0, -2), {2, 4, 3}, false, false), "crate");
  EXPECT_NEAR(depth_at(*world, 80, 58), 9.0, 1e-4) << "2 m long, so its face is a metre nearer than its middle";
  const std::vector<float> image = depth(*world);
  int columns = 0, rows = 0;
  for (int x = 0; x < 160; ++x)
    columns += std::abs(image[static_cast<std::size_t>(160 * 60 + x)] - 9.0F) < 1e-3F ? 1 : 0;
  for (int y = 0; y < 120; ++y) rows += std::abs(image[static_cast<std::size_t>(160 * y + 80)] - 9.0F) < 1e-3F ? 1 : 0;
  EXPECT_NEAR(columns, 80.0 * 4 / 9, 1.0) << "4 m wide";
  EXPECT_NEAR(rows, 80.0 * 3 / 9, 1.0) << "3 m high";
}

TEST(WorldObjects, APlaceWithTheBoxInItsMeshesGivesTheSamePictures) {
  const auto spawned = looking_north();
  spawned->objects().spawn_object("crate", "Cube", pose(10, 2, -1.5F, 0.4), {2, 4, 3}, false, false);
  std::vector<imaging::TexturedMesh> baked = meshes();
  imaging::TexturedMesh crate = scene::make_model(scene::Model::kBox);
  // Yaw is clockwise from north (+y); the box's x is 2 m long.
  const geometry::SE3 T_local_crate(Eigen::Quaterniond(Eigen::AngleAxisd(std::numbers::pi / 2 - 0.4, Vec3::UnitZ())),
                                    Vec3(2, 10, 1.5));
  for (Vec3& vertex : crate.mesh.vertices) vertex = T_local_crate * vertex.cwiseProduct(Vec3(2, 4, 3));
  crate.name = "crate";
  baked.push_back(crate);
  SimulatorOptions options;
  options.settings = kCamera;
  Simulator wanted(options, baked);
  wanted.vehicles().set_vehicle_pose(pose(0, 0, -2), true, "");
  for (const int type : {0, 5, 6}) {
    const auto a = bytes(*spawned, type), b = bytes(wanted, type);
    ASSERT_EQ(a.size(), b.size());
    std::size_t different = 0;
    for (std::size_t i = 0; i < a.size(); ++i) different += std::abs(int{a[i]} - int{b[i]}) > 1 ? 1 : 0;
    EXPECT_LE(different, a.size() / 500) << "type " << type << ": silhouettes, within float rounding";
  }
  const auto a = depth(*spawned), b = depth(wanted);
  std::size_t different = 0;
  for (std::size_t i = 0; i < a.size(); ++i) different += std::abs(a[i] - b[i]) > 1e-3F ? 1 : 0;
  EXPECT_LE(different, 20U);
}

TEST(WorldObjects, AreListedMovedScaledAndDestroyed) {
  const auto world = looking_north();
  EXPECT_THAT(world->objects().list_assets(), testing::IsSupersetOf({"1M_Cube_Chamfer", "Car", "Person", "Sphere"}));
  world->objects().spawn_object("ball", "Sphere", pose(8, 0, -2), {2, 2, 2}, true, false);
  EXPECT_THAT(world->objects().list_scene_objects(".*"), ElementsAre("ball", "east_wall", "ground", "north_wall"));
  EXPECT_NEAR(depth_at(*world, 80, 60), 7.0, 0.02);
  const Pose where = world->objects().get_object_pose("ball");
  EXPECT_FLOAT_EQ(where.position.x_val, 8.0F);
  EXPECT_FLOAT_EQ(where.position.z_val, -2.0F);
  EXPECT_TRUE(world->objects().set_object_pose("ball", pose(12, 0, -2), true));
  EXPECT_NEAR(depth_at(*world, 80, 60), 11.0, 0.02);
  EXPECT_FLOAT_EQ(world->objects().get_object_scale("ball").y_val, 2.0F);
  EXPECT_TRUE(world->objects().set_object_scale("ball", {4, 4, 4}));
  EXPECT_NEAR(depth_at(*world, 80, 60), 10.0, 0.04);
  EXPECT_FALSE(world->objects().set_object_pose("north_wall", {}, true)) << "tiles stay where they are";
  EXPECT_FALSE(world->objects().set_object_scale("nothing", kOnce));
  EXPECT_TRUE(world->objects().destroy_object("ball"));
  EXPECT_FALSE(world->objects().destroy_object("ball"));
  EXPECT_NEAR(depth_at(*world, 80, 58), kWallNorth_m, 0.02);
  EXPECT_THAT(world->objects().list_scene_objects(".*"), Not(Contains("ball")));
  EXPECT_TRUE(std::isnan(world->objects().get_object_pose("ball").position.x_val));
}

TEST(WorldObjects, ANameThatAnotherContainsGetsANumber) {
  const auto world = looking_north();
  const auto spawn = [&](const char* name) {
    return world->objects().spawn_object(name, "Cube", {}, kOnce, false, false);
  };
  EXPECT_EQ(spawn("box"), "box");
  EXPECT_EQ(spawn("box"), "box1");
  EXPECT_EQ(spawn("box"), "box2");
  EXPECT_EQ(spawn("Bo"), "Bo3");
  EXPECT_EQ(spawn("wall"), "wall1") << "of tiles, too";
}

TEST(WorldObjects, WrongOnesAreRefusedWithAReason) {
  const auto world = looking_north();
  const auto spawn = [&](const std::string& name, const std::string& asset, const Vector3r& scale, const Pose& at) {
    return tests::refusal_of([&] { world->objects().spawn_object(name, asset, at, scale, false, false); });
  };
  EXPECT_THAT(spawn("a", "/etc/passwd", kOnce, {}), HasSubstr("simListAssets"));
  EXPECT_THAT(spawn("a", "", kOnce, {}), HasSubstr("no objects with name"));
  EXPECT_THAT(spawn("", "Cube", kOnce, {}), HasSubstr("name"));
  EXPECT_THAT(spawn(std::string(101, 'a'), "Cube", kOnce, {}), HasSubstr("name"));
  EXPECT_THAT(spawn("a\nb", "Cube", kOnce, {}), HasSubstr("control"));
  for (const float bad : {0.0F, -1.0F, NAN, INFINITY, 1e9F})
    EXPECT_THAT(spawn("a", "Cube", {1, bad, 1}, {}), HasSubstr("scale"));
  EXPECT_THAT(spawn("a", "Cube", kOnce, pose(1e9F, 0, 0)), HasSubstr("coordinate"));
  world->objects().spawn_object("b", "Cube", {}, kOnce, false, false);
  EXPECT_THAT(tests::refusal_of([&] { world->objects().set_object_scale("b", {1, 1, 0}); }), HasSubstr("scale"));
  EXPECT_THAT(tests::refusal_of([&] { world->objects().set_object_pose("b", pose(0, INFINITY, 0), true); }),
              HasSubstr("coordinate"));
}

TEST(WorldObjects, ThereIsALimit) {
  WorldObjects objects({});
  const auto spawn = [&](std::size_t i) { objects.spawn("n" + std::to_string(i) + "x", "Cube", {}, Vec3::Ones(), {}); };
  for (std::size_t i = 0; i < WorldObjects::kMaxObjects; ++i) spawn(i);
  EXPECT_THAT(tests::refusal_of([&] { spawn(0); }), HasSubstr("objects already"));
  EXPECT_TRUE(objects.destroy("n7x"));
  EXPECT_EQ(tests::refusal_of([&] { spawn(7); }), "no error");
}

TEST(WorldObjects, HaveSegmentationIdsAndDetections) {
  const auto world = looking_north();
  world->objects().spawn_object("Car_1", "Car", pose(10, 1, 0, 0.5), kOnce, false, false);
  world->objects().spawn_object("Car_2", "Car", pose(14, -3, 0), kOnce, false, false);
  EXPECT_TRUE(world->labels().set_segmentation_object_id(".*", 0, true));
  EXPECT_TRUE(world->labels().set_segmentation_object_id("Car_1", 7, false));
  EXPECT_EQ(world->labels().get_segmentation_object_id("Car_1"), 7);
  const imaging::Rgb8 colour = simulator::segmentation_palette()[7];
  const std::vector<std::uint8_t> image = bytes(*world, 5);
  int seen = 0, left = 160, right = 0, top = 120, bottom = 0;
  for (int i = 0; i < 160 * 120; ++i) {
    const auto at = static_cast<std::size_t>(3 * i);
    if (image[at] != colour[2] || image[at + 1] != colour[1] || image[at + 2] != colour[0]) continue;
    ++seen;
    left = std::min(left, i % 160), right = std::max(right, i % 160);
    top = std::min(top, i / 160), bottom = std::max(bottom, i / 160);
  }
  EXPECT_GT(seen, 100);
  world->detections().add_detection_filter_mesh_name("0", 5, "Car_*", "", false);
  const std::vector<DetectionInfo> found = world->detections().get_detections("0", 5, "", false);
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].name, "Car_1");
  EXPECT_EQ(found[0].box2D.min.x_val, static_cast<float>(left));
  EXPECT_EQ(found[0].box2D.max.x_val, static_cast<float>(right + 1));
  EXPECT_EQ(found[0].box2D.min.y_val, static_cast<float>(top));
  EXPECT_EQ(found[0].box2D.max.y_val, static_cast<float>(bottom + 1));
  EXPECT_NEAR(found[0].relative_pose.position.x_val, 10.0, 1e-4) << "camera axes: forward, right, down";
  EXPECT_NEAR(found[0].relative_pose.position.y_val, 1.0, 1e-4);
  EXPECT_NEAR(found[0].relative_pose.position.z_val, 2.0, 1e-4);
  EXPECT_NEAR(found[0].relative_pose.orientation.z_val, std::sin(0.25), 1e-4);
  EXPECT_NEAR(found[1].box3D.max.x_val - found[1].box3D.min.x_val, 4.45, 0.05) << "its own box, not one around it";
  EXPECT_NEAR(found[1].box3D.max.z_val, 2.0, 1e-3);
}

TEST(WorldObjects, StandInTheWayOfVehiclesRaysAndSensors) {
  const auto world = simulator(R"({"SimMode": "Multirotor", "StepOnDemand": true, "Vehicles": {"A": {
    "VehicleType": "SimpleFlight", "Sensors": {"D": {"SensorType": 5, "Enabled": true, "MaxDistance": 50},
    "L": {"SensorType": 6, "Enabled": true, "NumberOfChannels": 4, "PointsPerSecond": 4000, "RotationsPerSecond": 10,
          "VerticalFOVUpper": 5, "VerticalFOVLower": -5, "Range": 60}}}}})");
  world->vehicles().enable_api_control(true, "");
  const std::string wall = world->objects().spawn_object("wall", "Cube", pose(12, 0, -5), {1, 20, 20}, false, false);
  EXPECT_NEAR(world->sensors().get_distance_sensor_data("D", "A").distance, 11.5, 0.3);
  const LidarScanData scan = world->sensors().lidar_scan("L", "A");
  float nearest_ahead = 1e9F;
  for (std::size_t i = 0; i < scan.point_cloud.size(); i += 3) {
    const bool is_level_or_up = scan.ring[i / 3] >= 2;
    if (is_level_or_up && std::abs(scan.point_cloud[i + 1]) < 2.0F && scan.point_cloud[i] > 0.0F)
      nearest_ahead = std::min(nearest_ahead, scan.point_cloud[i]);
  }
  EXPECT_NEAR(nearest_ahead, 11.5F, 0.05F);
  ASSERT_TRUE(world->flight().takeoff(20, ""));
  world->flight().move_by_velocity_z(5, 0, -3, 4, 0, {}, "");
  const CollisionInfo hit = world->vehicles().get_collision_info("");
  EXPECT_TRUE(hit.has_collided);
  EXPECT_NEAR(hit.impact_point.x_val, 11.5, 0.05);
  EXPECT_EQ(hit.object_name, wall);
  EXPECT_LT(world->vehicles().get_vehicle_pose("").position.x_val, 11.5);
}

TEST(WorldObjects, FlowOfOneThatWasMovedIsThatOfItsPoints) {
  const auto world = looking_north();
  world->objects().spawn_object("crate", "Cube", pose(10, 0, -2), {2, 2, 2}, false, false);
  bytes(*world, 8);  // the picture before
  world->objects().set_object_pose("crate", pose(10, 0.5F, -2), true);
  const auto flow = world->cameras().get_images({{"0", 8, true, false}}, "", false)[0].image_data_float;
  EXPECT_NEAR(flow[160 * 60 + 82], 80.0 * 0.5 / 9.0, 0.01) << "half a metre to the right at 9 m; as floats: right";
  EXPECT_NEAR(flow[160 * 60 + 20], 0.0, 1e-3) << "the wall stays";
}

TEST(WorldObjects, FilesOfTheUserAreAssetsAndAGltfsFrontIsX) {
  const tests::TemporaryFolder folder;
  // In glTF's axes (y up, front +Z): a block 4 m long to the front, 1 m wide, 2 m high. The writer takes z up.
  imaging::TexturedMesh block = box("block", Box3(Vec3(-0.5, -4, 0), Vec3(0.5, 0, 2)), {200, 30, 30});
  imaging::GlbOptions glb;
  std::ofstream(folder / "block.glb", std::ios::binary) << imaging::write_glb({block}, glb);
  std::ofstream(folder / "broken.glb", std::ios::binary) << "glTF but not really";
  SimulatorOptions options;
  options.assets = {{"Block", folder / "block.glb"}};
  const auto world = looking_north(options);
  EXPECT_THAT(world->objects().list_assets(), Contains("Block"));
  world->objects().spawn_object("b", "Block", pose(6, 0, 0, std::numbers::pi), kOnce, false, false);
  EXPECT_NEAR(depth_at(*world, 80, 70), 2.0, 0.01) << "turned to the camera, its front is 4 m nearer than its origin";
  options.assets = {{"Broken", folder / "broken.glb"}};
  EXPECT_THAT(tests::refusal_of([&] { looking_north(options); }), HasSubstr("broken.glb"));
  options.assets = {{"Gone", folder / "gone.glb"}};
  EXPECT_THAT(tests::refusal_of([&] { looking_north(options); }), HasSubstr("gone.glb"));
  SimulatorOptions by_settings;
  by_settings.settings = R"({"SimMode": "ComputerVision", "Assets": {"Block": "block.glb"}})";
  by_settings.settings_name = (folder / "settings.json").string();
  EXPECT_THAT(Simulator(by_settings, meshes()).objects().list_assets(), Contains("Block"));
}

TEST(WorldObjects, TheSameCallsGiveTheSameBytes) {
  const auto run = [] {
    const auto world = looking_north();
    world->objects().spawn_object("a", "Car", pose(12, 3, 0, 1.0), kOnce, false, false);
    world->objects().spawn_object("b", "Person", pose(7, -1, 0, 2.0), kOnce, false, false);
    std::vector<std::uint8_t> all = bytes(*world, 0);
    world->objects().set_object_pose("a", pose(9, 2, 0, 0.3), true);
    for (const int type : {0, 5, 6, 8}) {
      const auto more = bytes(*world, type);
      all.insert(all.end(), more.begin(), more.end());
    }
    return all;
  };
  EXPECT_EQ(run(), run());
}

}  // namespace
}  // namespace tileflight::simulator::world_objects_test
