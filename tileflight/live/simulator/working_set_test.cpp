#include "tileflight/live/simulator/working_set.h"

#include <gmock/gmock.h>

#include <atomic>
#include <cmath>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>
#include <thread>

#include "tests/temporary_folder.h"
#include "tests/tiny_place.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/live/simulator/simulator.h"

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
    options.prefetch = false;  // so that counts of what is read are told by the positions alone
    options.settings = R"({"SimMode": "ComputerVision", "StepOnDemand": true})";
    return options;
  }
  static std::vector<std::uint8_t> picture(Simulator& world, float north, float down) {
    world.vehicles().set_vehicle_pose({{north, 0, down}, {}}, true, "");
    return world.cameras().get_images({{"3", 0, false, false}}, "", false).at(0).image_data_uint8;
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
  EXPECT_EQ(whole->statistics().mode, "region");
  EXPECT_EQ(follow->statistics().mode, "follow");
  const std::vector<std::uint8_t> wanted = picture(*whole, 3, -10);
  EXPECT_EQ(picture(*follow, 3, -10), wanted);
  picture(*follow, 0, -3000);
  EXPECT_EQ(follow->cameras().coverage("3", "", false).loaded.geometric_error_max, 4.0F);
  EXPECT_EQ(picture(*follow, 3, -10), wanted) << "never a coarser level";
  const Coverage coverage = follow->cameras().coverage("3", "", false);
  EXPECT_TRUE(coverage.complete);
  EXPECT_LE(coverage.error_max, coverage.error_wanted);
  EXPECT_GT(coverage.surface_share, 0.99F);
}

TEST_F(FollowingTiles, VehiclesStartOnTheSurface) {
  const auto world = std::make_unique<Simulator>(options(TileResidency::kAuto));
  world->vehicles().set_vehicle_pose({{0, 0, -20}, {}}, true, "");
  const ImageResponse above = world->cameras().get_images({{"3", 1, true, false}}, "", false).at(0);
  EXPECT_NEAR(above.image_data_float[128 + 256 * 72], 20.0, 0.1);
}

TEST_F(FollowingTiles, WithTooLittleMemoryTilesGetCoarserAndNothingIsMissing) {
  SimulatorOptions little = options(TileResidency::kAuto);
  std::vector<std::string> lines;
  WorkingSet all(options(TileResidency::kRegion), SimulatorLog(), Progress());
  little.max_memory_bytes = all.current()->loaded().bytes * 7 / 5;
  WorkingSet world(little, [&](const std::string& line) { lines.push_back(line); }, {});
  EXPECT_TRUE(world.follows_sensors()) << "the whole region does not fit";
  const auto place = world.load_for(std::vector<SensorViewpoint>{{Vec3(0, 0, 300), 200.0}});
  EXPECT_TRUE(place->loaded().complete);
  EXPECT_EQ(place->loaded().tiles_loaded, 1);
  EXPECT_GT(world.error_px(), 1.0);
  EXPECT_THAT(lines, testing::Contains(testing::HasSubstr("their screen-space error is raised to")));
}

/// 3 x 3 copies of the place, 80 m apart, by reference to one external tileset.
class FollowingTilesOfACity : public FollowingTiles {
 protected:
  static constexpr double kBlock_m = 2 * TinyPlace::kHalf;

  FollowingTilesOfACity() {
    nlohmann::json blocks = nlohmann::json::array();
    for (int i = 0; i < 9; ++i) {
      blocks.push_back(
          {{"transform", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, (i % 3 - 1) * kBlock_m, (i / 3 - 1) * kBlock_m, 0, 1}},
           {"boundingVolume", {{"box", {0, 0, 100, 40, 0, 0, 0, 40, 0, 0, 0, 4}}}},
           {"geometricError", 16},
           {"content", {{"uri", "block/tileset.json"}}}});
    }
    TinyPlace::write(folder_ / "block");
    const nlohmann::json root{{"boundingVolume", {{"box", {0, 0, 100, 120, 0, 0, 0, 120, 0, 0, 0, 4}}}},
                              {"geometricError", 500},
                              {"refine", "REPLACE"},
                              {"children", blocks}};
    TinyPlace::write_file(
        folder_ / "tileset.json",
        nlohmann::json{{"asset", {{"version", "1.1"}}}, {"geometricError", 1000}, {"root", root}}.dump());
  }

  /// With an error of 12 pixels, near blocks are fine and far ones coarse.
  SimulatorOptions city_options(bool prefetch) const {
    SimulatorOptions city = options(TileResidency::kFollow);
    city.prefetch = prefetch;
    city.error_px = 12.0;
    return city;
  }
  static std::vector<SensorViewpoint> at(double x, double y = 0.0) { return {{Vec3(x, y, 130), 200.0}}; }
  static std::vector<std::optional<TileKey>> keys_of(const ResidentScene& place) {
    std::vector<std::optional<TileKey>> keys;
    for (const ResidentTile& tile : place.tiles()) keys.push_back(tile.key);
    return keys;
  }
  static std::vector<Vec3> vertices_of(const ResidentScene& place) {
    return scene::merge_meshes(place.scene().meshes()).vertices;
  }
};

