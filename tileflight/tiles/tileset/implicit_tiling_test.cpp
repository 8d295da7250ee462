#include "tileflight/tiles/tileset/implicit_tiling.h"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>

#include "tests/test_data.h"
#include "tileflight/tiles/fetch/test_tilesets.h"
#include "tileflight/tiles/tileset/inspect.h"
#include "tileflight/tiles/tileset/load.h"
#include "tileflight/tiles/tileset/selection.h"
#include "tileflight/tiles/tileset/test_subtrees.h"

namespace tileflight::tileset::implicit_tiling_test {
namespace {

using base::test_support::error_of;
using base::test_support::to_bytes;
using fetch::test_support::Bytes;
using fetch::test_support::Json;
using fetch::test_support::MemorySource;
using geometry::Vec3;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using namespace test_support;

TEST(ImplicitTiling, ABoxIsDividedIntoHalves) {
  const ImplicitTiling quadtree = box_tiling(false);
  const auto box = std::get<OrientedBox>(implicit_volume(quadtree, {2, {3, 0, 0}}));
  EXPECT_LT((box.center - Vec3(6, -6, 0)).norm(), 1e-12);
  EXPECT_LT((box.half_axes.diagonal() - Vec3(2, 2, 4)).norm(), 1e-12);  // a quadtree does not divide the height
  const auto cell = std::get<OrientedBox>(implicit_volume(box_tiling(true), {1, {0, 1, 1}}));
  EXPECT_LT((cell.center - Vec3(-4, 4, 2)).norm(), 1e-12);
  EXPECT_LT((cell.half_axes.diagonal() - Vec3(4, 4, 2)).norm(), 1e-12);
  EXPECT_DOUBLE_EQ(implicit_geometric_error_m(quadtree, {3, {}}), 2.0);
}

/// The children of a tile cover it without gaps or overlaps, also across the antimeridian.
TEST(ImplicitTiling, ARegionIsDividedAcrossTheAntimeridian) {
  ImplicitTiling tiling = box_tiling(true);
  tiling.root_volume = GeographicRegion{3.0, 0.5, -3.0, 0.7, -10, 30};
  const auto west = std::get<GeographicRegion>(implicit_volume(tiling, {1, {0, 0, 0}}));
  const auto east = std::get<GeographicRegion>(implicit_volume(tiling, {1, {1, 1, 1}}));
  EXPECT_DOUBLE_EQ(west.west_rad, 3.0);
  EXPECT_NEAR(west.east_rad, M_PI, 1e-12);
  EXPECT_NEAR(std::abs(east.west_rad), M_PI, 1e-12);
  EXPECT_NEAR(east.east_rad, -3.0, 1e-12);
  EXPECT_NEAR(west.north_rad, 0.6, 1e-12);
  EXPECT_NEAR(east.south_rad, 0.6, 1e-12);
  EXPECT_NEAR(west.max_height_m, 10, 1e-12);
  EXPECT_NEAR(east.min_height_m, 10, 1e-12);
}

TEST(ImplicitTiling, Templates) {
  const ImplicitTiling quadtree = box_tiling(false);
  EXPECT_EQ(expand_template("{level}/{x}/{y}.glb", quadtree, {4, {11, 2, 0}}, "t"), "4/11/2.glb");
  EXPECT_EQ(expand_template("{z}{x", box_tiling(true), {4, {11, 2, 7}}, "t"), "7{x");
  EXPECT_THAT(base::test_support::error_of([&] { expand_template("{z}.glb", quadtree, {}, "t"); }),
              HasSubstr("the unknown variable {z}"));
  EXPECT_THAT(base::test_support::error_of([&] { expand_template("{lod}.glb", quadtree, {}, "t"); }),
              HasSubstr("the unknown variable {lod}"));
}

Json implicit_tileset() {
  Json root = fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 8, 8, 4), 16, "a/{level}.{x}.{y}.glb");
  root["refine"] = "REPLACE";
  root["implicitTiling"] = {{"subdivisionScheme", "QUADTREE"},
                            {"subtreeLevels", 2},
                            {"availableLevels", 4},
                            {"subtrees", {{"uri", "s/{level}.{x}.{y}.subtree"}}}};
  return fetch::test_support::tileset(root);
}

