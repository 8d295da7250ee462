#include "tileflight/tiles/tileset/selection.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "tileflight/tiles/fetch/test_tilesets.h"

namespace tileflight::tileset::selection_test {
namespace {

using base::test_support::error_of;
using fetch::test_support::box_volume;
using fetch::test_support::Json;
using fetch::test_support::MemorySource;
using fetch::test_support::tile;
using geometry::Vec3;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double kWorld = 1000;

TileCut cut_of(MemorySource& source, const Region& region = {Vec3::Zero(), Vec3::Constant(2 * kWorld)},
               double error_m = 0) {
  TilesetTree tree(source);
  return select_cut(tree, region_criterion(region, geometry::SE3(), error_m));
}

std::vector<std::string> uris(const TileCut& cut) {
  std::vector<std::string> out;
  for (const CutContent& content : cut.contents) out.push_back(content.uri);
  return out;
}

/// Four quarters of a square of 200 m, each with two halves; errors 20, 10, 0.
Json quadtree(const std::string& refine) {
  Json root = fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 100, 100, 10), 20, "root.glb");
  root["refine"] = refine;
  int i = 0;
  for (const double y : {-50.0, 50.0}) {
    for (const double x : {-50.0, 50.0}) {
      const std::string name = "q" + std::to_string(i++);
      Json quarter = fetch::test_support::tile(fetch::test_support::box_volume(x, y, 0, 50, 50, 10), 10, name + ".glb");
      quarter["children"] = {
          fetch::test_support::tile(fetch::test_support::box_volume(x - 25, y, 0, 25, 50, 10), 0, name + "w.glb"),
          fetch::test_support::tile(fetch::test_support::box_volume(x + 25, y, 0, 25, 50, 10), 0, name + "e.glb")};
      root["children"].push_back(quarter);
    }
  }
  return fetch::test_support::tileset(root);
}

TEST(SelectCut, ReplaceTakesTheFinestThatIsWanted) {
  MemorySource source(quadtree("REPLACE"));
  EXPECT_THAT(uris(cut_of(source)),
              ElementsAre("q0w.glb", "q0e.glb", "q1w.glb", "q1e.glb", "q2w.glb", "q2e.glb", "q3w.glb", "q3e.glb"));
  const TileCut middle = cut_of(source, {Vec3::Zero(), Vec3::Constant(2 * kWorld)}, 10);
  EXPECT_THAT(uris(middle), ElementsAre("q0.glb", "q1.glb", "q2.glb", "q3.glb"));
  EXPECT_EQ(middle.geometric_error_max_m, 10);
  EXPECT_THAT(uris(cut_of(source, {Vec3::Zero(), Vec3::Constant(2 * kWorld)}, 20)), ElementsAre("root.glb"));
}

TEST(SelectCut, LeavesOutWhatDoesNotMeetTheRegion) {
  MemorySource source(quadtree("REPLACE"));
  EXPECT_THAT(uris(cut_of(source, {Vec3(90, 90, 0), Vec3(10, 10, 10)})), ElementsAre("q3e.glb"));
  EXPECT_THAT(uris(cut_of(source, {Vec3(60, -60, 0), Vec3(50, 10, 10)})), ElementsAre("q1w.glb", "q1e.glb"));
  EXPECT_THAT(uris(cut_of(source, {Vec3(0, 0, 50), Vec3(10, 10, 10)})), IsEmpty());
}

TEST(SelectCut, AddKeepsTheAncestors) {
  MemorySource source(quadtree("ADD"));
  const TileCut cut = cut_of(source, {Vec3(90, 90, 0), Vec3(10, 10, 10)});
  EXPECT_THAT(uris(cut), ElementsAre("root.glb", "q3.glb", "q3e.glb"));
  EXPECT_EQ(cut.geometric_error_max_m, 0);  // of where refinement stopped
}

TEST(SelectCut, ReadsNoContents) {
  MemorySource source(quadtree("REPLACE"));
  cut_of(source);
  EXPECT_THAT(source.reads(), ElementsAre(::testing::Pair("tileset.json", 1)));
}

TEST(SelectCut, HashNamesTheCut) {
  MemorySource source(quadtree("REPLACE"));
  const std::string all = cut_of(source).hash;
  EXPECT_EQ(all, cut_of(source).hash);
  EXPECT_EQ(all.size(), 64U);
  EXPECT_NE(all, cut_of(source, {Vec3(90, 90, 0), Vec3(10, 10, 10)}).hash);
}

TEST(SelectCut, PassesThroughTilesWithoutContent) {
  Json json = quadtree("REPLACE");
  json["root"].erase("content");
  json["root"]["children"][3]["content"] = nullptr;
  MemorySource source(json);
  // Fine enough at the root already, but the root shows nothing.
  EXPECT_THAT(uris(cut_of(source, {Vec3::Zero(), Vec3::Constant(2 * kWorld)}, 1e6)),
              ElementsAre("q0.glb", "q1.glb", "q2.glb", "q3w.glb", "q3e.glb"));
}