TEST_F(FollowingTilesOfACity, CopiesOfATilesetKeepTheirPlaces) {
  WorkingSet moved(city_options(false), SimulatorLog(), Progress());
  for (const double x : {-100.0, 0.0, 100.0}) {
    const auto place = moved.load_for(at(x));
    WorkingSet fresh(city_options(false), SimulatorLog(), Progress());
    const auto wanted = fresh.load_for(at(x));
    EXPECT_EQ(vertices_of(*place), vertices_of(*wanted)) << "at " << x;
    EXPECT_GT(place->loaded().tiles_loaded, 9);
    EXPECT_LE(place->loaded().tiles_loaded, x == 0.0 ? 36 : 35);
    EXPECT_NEAR(place->scene().bounds().sizes().x(), 240.0, 1.0) << "no hole";
  }
}

TEST_F(FollowingTilesOfACity, TilesOfTwoScenesAreTheSameObjects) {
  WorkingSet world(city_options(false), SimulatorLog(), Progress());
  const auto before = world.load_for(at(-100));
  const auto after = world.load_for(at(-60));
  ASSERT_NE(keys_of(*before), keys_of(*after));
  int shared = 0;
  for (const ResidentTile& tile : after->tiles()) {
    const auto known = std::ranges::find(before->tiles(), tile.key, &ResidentTile::key);
    if (known == before->tiles().end()) continue;
    EXPECT_EQ(tile.part, known->part);
    ++shared;
  }
  EXPECT_GT(shared, 5);
  EXPECT_LT(world.tiles_read(), before->tiles().size() + after->tiles().size());
}

TEST_F(FollowingTilesOfACity, ACellThatWasPreparedIsEnteredWithoutWaiting) {
  WorkingSet world(city_options(true), SimulatorLog(), Progress());
  WorkingSet plain(city_options(false), SimulatorLog(), Progress());
  std::set<std::vector<std::optional<TileKey>>> cuts;
  for (double x = -118; x < 100; x += 4.0) {
    const auto place = world.load_for(at(x));
    world.wait_until_prefetched();
    const auto wanted = plain.load_for(at(x));
    EXPECT_EQ(vertices_of(*place), vertices_of(*wanted)) << "at " << x;
    cuts.insert(keys_of(*place));
  }
  EXPECT_EQ(world.waits(), 1U) << "for the first cell only";
  EXPECT_GT(plain.waits(), 5U);
  EXPECT_GT(cuts.size(), 3U) << "the tiles do change on this way";
}

TEST_F(FollowingTilesOfACity, AJumpIsWaitedForAndGivesTheSame) {
  WorkingSet world(city_options(true), SimulatorLog(), Progress());
  for (const double x : {-100.0, 90.0, -90.0, 100.0}) {
    WorkingSet fresh(city_options(false), SimulatorLog(), Progress());
    const auto place = world.load_for(at(x, -x)), wanted = fresh.load_for(at(x, -x));
    EXPECT_EQ(vertices_of(*place), vertices_of(*wanted)) << "at " << x;
  }
}

TEST_F(FollowingTilesOfACity, CirclingOverABorderMakesNoSceneAnew) {
  WorkingSet world(city_options(true), SimulatorLog(), Progress());
  const auto circle = [&] {
    for (int i = 0; i < 24; ++i) {
      const double turn = i * std::numbers::pi / 12;
      world.load_for(at(-48 + 6 * std::cos(turn), 3 * std::sin(turn) + 12));
      world.wait_until_prefetched();
    }
  };
  for (int round = 0; round < 2; ++round) circle();
  const std::uint64_t built = world.scenes_built(), read = world.tiles_read(), waits = world.waits();
  for (int round = 0; round < 5; ++round) circle();
  EXPECT_EQ(world.scenes_built(), built);
  EXPECT_EQ(world.tiles_read(), read);
  EXPECT_EQ(world.waits(), waits);
}

