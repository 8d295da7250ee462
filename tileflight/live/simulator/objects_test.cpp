#include <gmock/gmock.h>

#include <cmath>
#include <fstream>
#include <set>
#include <sstream>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/live/simulator/test_world.h"

namespace tileflight::simulator::objects_test {
namespace {

using namespace test_world;
using geometry::Box3;
using geometry::Vec3;
using testing::HasSubstr;

std::string read_all(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::stringstream text;
  text << in.rdbuf();
  return text.str();
}

/// Whether a surface of the world (north, east, up) touches a closed box.
bool touches_surface(const Box3& cell) {
  const auto touches_shell = [&](const Box3& solid) {
    return solid.intersects(cell) &&
           !(cell.min().array() > solid.min().array() && cell.max().array() < solid.max().array()).all();
  };
  return touches_shell(Box3(Vec3(-200, -200, -1), Vec3(200, 200, 0))) ||
         touches_shell(Box3(Vec3(kWallNorth_m, -60, 0), Vec3(kWallNorth_m + 1, 25, 40))) ||
         touches_shell(Box3(Vec3(-60, kWallEast_m, 0), Vec3(15, kWallEast_m + 1, 40)));
}

TEST(ApiScene, AirSimsVoxelGridIsThatOfItsCells) {
  const tests::TemporaryFolder folder;
  SimulatorOptions options;
  options.output_root = folder.path();
  const auto world = simulator(kComputerVision, options);
  ASSERT_TRUE(world->place().create_voxel_grid({10.3F, 0.1F, -2.2F}, 30, 9, 12, 0.7F, "grids/a.binvox"));
  const std::string file = read_all(folder / "grids" / "a.binvox");
  const int nx = 43, ny = 13, nz = 17;  // 30, 9 and 12 m over 0.7 m, rounded
  EXPECT_THAT(file, testing::StartsWith("#binvox 1\ndim 43 17 13\ntranslate -15 -4.5 -6\nscale 30\ndata\n"));
  std::vector<int> cells;
  for (std::size_t i = file.find("data\n") + 5; i + 1 < file.size(); i += 2)
    cells.insert(cells.end(), static_cast<unsigned char>(file[i + 1]), file[i]);
  ASSERT_EQ(cells.size(), static_cast<std::size_t>(nx * ny * nz));
  std::size_t next = 0;
  for (int j = 0; j < ny; ++j) {
    for (int k = 0; k < nz; ++k) {
      for (int i = 0; i < nx; ++i, ++next) {
        const double res = 0.7F;
        const Vec3 center(10.3F + (i - nx / 2) * res, 0.1F + (j - ny / 2) * res, 2.2F + (k - nz / 2) * res);
        const Box3 cell(center - Vec3::Constant(res / 2), center + Vec3::Constant(res / 2));
        ASSERT_EQ(cells[next], touches_surface(cell) ? 1 : 0) << i << ' ' << j << ' ' << k;
      }
    }
  }
}

TEST(ApiScene, TheInvertedScaleIsASetting) {
  const tests::TemporaryFolder folder;
  SimulatorOptions options;
  options.output_root = folder.path();
  const auto world = simulator(R"({"SimMode": "ComputerVision", "InvertedVoxelScale": true})", options);
  ASSERT_TRUE(world->place().create_voxel_grid({0, 0, 0}, 20, 20, 20, 1, "a.binvox"));
  EXPECT_THAT(read_all(folder / "a.binvox"), HasSubstr("scale 0.05\n"));
}

TEST(ApiScene, TheOwnGridIsInNedAndCentred) {
  const auto world = simulator(kComputerVision);
  const VoxelGridData grid = world->place().voxel_grid({18, 0, -3}, {8, 4, 6}, 0.5F);
  ASSERT_THAT(grid.dims, testing::ElementsAre(16, 8, 12));
  EXPECT_FLOAT_EQ(grid.origin.x_val, 14.0F);
  EXPECT_FLOAT_EQ(grid.origin.z_val, -6.0F);
  std::size_t next = 0, count = 0;
  for (int i = 0; i < 16; ++i) {
    for (int j = 0; j < 8; ++j) {
      for (int k = 0; k < 12; ++k, ++next) {
        const Vec3 low(14 + 0.5 * i, -2 + 0.5 * j, 6 - 0.5 * (k + 1));  // up
        ASSERT_EQ(grid.occupied[next] == 1, touches_surface(Box3(low, low + Vec3::Constant(0.5))))
            << i << ' ' << j << ' ' << k;
        count += grid.occupied[next];
      }
    }
  }
  EXPECT_EQ(grid.occupied_count, count);
}

TEST(ApiScene, GridsBeyondReasonAreRefused) {
  const tests::TemporaryFolder folder;
  SimulatorOptions options;
  options.output_root = folder.path();
  const auto world = simulator(kComputerVision, options);
  const auto grid = [&](int edge, float resolution, float x) {
    return tests::message_of([&] { world->place().create_voxel_grid({x, 0, 0}, edge, edge, edge, resolution, "a"); });
  };
  EXPECT_THAT(grid(2147483647, 1, 0), HasSubstr("100000 m"));
  EXPECT_THAT(grid(100000, 0.01F, 0), HasSubstr("cells"));
  EXPECT_THAT(grid(-5, 1, 0), HasSubstr("edges"));
  EXPECT_THAT(grid(0, 1, 0), HasSubstr("no cell"));
  EXPECT_THAT(grid(10, NAN, 0), HasSubstr("resolution"));
  EXPECT_THAT(grid(10, 0, 0), HasSubstr("resolution"));
  EXPECT_THAT(grid(10, 1, NAN), HasSubstr("finite"));
  EXPECT_THAT(tests::message_of([&] {
                world->place().voxel_grid({0, 0, 0}, {1000, 1000, 1000}, 0.5F);
              }),
              HasSubstr("cells"));
}

TEST(ApiScene, FilesAreWrittenBelowTheFolderGivenAndNowhereElse) {
  const tests::TemporaryFolder folder;
  std::vector<std::string> log;
  SimulatorOptions options;
  options.settings = kComputerVision;
  const auto note = [&](const std::string& line) { log.push_back(line); };
  Simulator closed(options, meshes(), note);
  EXPECT_FALSE(closed.place().create_voxel_grid({0, 0, 0}, 4, 4, 4, 1, "a.binvox")) << "AirSim's answer";
  EXPECT_THAT(log, testing::ElementsAre(HasSubstr("--files")));
  options.output_root = folder / "open";
  Simulator open(options, meshes(), note);
  std::filesystem::create_directory_symlink(folder.path(), folder / "open" / "link");
  for (const std::string& name : {std::string("../a"), std::string("/tmp/a"), std::string("x/../../a"), std::string(""),
                                  std::string("link/a"), std::string("."), std::string("a\0b", 3)}) {
    EXPECT_FALSE(open.place().create_voxel_grid({0, 0, 0}, 4, 4, 4, 1, name)) << name;
    EXPECT_THAT(log.back(), HasSubstr("file: ")) << name;
  }
  EXPECT_TRUE(open.place().create_voxel_grid({0, 0, 0}, 4, 4, 4, 1, (folder / "open" / "whole.binvox").string()))
      << "an absolute name within";
  EXPECT_FALSE(open.place().create_voxel_grid({0, 0, 0}, 4, 4, 4, 1, "whole.binvox/a")) << "in a file";
  EXPECT_TRUE(std::filesystem::exists(folder / "open" / "whole.binvox"));
  EXPECT_FALSE(std::filesystem::exists(folder / "a"));
}

TEST(ApiScene, ObjectsAreListedWithTheirPosesInTheSameOrder) {
  const auto world = simulator(kComputerVision);
  const std::vector<std::string> names = world->labels().list_instance_segmentation_objects();
  const std::vector<Pose> poses = world->labels().list_instance_segmentation_poses(true, false);
  EXPECT_THAT(names, testing::ElementsAre("east_wall", "ground", "north_wall"));
  ASSERT_EQ(poses.size(), names.size());
  for (std::size_t i = 0; i < names.size(); ++i) {
    const Pose alone = world->objects().get_object_pose(names[i]);
    EXPECT_FLOAT_EQ(poses[i].position.x_val, alone.position.x_val) << names[i];
    EXPECT_FLOAT_EQ(poses[i].position.y_val, alone.position.y_val) << names[i];
  }
  const std::vector<Vector3r> colours = world->labels().get_instance_segmentation_color_map();
  ASSERT_EQ(colours.size(), 256U);
  EXPECT_EQ(colours[7].x_val, 115.0F);
  EXPECT_THAT(world->objects().list_scene_objects_tags("north.*"),
              testing::ElementsAre(std::array<std::string, 2>{"north_wall", ""}));
}

TEST(ApiScene, TheDroneScriptsPatternForAllObjectsFindsThem) {
  const auto world = simulator(kComputerVision);
  EXPECT_TRUE(world->labels().set_segmentation_object_id("[\\w]*", 0, true));
  for (const std::string& name : world->objects().list_scene_objects(".*"))
    EXPECT_EQ(world->labels().get_segmentation_object_id(name), 0) << name;
}

TEST(ApiScene, MeshesAreInUnrealsCentimetres) {
  const auto world = simulator(kComputerVision);
  const auto buffers = world->objects().get_mesh_position_vertex_buffers();
  ASSERT_EQ(buffers.size(), 3U);
  EXPECT_EQ(buffers[1].name, "north_wall");
  EXPECT_EQ(buffers[1].vertices.size(), 24U);
  EXPECT_EQ(buffers[1].indices.size(), 36U);
  float least_north = 1e9F, highest = -1e9F;
  for (std::size_t i = 0; i < 24; i += 3) {
    least_north = std::min(least_north, buffers[1].vertices[i]);
    highest = std::max(highest, buffers[1].vertices[i + 2]);
  }
  EXPECT_FLOAT_EQ(least_north, 2000.0F);
  EXPECT_FLOAT_EQ(highest, 4000.0F);
  EXPECT_TRUE(std::isnan(world->objects().get_object_pose("nothing").position.x_val));
  EXPECT_NEAR(world->objects().get_object_pose("north_wall").position.x_val, 20.5, 1e-4);
}

TEST(ApiScene, ARecordingKeepsItsIntervalAndItsPosesArePicturesPoses) {
  const tests::TemporaryFolder folder;
  SimulatorOptions options;
  options.output_root = folder.path();
  const auto world = simulator(R"({"SimMode": "Multirotor", "StepOnDemand": true, "Recording": {"RecordInterval": 0.3,
    "Dataset": true, "Cameras": [{"CameraName": "0", "ImageType": 0}, {"CameraName": "3", "ImageType": 1,
    "PixelsAsFloat": true}]}})",
                               options);
  EXPECT_FALSE(world->recording().is_recording());
  world->recording().start();
  EXPECT_TRUE(world->recording().is_recording());
  world->clock().continue_for_time(1.2);
  world->recording().stop();
  std::filesystem::path recording;
  for (const auto& entry : std::filesystem::directory_iterator(folder / "recordings")) recording = entry.path();
  std::istringstream lines(read_all(recording / "airsim_rec.txt"));
  std::string line;
  std::getline(lines, line);
  EXPECT_EQ(line, "VehicleName\tTimeStamp\tPOS_X\tPOS_Y\tPOS_Z\tQ_W\tQ_X\tQ_Y\tQ_Z\tImageFile");
  std::vector<long> times;
  while (std::getline(lines, line)) {
    std::istringstream words(line);
    std::string vehicle, files;
    double time, p[7];
    words >> vehicle >> time;
    for (double& value : p) words >> value;
    words >> files;
    EXPECT_EQ(vehicle, "SimpleFlight");
    EXPECT_NEAR(p[2], -0.35, 0.01);
    times.push_back(static_cast<long>(time));
    const std::size_t comma = files.find(';');
    EXPECT_THAT(files, testing::MatchesRegex("img_SimpleFlight_0_0_[0-9]+.png;img_SimpleFlight_3_1_[0-9]+.pfm"));
    EXPECT_TRUE(std::filesystem::exists(recording / "images" / files.substr(0, comma)));
    EXPECT_TRUE(std::filesystem::exists(recording / "images" / files.substr(comma + 1)));
  }
  ASSERT_EQ(times.size(), 4U);
  for (std::size_t i = 1; i < times.size(); ++i) EXPECT_EQ(times[i] - times[i - 1], 300);
  const dataset::Dataset own = dataset::read_dataset(recording / "dataset_SimpleFlight_0");
  ASSERT_EQ(own.frames.size(), 4U);
  EXPECT_NEAR(own.frames[3].time_s, 0.9, 1e-9);
  ASSERT_TRUE(own.groundtruth.has_value());
  const geometry::SE3& T = own.groundtruth->poses[0].T_local_camera;
  EXPECT_NEAR((T.rotation * Vec3::UnitZ()).y(), 1.0, 1e-6) << "looks north";
  EXPECT_NEAR(T.translation.z(), 0.355, 0.01);
}

TEST(ApiScene, WhatHasNoEffectIsToldOnce) {
  std::vector<std::string> log;
  SimulatorOptions options;
  options.settings = kComputerVision;
  Simulator world(options, meshes(), [&](const std::string& line) { log.push_back(line); });
  for (int i = 0; i < 3; ++i) {
    world.accept_without_effect("simSetLightIntensity");
    world.accept_without_effect("simSetTraceLine");
  }
  EXPECT_THAT(log, testing::ElementsAre(HasSubstr("warning: simSetLightIntensity has no effect: there are no lamps"),
                                        HasSubstr("warning: simSetTraceLine has no effect: there is no display")));
}

TEST(ApiScene, WhatIsNotServedSaysWhy) {
  const auto world = simulator(kComputerVision);
  EXPECT_THAT(tests::message_of([&] { world->refuse("simSetExtForce"); }),
              HasSubstr("simSetExtForce is not served here: external forces"));
  EXPECT_FALSE(world->objects().set_object_pose("north_wall", {}, true));
}

}  // namespace
}  // namespace tileflight::simulator::objects_test