/// Two levels of subtrees, with a triangle for each of their tiles.
class ImplicitSource : public MemorySource {
 public:
  explicit ImplicitSource(const Json& tileset = implicit_tileset()) : fetch::test_support::MemorySource(tileset) {
    add("s/0.0.0.subtree", fetch::test_support::subtree(two_levels(), two_levels_binary()));
    const Json leaf = {{"tileAvailability", {{"constant", 1}}},
                       {"contentAvailability", {{{"constant", 1}}}},
                       {"childSubtreeAvailability", {{"constant", 0}}}};
    add("s/2.3.1.subtree", leaf.dump());
    add("s/2.1.2.subtree", fetch::test_support::subtree(leaf));
    for (const char* tile : {"0.0.0", "1.1.0", "1.0.1", "2.3.1", "2.1.2", "3.6.2", "3.7.2", "3.6.3", "3.7.3", "3.2.4",
                             "3.3.4", "3.2.5", "3.3.5"}) {
      add("a/" + std::string(tile) + ".glb", fetch::test_support::triangle_glb());
    }
  }
};

TEST(ImplicitTiling, TheFinestCutIsReadFromTwoLevelsOfSubtrees) {
  ImplicitSource source;
  const LoadedTiles tiles = load_region(source, "t", {});
  EXPECT_TRUE(tiles.complete);
  EXPECT_EQ(tiles.tiles_loaded, 8);
  EXPECT_DOUBLE_EQ(tiles.geometric_error_max_m, 2.0);
  EXPECT_EQ(source.reads().count("a/0.0.0.glb"), 0U);
  LoadOptions coarse;
  coarse.error_m = 8;
  ImplicitSource again;
  EXPECT_EQ(load_region(again, "t", coarse).tiles_loaded, 2);
  EXPECT_EQ(again.reads().count("s/2.3.1.subtree"), 0U);  // not needed, not read
}

TEST(ImplicitTiling, OnlyTheSubtreesOfTheRegionAreRead) {
  ImplicitSource source;
  LoadOptions options;
  options.center_local = Vec3(7, -3, 0);
  options.size = Vec3(1, 1, 1);
  const LoadedTiles tiles = load_region(source, "t", options);
  EXPECT_EQ(source.reads().count("s/2.1.2.subtree"), 0U);
  EXPECT_EQ(tiles.tiles_loaded, 1);
  EXPECT_EQ(source.reads().count("a/3.7.2.glb"), 1U);
}

TEST(ImplicitTiling, TheExtensionOf10ReadsAlike) {
  Json tileset = implicit_tileset();
  tileset["asset"]["version"] = "1.0";
  tileset["extensionsRequired"] = {"3DTILES_implicit_tiling"};
  Json implicit = tileset["root"]["implicitTiling"];
  tileset["root"].erase("implicitTiling");
  implicit.erase("availableLevels");
  implicit["maximumLevel"] = 3;
  tileset["root"]["extensions"]["3DTILES_implicit_tiling"] = implicit;
  ImplicitSource source(tileset);
  EXPECT_EQ(load_region(source, "t", {}).tiles_loaded, 8);
}

TEST(ImplicitTiling, AMissingSubtreeIsNamedAndCounted) {
  ImplicitSource source;
  source.remove("s/2.1.2.subtree");
  EXPECT_THAT(base::test_support::error_of([&] { load_region(source, "t", {}); }),
              HasSubstr("tile root: level 2, x 1, y 2: s/2.1.2.subtree: is missing"));
  const TilesetSummary summary = inspect_tileset(source);
  EXPECT_EQ(summary.failures.size(), 1U);
  LoadOptions options;
  options.allow_incomplete = true;
  const LoadedTiles tiles = load_region(source, "t", options);
  EXPECT_FALSE(tiles.complete);
  EXPECT_EQ(tiles.tiles_loaded, 4);
}

TEST(ImplicitTiling, InspectCountsItsTiles) {
  ImplicitSource source;
  const TilesetSummary summary = inspect_tileset(source);
  EXPECT_EQ(summary.tiles, 13);
  EXPECT_EQ(summary.depth(), 4);
  EXPECT_EQ(summary.subtrees, 3);
  EXPECT_EQ(summary.leaves, 8);
  EXPECT_EQ(summary.contents.at("glb"), 13);
  EXPECT_EQ(summary.content_files_missing, 0);
}