TEST_F(FollowingTilesOfACity, EveryoneGetsTheSceneOfTheirCellsWhileOthersMove) {
  WorkingSet plain(city_options(false), SimulatorLog(), Progress());
  const auto way = [](int thread, int i) { return at(-110.0 + (7.0 + thread) * i, 60.0 * thread - 90.0); };
  // Not by their keys: in which order external tilesets are opened, and so their tiles' numbers, differs.
  std::map<std::pair<int, int>, std::vector<Vec3>> wanted;
  for (int thread = 0; thread < 4; ++thread) {
    for (int i = 0; i < 24; ++i) wanted[{thread, i}] = vertices_of(*plain.load_for(way(thread, i)));
  }
  WorkingSet world(city_options(true), SimulatorLog(), Progress());
  std::atomic<int> wrong = 0, seen = 0;
  std::vector<std::jthread> threads;
  for (int thread = 0; thread < 4; ++thread) {
    threads.emplace_back([&, thread] {
      for (int i = 0; i < 24; ++i) {
        const auto place = world.load_for(way(thread, i));
        if (vertices_of(*place) != wanted.at({thread, i})) ++wrong;
        // A ray from above meets the place in each scene, whatever becomes of the working set meanwhile.
        if (world.current()->scene().intersect({Vec3(0.3, 0.2, 500), -Vec3::UnitZ()})) ++seen;
        if (place->scene().intersect({Vec3(-70.3, 0.2, 500), -Vec3::UnitZ()})) ++seen;
      }
    });
  }
  threads.clear();
  EXPECT_EQ(wrong, 0);
  EXPECT_EQ(seen, 4 * 24 * 2);
}

TEST_F(FollowingTilesOfACity, PicturesDoNotDependOnPrefetching) {
  const auto fly = [&](bool prefetch) {
    const auto world = std::make_unique<Simulator>(city_options(prefetch));
    std::vector<std::vector<std::uint8_t>> pictures;
    for (int i = 0; i < 12; ++i) pictures.push_back(picture(*world, static_cast<float>(9 * i - 50), -15));
    return pictures;
  };
  EXPECT_EQ(fly(true), fly(false));
}

TEST_F(FollowingTilesOfACity, ATileThatFailsAheadIsToldWhenItIsEntered) {
  for (const char* name : {"block/0.glb", "block/2.glb"}) TinyPlace::write_file(folder_ / name, "broken");
  const auto run = [&](bool prefetch) {
    std::mutex mutex;
    std::vector<std::string> lines;
    WorkingSet world(
        city_options(prefetch),
        [&](const std::string& line) {
          const std::lock_guard lock(mutex);
          lines.push_back(line);
        },
        Progress());
    std::vector<std::pair<int, std::vector<std::string>>> told;
    for (double x = -118; x < 0; x += 8.0) {
      const auto place = world.load_for(at(x));
      told.emplace_back(place->loaded().tiles_failed, place->loaded().failures);
      world.wait_until_prefetched();
    }
    EXPECT_THAT(lines, testing::Contains(HasSubstr("0.glb")));
    return told;
  };
  const auto told = run(true);
  EXPECT_GT(told.back().first, 0);
  EXPECT_EQ(told, run(false));
}

TEST_F(FollowingTilesOfACity, ATileThatFailedIsRequestedAgain) {
  const std::filesystem::path file = folder_ / "block/2.glb", kept = folder_ / "block/kept.glb";
  for (const bool prefetch : {false, true}) {
    std::filesystem::copy_file(file, kept, std::filesystem::copy_options::overwrite_existing);
    TinyPlace::write_file(file, "broken");
    SimulatorOptions options = city_options(prefetch);
    options.retry_after = std::chrono::milliseconds(0);
    WorkingSet world(options, SimulatorLog(), Progress());
    for (const double x : {-60.0, -56.0}) EXPECT_FALSE(world.load_for(at(x))->loaded().complete);
    world.wait_until_prefetched();
    std::filesystem::copy_file(kept, file, std::filesystem::copy_options::overwrite_existing);
    EXPECT_TRUE(world.load_for(at(-56))->loaded().complete);
    EXPECT_TRUE(world.load_for(at(-40))->loaded().complete) << "also where it had failed ahead";
  }
}