TEST(SelectCut, ChildWithALargerErrorThanItsParent) {
  Json json = quadtree("REPLACE");
  json["root"]["geometricError"] = 5;
  MemorySource source(json);
  EXPECT_THAT(uris(cut_of(source, {Vec3(90, 90, 0), Vec3(10, 10, 10)}, 5)), ElementsAre("root.glb"));
  EXPECT_THAT(uris(cut_of(source, {Vec3(90, 90, 0), Vec3(10, 10, 10)}, 4)), ElementsAre("q3e.glb"));
}

TEST(SelectCut, EnormousErrorIsOnlyANumber) {
  Json json = quadtree("REPLACE");
  json["root"]["geometricError"] = 9007199254740991.0;
  MemorySource source(json);
  EXPECT_EQ(cut_of(source).contents.size(), 8U);
}

TEST(SelectCut, ChildrenThatMissTheRegionStandForNothingThere) {
  Json json = quadtree("REPLACE");
  json["root"]["children"].erase(3);  // nothing of the quarter is there, though the root's box says so
  MemorySource source(json);
  EXPECT_THAT(uris(cut_of(source, {Vec3(90, 90, 0), Vec3(10, 10, 10)})), IsEmpty());
}

TEST(SelectCut, TransformsMoveVolumes) {
  Json root = fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 1, 1, 1), 10);
  root["transform"] = {0, 2, 0, 0, -2, 0, 0, 0, 0, 0, 2, 0, 100, 0, 0, 1};  // quarter turn, twice as large, then east
  root["children"] = Json::array({fetch::test_support::tile(fetch::test_support::box_volume(10, 0, 0, 1, 1, 1), 0,
                                                            "a.glb")});  // at (100, 20, 0) +- 2
  root["boundingVolume"] = fetch::test_support::box_volume(0, 0, 0, 20, 20, 20);
  MemorySource source(fetch::test_support::tileset(root));
  EXPECT_THAT(uris(cut_of(source, {Vec3(100, 21.9, 0), Vec3(1, 0.1, 1)})), ElementsAre("a.glb"));
  EXPECT_THAT(uris(cut_of(source, {Vec3(100, 22.2, 0), Vec3(1, 0.1, 1)})), IsEmpty());
  EXPECT_THAT(uris(cut_of(source, {Vec3(110, 0, 0), Vec3(1, 1, 1)})), IsEmpty());
}

TEST(SelectCut, AScalingTransformScalesTheErrorFrom11On) {
  for (const auto& [version, wanted_m] : {std::pair("1.0", 5.0), std::pair("1.1", 15.0)}) {
    Json root = fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 1, 1, 1), 5, "a.glb");
    root["transform"] = {2, 0, 0, 0, 0, 3, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1};
    MemorySource source(fetch::test_support::tileset(root, version));
    EXPECT_NEAR(cut_of(source).geometric_error_max_m, wanted_m, 1e-12) << version;
  }
}

TEST(SelectCut, ContentVolumesTighten) {
  Json root = fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 10, 10, 10), 0);
  root["contents"] = {{{"uri", "a.glb"}, {"boundingVolume", fetch::test_support::box_volume(-5, 0, 0, 1, 1, 1)}},
                      {{"uri", "b.glb"}}};
  MemorySource source(fetch::test_support::tileset(root));
  EXPECT_THAT(uris(cut_of(source, {Vec3(5, 0, 0), Vec3(1, 1, 1)})), ElementsAre("b.glb"));
  EXPECT_THAT(uris(cut_of(source, {Vec3(-5, 0, 0), Vec3(1, 1, 1)})), ElementsAre("a.glb", "b.glb"));
}

TEST(SelectCut, ExternalTilesetsAreFollowedWhereTheyAreWanted) {
  Json root = fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 100, 100, 10), 50);
  root["refine"] = "ADD";
  root["children"] = {
      fetch::test_support::tile(fetch::test_support::box_volume(-50, 0, 0, 50, 100, 10), 20, "west/t.json"),
      fetch::test_support::tile(fetch::test_support::box_volume(50, 0, 0, 50, 100, 10), 20, "east/t.json?v=2")};
  root["children"][1]["transform"] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 50, 0, 0, 1};
  root["children"][1]["boundingVolume"] = fetch::test_support::box_volume(0, 0, 0, 50, 100, 10);
  MemorySource source(fetch::test_support::tileset(root));
  Json east = fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 50, 100, 10), 10,
                                        "a.glb");  // no refine: ADD from outside
  east["children"] = Json::array(
      {fetch::test_support::tile(fetch::test_support::box_volume(25, 0, 0, 25, 100, 10), 0, "../b%20c.glb")});
  source.add("east/t.json?v=2", fetch::test_support::tileset(east).dump());

  EXPECT_THAT(uris(cut_of(source, {Vec3(90, 0, 0), Vec3(5, 5, 5)})), ElementsAre("east/a.glb", "b%20c.glb"));
  EXPECT_EQ(source.reads().count("west/t.json"), 0U);
  const TileCut all = cut_of(source);
  EXPECT_THAT(all.failures, ElementsAre(HasSubstr("tileset.json: tile root/0: west/t.json: is missing")));
  EXPECT_EQ(all.contents.size(), 2U);
}

