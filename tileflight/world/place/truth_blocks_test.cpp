#include "tileflight/world/place/truth_blocks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <nlohmann/json.hpp>

#include "tests/refusal.h"
#include "tests/same_files.h"
#include "tests/temporary_folder.h"
#include "tests/tiny_place.h"
#include "tileflight/core/imaging/glb_writer.h"
#include "tileflight/world/place/block_plan.h"
#include "tileflight/world/place/block_store.h"

namespace tileflight::place::truth_blocks_test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::HasSubstr;
using tests::refusal_of;
using tests::TinyPlace;

TEST(BlockGrid, IsAllCellsOnceInOrder) {
  const geometry::Box3 region(geometry::Vec3(1.0, 2.0, 3.0), geometry::Vec3(11.2, 9.0, 5.0));
  const BlockGrid grid(region, 0.5, 6);
  ASSERT_EQ(grid.size(), 4U * 3U);
  std::size_t cells = 0;
  for (std::size_t i = 0; i < grid.size(); ++i) {
    const ground_truth::CellRange& block = grid.cells(i);
    cells += static_cast<std::size_t>(block.count(0) * block.count(1) * block.count(2));
    const geometry::Box3 bounds = grid.bounds(i), reach = grid.reach(i, 2);
    EXPECT_NEAR(bounds.min().x(), 1.0 + 0.5 * block.low[0], 1e-9);
    EXPECT_NEAR(bounds.max().y(), 2.0 + 0.5 * (block.high[1] + 1), 1e-9);
    EXPECT_NEAR(bounds.min().z() - reach.min().z(), 2.6 * 0.5, 1e-9);
    EXPECT_NEAR(reach.max().x() - bounds.max().x(), 2.6 * 0.5, 1e-9);
  }
  EXPECT_EQ(cells, static_cast<std::size_t>(grid.dims()[0]) * static_cast<std::size_t>(grid.dims()[1]) *
                       static_cast<std::size_t>(grid.dims()[2]));
  EXPECT_EQ(grid.name(0), "x00000_y00000");
  EXPECT_EQ(grid.name(11), "x00003_y00002");
  EXPECT_THAT(
      refusal_of([&] { BlockGrid(geometry::Box3(geometry::Vec3(0, 0, 0), geometry::Vec3(2e6, 2e6, 1)), 1.0, 1); }),
      HasSubstr("more than a million blocks"));
}

/// A box of 20 x 30 x 10 m from z = 0, in one tile whose volume is stated as `volume`; 24 separate corners.
void write_house(const fs::path& folder, const json& volume) {
  const std::array<geometry::Vec3, 2> ends{geometry::Vec3(-10, -15, 0), geometry::Vec3(10, 15, 10)};
  imaging::TexturedMesh house;
  for (int axis = 0; axis < 3; ++axis) {
    for (int side = 0; side < 2; ++side) {
      const auto first = static_cast<std::uint32_t>(house.mesh.vertices.size());
      for (int corner = 0; corner < 4; ++corner) {
        geometry::Vec3 p;
        p[axis] = ends[static_cast<std::size_t>(side)][axis];
        for (int other = 1; other < 3; ++other)
          p[(axis + other) % 3] = ends[static_cast<std::size_t>(corner >> (other - 1) & 1)][(axis + other) % 3];
        house.mesh.vertices.push_back(p);
      }
      house.mesh.triangles.push_back({first, first + 1, first + 2});
      house.mesh.triangles.push_back({first + 1, first + 3, first + 2});
    }
  }
  fs::create_directories(folder);
  TinyPlace::write_file(folder / "house.glb", imaging::write_glb({house}, {}));
  const json tileset{{"asset", {{"version", "1.1"}}},
                     {"geometricError", 100},
                     {"root",
                      {{"boundingVolume", {{"box", volume}}},
                       {"geometricError", 0},
                       {"refine", "ADD"},
                       {"content", {{"uri", "house.glb"}}}}}};
  TinyPlace::write_file(folder / "tileset.json", tileset.dump());
}

class SurfaceBesideItsVolume : public ::testing::Test {
 protected:
  ExtractSettings settings() const { return {.source = (folder_ / "place").string(), .load = {}, .voxel_m = 1.0}; }
  ExtractResult extracted(const ExtractSettings& settings) const {
    return *extract(settings, folder_ / "out", true).result;
  }

  tests::TemporaryFolder folder_;
};

