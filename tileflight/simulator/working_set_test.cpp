#include "tileflight/simulator/working_set.h"

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "tests/temporary_folder.h"
#include "tests/tiny_place.h"
#include "tileflight/simulator/simulator.h"

namespace tileflight::simulator::working_set_test {
namespace {

using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;
using tests::TinyPlace;

class FollowingTiles : public testing::Test {
 protected:
  FollowingTiles() { TinyPlace::write(folder_.path()); }

  SimulatorOptions options(TileResidency following) const {
    SimulatorOptions options;
    options.source = folder_.path().string();
    options.residency = following;
    options.settings = R"({"SimMode": "ComputerVision", "StepOnDemand": true})";
    return options;
  }
  static std::vector<std::uint8_t> picture(Simulator& world, float north, float down) {
    world.sim_set_vehicle_pose({{north, 0, down}, {}}, true, "");
    return world.sim_get_images({{"3", 0, false, false}}, "", false).at(0).image_data_uint8;
  }

  tests::TemporaryFolder folder_;
};

TEST_F(FollowingTiles, FarAwayTilesAreCoarseAndNearOnesFine) {
  WorkingSet world(options(TileResidency::kFollow), SimulatorLog(), Progress());
  const auto place = [&](double height_m) {
    const std::vector<SensorViewpoint> looks{{Vec3(0, 0, 100 + height_m), 200.0}};
    return world.load_for(looks);
  };
  const auto near = place(5.0);
  EXPECT_EQ(near->loaded().tiles_loaded, 4);
  EXPECT_EQ(near->loaded().geometric_error_max, 0.0F);
  const auto far = place(3000.0);
  EXPECT_EQ(far->loaded().tiles_loaded, 1) << "4 m at 3 km are less than a pixel of 1/200 rad";
  EXPECT_EQ(far->loaded().geometric_error_max, 4.0F);
  EXPECT_EQ(world.scenes_built(), 2U);
  EXPECT_EQ(place(3005.0), far) << "the same cell: nothing is built anew";
  EXPECT_EQ(world.scenes_built(), 2U);
}

TEST_F(FollowingTiles, TheSameTilesForAnotherCellAreNotReadAgain) {
  WorkingSet world(options(TileResidency::kFollow), SimulatorLog(), Progress());
  world.load_for(std::vector<SensorViewpoint>{{Vec3(-20, 0, 105), 200.0}});
  EXPECT_EQ(world.tiles_read(), 4U);
  world.load_for(std::vector<SensorViewpoint>{{Vec3(30, 0, 105), 200.0}});
  EXPECT_EQ(world.scenes_built(), 1U) << "another cell, but the same tiles";
  EXPECT_EQ(world.tiles_read(), 4U);
}

/// Two places, a kilometre west and east of the middle.
TEST_F(FollowingTiles, TilesThatTheNextPlaceHasTooAreKept) {
  const auto child = [](double east_m, const std::string& uri) {
    return nlohmann::json{{"transform", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, east_m, 0, 0, 1}},
                          {"boundingVolume", {{"box", {0, 0, 100, 40, 0, 0, 0, 40, 0, 0, 0, 4}}}},
                          {"geometricError", 16},
                          {"content", {{"uri", uri}}}};
  };
  const nlohmann::json root{{"boundingVolume", {{"box", {0, 0, 100, 1040, 0, 0, 0, 40, 0, 0, 0, 4}}}},
                            {"geometricError", 2000},
                            {"refine", "ADD"},
                            {"children", {child(-1000, "a/tileset.json"), child(1000, "b/tileset.json")}}};
  TinyPlace::write(folder_ / "a");
  TinyPlace::write(folder_ / "b");
  TinyPlace::write_file(
      folder_ / "tileset.json",
      nlohmann::json{{"asset", {{"version", "1.1"}}}, {"geometricError", 4000}, {"root", root}}.dump());
  WorkingSet world(options(TileResidency::kFollow), SimulatorLog(), Progress());
  const auto near_a = world.load_for(std::vector<SensorViewpoint>{{Vec3(-1000, 0, 110), 200.0}});
  EXPECT_EQ(near_a->loaded().tiles_loaded, 5) << "the near place's four tiles, and the far one's coarse one";
  EXPECT_EQ(world.tiles_read(), 5U);
  const auto above = world.load_for(std::vector<SensorViewpoint>{{Vec3(0, 0, 3000), 200.0}});
  EXPECT_EQ(above->loaded().tiles_loaded, 2);
  EXPECT_EQ(world.tiles_read(), 6U) << "the far place's is there already";
}

TEST_F(FollowingTiles, APictureIsThatOfTheWholeRegionWhateverTheWayThere) {
  const auto whole = std::make_unique<Simulator>(options(TileResidency::kRegion));
  const auto follow = std::make_unique<Simulator>(options(TileResidency::kFollow));
  EXPECT_EQ(whole->tf_statistics().mode, "region");
  EXPECT_EQ(follow->tf_statistics().mode, "follow");
  const std::vector<std::uint8_t> wanted = picture(*whole, 3, -10);
  EXPECT_EQ(picture(*follow, 3, -10), wanted);
  picture(*follow, 0, -3000);
  EXPECT_EQ(follow->tf_coverage("3", "", false).loaded.geometric_error_max, 4.0F);
  EXPECT_EQ(picture(*follow, 3, -10), wanted) << "never a coarser level";
  const Coverage coverage = follow->tf_coverage("3", "", false);
  EXPECT_TRUE(coverage.complete);
  EXPECT_LE(coverage.error_max, coverage.error_wanted);
  EXPECT_GT(coverage.surface_share, 0.99F);
}

TEST_F(FollowingTiles, VehiclesStartOnTheSurface) {
  const auto world = std::make_unique<Simulator>(options(TileResidency::kAuto));
  world->sim_set_vehicle_pose({{0, 0, -20}, {}}, true, "");
  const ImageResponse above = world->sim_get_images({{"3", 1, true, false}}, "", false).at(0);
  EXPECT_NEAR(above.image_data_float[128 + 256 * 72], 20.0, 0.1);
}

TEST_F(FollowingTiles, WithTooLittleMemoryTilesGetCoarserAndNothingIsMissing) {
  SimulatorOptions little = options(TileResidency::kAuto);
  std::vector<std::string> lines;
  WorkingSet all(options(TileResidency::kRegion), SimulatorLog(), Progress());
  little.max_memory_bytes = 2 * all.current()->loaded().bytes - 1000;
  WorkingSet world(little, [&](const std::string& line) { lines.push_back(line); }, {});
  EXPECT_TRUE(world.follows_sensors()) << "the whole region does not fit";
  const auto place = world.load_for(std::vector<SensorViewpoint>{{Vec3(0, 0, 300), 200.0}});
  EXPECT_TRUE(place->loaded().complete);
  EXPECT_EQ(place->loaded().tiles_loaded, 1);
  EXPECT_GT(world.error_px(), 1.0);
  EXPECT_THAT(lines, testing::Contains(testing::HasSubstr("their screen-space error is raised to")));
}

TEST_F(FollowingTiles, ABrokenTileIsToldWithThePicture) {
  TinyPlace::write_file(folder_ / "2.glb", "broken");
  const auto world = std::make_unique<Simulator>(options(TileResidency::kFollow));
  const ImageResponse image = world->sim_get_images({{"3", 0, false, false}}, "", false).at(0);
  EXPECT_THAT(image.message, testing::HasSubstr("1 tiles could not be read"));
  EXPECT_FALSE(world->tf_coverage("3", "", false).complete);
}

TEST_F(FollowingTiles, ARegionThatIsAskedForIsThereFromThenOn) {
  const auto world = std::make_unique<Simulator>(options(TileResidency::kFollow));
  world->sim_set_vehicle_pose({{0, 0, -3000}, {}}, true, "");
  world->sim_get_images({{"3", 0, false, false}}, "", false);
  EXPECT_EQ(world->tf_coverage("3", "", false).loaded.tiles_loaded, 1);
  const LoadedRegion loaded = world->tf_load_region({0, 0, 0}, {80, 80, 80}, 0.0F);
  EXPECT_TRUE(loaded.complete);
  EXPECT_EQ(loaded.geometric_error_max, 0.0F);
  EXPECT_THAT(
      [&] {
        world->tf_load_region({0, 0, 0}, {-1, 80, 80}, 0.0F);
      },
      ThrowsMessage<std::runtime_error>(HasSubstr("tfLoadRegion: the region's edges must be above 0")));
}

TEST_F(FollowingTiles, AGroundTruthOfARegionIsAFolderOfTheServers) {
  const tests::TemporaryFolder out;
  SimulatorOptions with_files = options(TileResidency::kAuto);
  with_files.output_root = out.path();
  const auto world = std::make_unique<Simulator>(with_files);
  const GroundTruthReport report = world->tf_ground_truth({0, 0, 0}, {20, 20, 20}, 0.0F, 1.0F, "truth");
  EXPECT_THAT(report.extract_json, testing::HasSubstr("\"complete\":true"));
  EXPECT_TRUE(std::filesystem::exists(out / "truth" / "voxels.binvox"));
}

}  // namespace
}  // namespace tileflight::simulator::working_set_test