TEST_F(FollowingTilesOfACity, MemoryIsBoundedWithWhatIsPreparedAndFarTilesGetCoarserFirst) {
  WorkingSet all(city_options(false), SimulatorLog(), Progress());
  const std::uintmax_t needed = all.load_for(at(0))->loaded().bytes;
  SimulatorOptions little = city_options(true);
  little.max_memory_bytes = needed * 6 / 5;
  WorkingSet world(little, SimulatorLog(), Progress());
  for (double x = -118; x < 118; x += 6.0) {
    const auto place = world.load_for(at(x));
    world.wait_until_prefetched();
    EXPECT_LE(place->loaded().bytes, little.max_memory_bytes * 2 / 3);
    EXPECT_LE(world.memory_bytes(), little.max_memory_bytes);
    EXPECT_TRUE(place->loaded().complete);
    EXPECT_NEAR(place->scene().bounds().sizes().x(), 240.0, 1.0) << "no hole";
    // The block below is as fine as it gets.
    const auto below = place->scene().intersect({Vec3(x, 0.2, 300), -Vec3::UnitZ()});
    ASSERT_TRUE(below);
    EXPECT_EQ(place->geometric_error_m(below->mesh), 0.0) << "at " << x;
  }
  EXPECT_GT(world.error_px(), 12.0);
}

TEST_F(FollowingTilesOfACity, WhatDoesNotFitAtAllIsRefusedWithALine) {
  SimulatorOptions little = city_options(true);
  little.max_memory_bytes = 20000;
  WorkingSet world(little, SimulatorLog(), Progress());
  EXPECT_THAT([&] { world.load_for(at(0)); }, ThrowsMessage<InputError>(HasSubstr("--memory")));
  little.max_distance_m = -1.0;
  EXPECT_THAT([&] { WorkingSet(little, SimulatorLog(), Progress()); },
              ThrowsMessage<InputError>(HasSubstr("viewing distance")));
}

TEST_F(FollowingTilesOfACity, ARegionThatIsPinnedWhileTilesAreReadAheadIsThere) {
  WorkingSet world(city_options(true), SimulatorLog(), Progress());
  world.load_for(at(-118));
  world.load_for(at(-114));
  const LoadedRegion loaded = world.add_region({Vec3(60, 60, 90), Vec3(100, 100, 110)}, 0.0, at(-112));
  EXPECT_TRUE(loaded.complete);
  for (const double x : {-112.0, -90.0, -66.0, -40.0}) {
    const auto place = world.load_for(at(x));
    const auto hit = place->scene().intersect({Vec3(80.3, 80.2, 300), -Vec3::UnitZ()});
    ASSERT_TRUE(hit);
    EXPECT_EQ(place->geometric_error_m(hit->mesh), 0.0) << "at " << x;
    world.wait_until_prefetched();
  }
}

TEST_F(FollowingTiles, ABrokenTileIsToldWithThePicture) {
  TinyPlace::write_file(folder_ / "2.glb", "broken");
  const auto world = std::make_unique<Simulator>(options(TileResidency::kFollow));
  const ImageResponse image = world->cameras().get_images({{"3", 0, false, false}}, "", false).at(0);
  EXPECT_THAT(image.message, testing::HasSubstr("1 tiles could not be read"));
  EXPECT_FALSE(world->cameras().coverage("3", "", false).complete);
}

TEST_F(FollowingTiles, ARegionThatIsAskedForIsThereFromThenOn) {
  const auto world = std::make_unique<Simulator>(options(TileResidency::kFollow));
  world->vehicles().set_vehicle_pose({{0, 0, -3000}, {}}, true, "");
  world->cameras().get_images({{"3", 0, false, false}}, "", false);
  EXPECT_EQ(world->cameras().coverage("3", "", false).loaded.tiles_loaded, 1);
  const LoadedRegion loaded = world->place().load_region({0, 0, 0}, {80, 80, 80}, 0.0F);
  EXPECT_TRUE(loaded.complete);
  EXPECT_EQ(loaded.geometric_error_max, 0.0F);
  EXPECT_THAT(
      [&] {
        world->place().load_region({0, 0, 0}, {-1, 80, 80}, 0.0F);
      },
      ThrowsMessage<std::runtime_error>(HasSubstr("tfLoadRegion: the region's edges must be above 0")));
}

TEST_F(FollowingTiles, AGroundTruthOfARegionIsAFolderOfTheServers) {
  const tests::TemporaryFolder out;
  SimulatorOptions with_files = options(TileResidency::kAuto);
  with_files.output_root = out.path();
  const auto world = std::make_unique<Simulator>(with_files);
  const GroundTruthReport report = world->place().ground_truth({0, 0, 0}, {20, 20, 20}, 0.0F, 1.0F, "truth");
  EXPECT_THAT(report.extract_json, testing::HasSubstr("\"complete\":true"));
  EXPECT_TRUE(std::filesystem::exists(out / "truth" / "voxels.binvox"));
}

}  // namespace
}  // namespace tileflight::simulator::working_set_test