TEST_F(SurfaceBesideItsVolume, IsWholeThoughTheVolumeIsTooSmall) {
  write_house(folder_ / "place", {0, 0, 5, 20, 0, 0, 0, 20, 0, 0, 0, 4.9993});
  const ExtractResult whole = extracted(settings());
  EXPECT_EQ(whole.triangles, 12) << "the roof and the floor are 0.7 mm outside";
  EXPECT_TRUE(whole.complete);
  EXPECT_NEAR(static_cast<double>(whole.surface_points), 16 * 2 * (20 * 30 + 20 * 10 + 30 * 10), 100);
  EXPECT_NEAR(whole.region->box().max().z(), 10.0, 1e-4);
  ExtractSettings in_blocks = settings();
  in_blocks.block_m = 7.0;
  const ExtractResult blocks = extracted(in_blocks);
  EXPECT_EQ(blocks.triangles, 12);
  EXPECT_EQ(blocks.surface_points, whole.surface_points);
  EXPECT_EQ(blocks.voxels_occupied, whole.voxels_occupied);
}

TEST_F(SurfaceBesideItsVolume, IsFoundWhereItIsAndNamed) {
  write_house(folder_ / "place", {0, 0, -450, 20, 0, 0, 0, 20, 0, 0, 0, 50});
  const ExtractResult whole = extracted(settings());
  EXPECT_EQ(whole.triangles, 12);
  ASSERT_FALSE(whole.warnings.empty());
  EXPECT_THAT(
      whole.warnings[0],
      HasSubstr(
          "tiles that hold surface outside of the bounding volumes that the tileset states for them: 1 of those read"));
  EXPECT_THAT(whole.warnings[0], HasSubstr("410 m (house.glb)"));
  ExtractSettings around = settings();
  around.load.center_local = geometry::Vec3(0, 0, 5);
  around.load.size = geometry::Vec3(40, 40, 20);
  const ExtractResult found = extracted(around);
  EXPECT_EQ(found.triangles, 12);
  EXPECT_EQ(found.tiles_wanted, 1);
  around.load.center_local->z() = 300.0;
  EXPECT_THAT(refusal_of([&] { extracted(around); }), HasSubstr("no tile with content overlaps"));
}

TEST_F(SurfaceBesideItsVolume, MissingTilesAreNamedAsTheCause) {
  write_house(folder_ / "place", {0, 0, 5, 20, 0, 0, 0, 20, 0, 0, 0, 5});
  fs::remove(folder_ / "place/house.glb");
  ExtractSettings incomplete = settings();
  incomplete.load.allow_incomplete = true;
  EXPECT_THAT(refusal_of([&] { extracted(incomplete); }),
              ::testing::AllOf(HasSubstr("house.glb"), HasSubstr("1 of its 1 tiles could not be read")));
  incomplete.block_m = 10.0;
  EXPECT_THAT(refusal_of([&] { extracted(incomplete); }), HasSubstr("house.glb"));
}

TEST_F(SurfaceBesideItsVolume, BlocksChosenByMemoryFitByTheProgramsOwnEstimate) {
  write_house(folder_ / "place", {0, 0, 5, 20, 0, 0, 0, 20, 0, 0, 0, 5});
  ExtractSettings dense = settings();
  dense.samples_per_m2 = 1000.0;  // 2.2 million points, 260 MB by the estimate
  dense.max_memory_bytes = 120'000'000;
  EXPECT_THAT(refusal_of([&] { extracted(dense); }), HasSubstr("--block auto"));
  dense.block_m = 25.0;
  EXPECT_THAT(refusal_of([&] { extracted(dense); }), HasSubstr("choose at most"));
  dense.block_m = 0.0;
  const Extraction made = extract(dense, folder_ / "out", true);
  EXPECT_EQ(made.result->triangles, 12);
  EXPECT_GT(made.build->blocks, 50U) << "of 20 MB each, besides the program's 40";
}

class TruthInBlocks : public ::testing::Test {
 protected:
  TruthInBlocks() {
    TinyPlace::write(folder_ / "place");
    // A tile whose content reaches far beyond its bounding volume.
    json tileset = TinyPlace::tileset();
    tileset["root"]["children"][3]["boundingVolume"]["box"] = {35, 35, 100, 4, 0, 0, 0, 4, 0, 0, 0, 4};
    TinyPlace::write_file(folder_ / "place/tileset.json", tileset.dump());
  }