TEST(ImplicitTiling, WhatCannotBeDividedIsRefused) {
  const auto message = [](const std::function<void(Json&)>& change) {
    Json tileset = implicit_tileset();
    change(tileset["root"]);
    ImplicitSource source(tileset);
    return base::test_support::error_of([&] { load_region(source, "t", {}); });
  };
  EXPECT_THAT(message([](Json& r) { r["boundingVolume"] = {{"sphere", {0, 0, 0, 1}}}; }), HasSubstr("is a sphere"));
  EXPECT_THAT(message([](Json& r) {
                r["children"] =
                    Json::array({fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 1, 1, 1), 1)});
              }),
              HasSubstr("both implicitTiling and children"));
  EXPECT_THAT(message([](Json& r) { r["implicitTiling"]["subdivisionScheme"] = "KD"; }), HasSubstr("'KD'"));
  EXPECT_THAT(message([](Json& r) { r["implicitTiling"]["subtreeLevels"] = 0; }), HasSubstr("subtreeLevels is 0"));
  EXPECT_THAT(message([](Json& r) { r["implicitTiling"]["availableLevels"] = 99; }), HasSubstr("availableLevels"));
  EXPECT_THAT(message([](Json& r) { r["content"]["uri"] = "{w}.glb"; }), HasSubstr("{w}"));
}

TEST(ImplicitTiling, ExplicitTilesTakeVolumesFromTheirMetadata) {
  Json tileset = fetch::test_support::tileset(
      fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 8, 8, 8), 4, "a.glb"));
  tileset["schema"] = {
      {"classes",
       {{"t",
         {{"properties",
           {{"v",
             {{"type", "SCALAR"},
              {"componentType", "FLOAT64"},
              {"array", true},
              {"count", 4},
              {"semantic", "TILE_BOUNDING_SPHERE"}}},
            {"e", {{"type", "SCALAR"}, {"componentType", "FLOAT64"}, {"semantic", "TILE_GEOMETRIC_ERROR"}}}}}}}}}};
  tileset["root"]["metadata"] = {{"class", "t"}, {"properties", {{"v", {1, 2, 3, 4}}, {"e", 0.5}}}};
  const Tileset read = parse_tileset_json(tileset.dump(), "t");
  const auto sphere = std::get<BoundingSphere>(read.tiles[0].bounding_volume);
  EXPECT_EQ(sphere.center, Vec3(1, 2, 3));
  EXPECT_EQ(sphere.radius_m, 4);
  EXPECT_EQ(read.tiles[0].geometric_error_m, 0.5);
  // The same with the schema in a separate file, and with a warning and no volume if it cannot be read.
  Json outside = tileset;
  outside.erase("schema");
  outside["schemaUri"] = "schema.json";
  const std::string schema = tileset["schema"].dump();
  const Tileset same = parse_tileset_json(outside.dump(), "t", {}, [&](const std::string& uri) {
    EXPECT_EQ(uri, "schema.json");
    return schema;
  });
  EXPECT_EQ(same.tiles[0].geometric_error_m, 0.5);
  const Tileset without = parse_tileset_json(
      outside.dump(), "t", {}, [](const std::string& uri) -> std::string { throw InputError(uri, "is missing"); });
  EXPECT_EQ(without.tiles[0].geometric_error_m, 4);
  EXPECT_THAT(without.warnings, ElementsAre(HasSubstr("schema.json: is missing")));
}

TEST(Selection, AViewerOutsideOfTheRequestVolumeSeesNothing) {
  Json root = fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 8, 8, 8), 4, "a.glb");
  root["viewerRequestVolume"] = {{"sphere", {0, 0, 0, 20}}};
  MemorySource source(fetch::test_support::tileset(root));
  TilesetTree tree(source);
  RefinementCriterion wanted = region_criterion({Vec3::Zero(), Vec3::Constant(100)}, geometry::SE3(), 0);
  EXPECT_EQ(select_cut(tree, wanted).contents.size(), 1U);  // no viewer: it is part of the site
  const auto viewer_at = [&](double x) {
    wanted.contains_viewer = [x](const BoundingVolume& volume) {
      return intersects(volume, geometry::SE3(), geometry::Box3(Vec3(x, 0, 0), Vec3(x, 0, 0)));
    };
    return select_cut(tree, wanted).contents.size();
  };
  EXPECT_EQ(viewer_at(10), 1U);
  EXPECT_EQ(viewer_at(30), 0U);
}

/// A full tree of millions of tiles: every subtree file is the same.
class FullTree : public MemorySource {
 public:
  FullTree(bool octree, int levels, int subtree_levels) : MemorySource(tileset_of(octree, levels, subtree_levels)) {}

  Bytes read(const std::string& uri) override {
    if (!uri.ends_with(".subtree")) return MemorySource::read(uri);
    ++subtrees_read;
    return base::test_support::to_bytes(
        R"({"tileAvailability":{"constant":1},"contentAvailability":[{"constant":1}],"childSubtreeAvailability":{"constant":1}})");
  }

  std::size_t subtrees_read = 0;