TEST(SelectCut, ExternalTilesetWithoutATellingName) {
  MemorySource source(fetch::test_support::tileset(
      fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 1, 1, 1), 1, "node?id=7")));
  source.add("node?id=7",
             fetch::test_support::tileset(
                 fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 1, 1, 1), 0, "node?id=8"))
                 .dump());
  source.add("node?id=8", fetch::test_support::triangle_glb());
  EXPECT_THAT(uris(cut_of(source)), ElementsAre("node?id=8"));
}

TEST(SelectCut, CyclesAreNamed) {
  MemorySource source(fetch::test_support::tileset(
      fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 1, 1, 1), 1, "a/b.json")));
  source.add("a/b.json",
             fetch::test_support::tileset(
                 fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 1, 1, 1), 1, "../tileset.json"))
                 .dump());
  EXPECT_THAT(cut_of(source).failures, ElementsAre(HasSubstr("form a cycle: tileset.json → a/b.json → tileset.json")));
  source.add("a/b.json",
             fetch::test_support::tileset(
                 fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 1, 1, 1), 1, "./b.json"))
                 .dump());
  EXPECT_THAT(cut_of(source).failures, ElementsAre(HasSubstr("form a cycle: a/b.json → a/b.json")));
}

TEST(SelectCut, OneFileMayStandInSeveralPlaces) {
  Json root = fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 100, 100, 10), 50);
  for (const double x : {0.0, 10.0}) {
    Json child = fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 1, 1, 1), 20, "t.json");
    child["transform"] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, 0, 0, 1};
    root["children"].push_back(child);
  }
  MemorySource source(fetch::test_support::tileset(root));
  source.add("t.json", fetch::test_support::tileset(
                           fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 1, 1, 1), 0, "a.glb"))
                           .dump());
  EXPECT_EQ(cut_of(source).contents.size(), 2U);
  EXPECT_EQ(cut_of(source, {Vec3(10, 0, 0), Vec3(1, 1, 1)}).contents.size(), 1U);
  EXPECT_EQ(source.reads().at("t.json"), 2);  // once a tree
}

TEST(SelectCut, LimitsOnExternalTilesets) {
  // Each level names the next twice: 2^40 tiles without a limit.
  MemorySource source;
  for (int i = 0; i < 40; ++i) {
    Json root = fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 1, 1, 1), 1);
    const std::string next = "t" + std::to_string(i + 1) + ".json";
    root["children"] = {fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 1, 1, 1), 1, next),
                        fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 1, 1, 1), 1, next)};
    source.add(i == 0 ? "tileset.json" : "t" + std::to_string(i) + ".json", fetch::test_support::tileset(root).dump());
  }
  const RefinementCriterion everything = region_criterion({Vec3::Zero(), Vec3::Constant(kWorld)}, geometry::SE3(), 0);
  TilesetTree narrow(source, {.file = {}, .max_external_chain = 5});
  const TileCut chain = select_cut(narrow, everything);
  EXPECT_EQ(chain.failures.size(), 32U);
  EXPECT_THAT(chain.failures[0], HasSubstr("more than 5 deep"));
  TilesetTree small(source, {.file = {}, .max_external_chain = 100, .max_nodes = 1000});
  EXPECT_THAT(error_of([&] { select_cut(small, everything); }), HasSubstr("more than 1000 tiles"));
  EXPECT_LE(small.node_count(), 1000U);
}

/// The position of such a tile is unknown: it is reported for every request.
TEST(SelectCut, NamesTheTileThatNeedsWhatIsLacking) {
  Json json = quadtree("REPLACE");
  json["root"]["children"][2]["boundingVolume"] = {{"extensions", {{"ACME_cone", {{"half_angle", 1}}}}}};
  MemorySource source(json);
  EXPECT_THAT(cut_of(source).failures,
              ElementsAre("tileset.json: tile root/2: the bounding volume ACME_cone is not supported"));
  EXPECT_EQ(cut_of(source, {Vec3(90, 90, 0), Vec3(10, 10, 10)}).failures.size(), 1U);
}

}  // namespace
}  // namespace tileflight::tileset::selection_test