  ExtractSettings settings(double block_m = 27.0) const {
    ExtractSettings settings{.source = (folder_ / "place").string(), .load = {}, .voxel_m = 1.0};
    settings.block_m = block_m;
    return settings;
  }
  ExtractSettings part(int number, int count) const {
    ExtractSettings one = settings();
    one.part = JobPart{number, count};
    return one;
  }
  void expect_same(const std::string& one, const std::string& other) const {
    tests::expect_same_files(folder_ / one, folder_ / other, "extract.json");
    EXPECT_EQ(without_seconds(one), without_seconds(other));
    EXPECT_FALSE(BlockStore::exists(folder_ / other));
  }
  json without_seconds(const std::string& out) const {
    ExtractResult result = read_extract_json(folder_ / out);
    result.seconds = {};
    return to_json(result);
  }
  fs::path record_of(const std::string& out, const std::string& block) const {
    return BlockStore::folder_for(folder_ / out) / "done" / (block + ".json");
  }

  tests::TemporaryFolder folder_;
};

TEST_F(TruthInBlocks, IsTheSameAsInOnePiece) {
  extract(settings(), folder_ / "alone", false);
  ExtractSettings whole = settings();
  whole.block_m.reset();
  extract(whole, folder_ / "whole", false);
  EXPECT_EQ(without_seconds("whole"), without_seconds("alone"));
}

TEST_F(TruthInBlocks, IsTheSameInPartsAndGoesOnFromThem) {
  extract(settings(), folder_ / "alone", false);
  for (const int k : {3, 1, 2}) EXPECT_GE(extract(part(k, 3), folder_ / "out", false).build->blocks_made, 1);
  EXPECT_EQ(extract(part(2, 3), folder_ / "out", false).build->blocks_made, 0);
  EXPECT_FALSE(fs::exists(folder_ / "out"));
  // A crash can leave a block without its record, or a record without the rest of it.
  fs::remove(record_of("out", "x00001_y00001"));
  TinyPlace::write_file(record_of("out", "x00002_y00002"), "{\"triangles\": 1");
  const Extraction made = extract(settings(), folder_ / "out", false);
  EXPECT_EQ(made.build->blocks, 9);
  EXPECT_EQ(made.build->blocks_reused, 7);
  expect_same("alone", "out");
}

TEST_F(TruthInBlocks, OfOtherInputsIsNotReused) {
  extract(settings(), folder_ / "alone", false);
  ExtractSettings coarser = part(1, 2);
  coarser.load.error_m = 5.0;
  extract(part(1, 2), folder_ / "out", false);
  EXPECT_THAT(extract(coarser, folder_ / "out", false).build->note,
              HasSubstr("blocks of an earlier extract are not reused, because these inputs differ: tiles"));
  EXPECT_THAT(extract(settings(), folder_ / "out", false).build->note, HasSubstr("differ: tiles"));
  expect_same("alone", "out");
}

TEST_F(TruthInBlocks, KeepsItsEdgeWhereItWasChosenByMemory) {
  ExtractSettings any = part(1, 2);
  any.block_m = 0.0;
  extract(any, folder_ / "out", false);
  const BlockPlan plan = plan_truth_blocks(settings(0.0), folder_ / "out", 8);
  EXPECT_GE(plan.edge_m, 1.0);
  EXPECT_GT(plan.memory_bytes, 0.0);
  any.processes = 1000000;  // would make smaller blocks
  EXPECT_EQ(plan_truth_blocks(any, folder_ / "out", 8).edge_m, plan.edge_m);
  EXPECT_LT(plan_truth_blocks(any, folder_ / "other", 8).edge_m, plan.edge_m);
}

TEST_F(TruthInBlocks, IsMadeByOneJobAtATime) {
  const BlockPlan plan = plan_truth_blocks(settings(), folder_ / "out", 4);
  EXPECT_EQ(plan.parts, 4);
  EXPECT_EQ(plan_truth_blocks(settings(), folder_ / "out", 400).parts, 9);
  extract(part(1, 4), folder_ / "out", false);
  const BlockStore other(folder_ / "out", "2-of-4", jobs::Share::kPart);
  EXPECT_THAT(refusal_of([&] { extract(settings(), folder_ / "out", false); }),
              HasSubstr("another process is working in it"));
  EXPECT_EQ(extract(part(1, 4), folder_ / "out", false).build->blocks_made, 0);
}

TEST_F(TruthInBlocks, LeavesNothingWhereTheRegionIsEmpty) {
  ExtractSettings high = settings();
  high.load.center_local = geometry::Vec3(35, -35, 110);
  high.load.size = geometry::Vec3(8, 8, 4);
  EXPECT_THAT(refusal_of([&] { extract(high, folder_ / "out", false); }), HasSubstr("no t"));
  EXPECT_FALSE(fs::exists(folder_ / "out"));
  EXPECT_FALSE(BlockStore::exists(folder_ / "out"));
}

}  // namespace
}  // namespace tileflight::place::truth_blocks_test