 private:
  static Json tileset_of(bool octree, int levels, int subtree_levels) {
    const std::string place = octree ? "{level}.{x}.{y}.{z}" : "{level}.{x}.{y}";
    Json root = fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 2048, 2048, 2048), 2048,
                                          "a/" + place + ".glb");
    root["refine"] = "REPLACE";
    root["implicitTiling"] = {{"subdivisionScheme", octree ? "OCTREE" : "QUADTREE"},
                              {"subtreeLevels", subtree_levels},
                              {"availableLevels", levels},
                              {"subtrees", {{"uri", "s/" + place + ".subtree"}}}};
    return fetch::test_support::tileset(root);
  }
};

/// Of 5.6 million tiles (quadtree) and 2.4 million (octree), those of a few metres. Leaves are 2 m and 32 m wide.
TEST(Selection, OfARegionVisitsOnlyItsPartOfATreeOfMillions) {
  FullTree quadtree(false, 12, 4);
  TilesetTree tree(quadtree);
  const Region region{Vec3(100.5, -99.5, 0), Vec3(10, 10, 10)};
  const TileCut cut = select_cut(tree, region_criterion(region, geometry::SE3(), 0.0));
  EXPECT_EQ(cut.contents.size(), 36U) << "from 94 to 106, and from -106 to -94, in steps of 2 m";
  EXPECT_THAT(cut.failures, ::testing::IsEmpty());
  EXPECT_EQ(quadtree.subtrees_read, 1U + 1U + 4U);
  EXPECT_LT(tree.node_count(), 250U);

  FullTree octree(true, 8, 4);
  TilesetTree cubes(octree);
  EXPECT_EQ(select_cut(cubes, region_criterion(region, geometry::SE3(), 0.0)).contents.size(), 2U * 2U * 2U);
  EXPECT_EQ(octree.subtrees_read, 1U + 2U);
  EXPECT_LT(cubes.node_count(), 250U);
}

/// Ten levels in a single file: 350 000 tiles in a few hundred bytes.
TEST(Selection, ASubtreeFileIsNotExpandedWhole) {
  FullTree source(false, 10, 10);
  TilesetTree tree(source);
  const Region region{Vec3(101, -101, 0), Vec3(2, 2, 2)};
  EXPECT_EQ(select_cut(tree, region_criterion(region, geometry::SE3(), 0.0)).contents.size(), 1U);
  EXPECT_EQ(source.subtrees_read, 1U);
  EXPECT_LT(tree.node_count(), 60U);
}

TEST(Selection, OfMoreThanTheLimitsIsRefusedInOneLine) {
  const RefinementCriterion all = region_criterion({Vec3::Zero(), Vec3::Constant(5000)}, geometry::SE3(), 0.0);
  FullTree source(true, 32, 1);
  TilesetTree few_tiles(source, {.max_nodes = 1000});
  EXPECT_THAT(base::test_support::error_of([&] { select_cut(few_tiles, all); }),
              HasSubstr("has more than 1000 tiles in what was asked for; ask for a smaller region"));
  EXPECT_LE(few_tiles.node_count(), 1000U);
  TilesetTree few_files(source, {.max_files = 50});
  EXPECT_THAT(base::test_support::error_of([&] { select_cut(few_files, all); }),
              HasSubstr("more than 50 external tilesets and subtrees"));
}

LoadedTiles load(const std::filesystem::path& file) { return load_region(file.string(), {}); }

/// Every content lies inside its tile: the cells of a sparse cube, each about a quarter of its cell.
TEST(ImplicitTiling, RealSparseTrees) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/cesium_3d_tiles_samples/1.1");
  const LoadedTiles quadtree = load(folder / "SparseImplicitQuadtree" / "tileset.json");
  EXPECT_EQ(quadtree.tiles_loaded, 32);
  const LoadedTiles octree = load(folder / "SparseImplicitOctree" / "tileset.json");
  EXPECT_GT(octree.tiles_loaded, 0);
  EXPECT_EQ(octree.tiles_loaded, octree.tiles_wanted);
  for (const LoadedTiles* tiles : {&quadtree, &octree}) {
    ASSERT_FALSE(tiles->meshes.empty());
    geometry::Box3 box;
    for (const imaging::TexturedMesh& mesh : tiles->meshes) box.extend(geometry::bounds(mesh.mesh));
    EXPECT_LT((box.min() - tiles->region.box().min()).norm(), 0.1);
    EXPECT_LT((box.max() - tiles->region.box().max()).norm(), 0.1);
  }
}

}  // namespace
}  // namespace tileflight::tileset::implicit_tiling_test
