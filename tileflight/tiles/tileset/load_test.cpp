#include "tileflight/tiles/tileset/load.h"

#include <gmock/gmock.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/test_data.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/tiles/fetch/test_tilesets.h"
#include "tileflight/tiles/fetch/tile_source.h"
#include "tileflight/tiles/tileset/content_records.h"

namespace tileflight::tileset::load_test {
namespace {

using base::test_support::error_of;
using fetch::test_support::b3dm;
using fetch::test_support::box_volume;
using fetch::test_support::GltfWriter;
using fetch::test_support::Json;
using fetch::test_support::MemorySource;
using fetch::test_support::tile;
using fetch::test_support::triangle_glb;
using geometry::Box3;
using geometry::Vec3;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

LoadedTiles load(MemorySource& source, const LoadOptions& options = {}) {
  return load_region(source, "place", options);
}

/// A triangle of 2 m around x, in its own tile.
Json leaf(double x, const std::string& uri) {
  return fetch::test_support::tile(fetch::test_support::box_volume(x, 0, 0, 2, 2, 2), 0, uri);
}

std::string triangle_at(float x) { return fetch::test_support::triangle_glb({x - 1, 0, 0, x + 1, 0, 0, x, 1, 0}); }

/// Two leaves side by side below a coarse root.
class LoadRegion : public ::testing::Test {
 protected:
  LoadRegion() {
    Json root = fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 10, 2, 2), 5, "root.glb");
    root["children"] = {leaf(-5, "west.b3dm"), leaf(5, "east.glb")};
    Json json = fetch::test_support::tileset(root);
    json["asset"]["copyright"] = "Survey; City";
    source_.add("tileset.json", json.dump());
    source_.add("root.glb", triangle_at(0));
    source_.add("west.b3dm", fetch::test_support::b3dm(triangle_at(-5)));
    source_.add("east.glb", triangle_at(5));
  }
  MemorySource source_;
};

TEST(FlatTileset, HasARegion) {
  MemorySource source(fetch::test_support::tileset(tile(box_volume(0, 0, 0, 5, 5, 0), 0, "a.glb")));
  source.add("a.glb", triangle_glb({-1, 0, 0, 1, 0, 0, 0, 0, -1}));
  const LoadedTiles tiles = load(source);
  EXPECT_EQ(tiles.triangles, 1);
  EXPECT_GT(tiles.region.size.minCoeff(), 0.0);
}

/// The volumes that selections by views use are as large as what the contents hold.
TEST(WidenedVolumes, HoldWhatContentsHold) {
  for (const double out_m : {0.0, 7.0, 5000.0}) {
    MemorySource source(fetch::test_support::tileset(tile(box_volume(0, 0, 0, 2, 2, 2), 0, "a.glb")));
    source.add("a.glb", triangle_at(static_cast<float>(out_m)));
    TilesetTree tree(source);
    const TileCut cut = select_cut(tree, region_criterion({{0, 0, 0}, {9, 9, 9}}, geometry::SE3(), 0.0));
    EXPECT_EQ(widen_to_contents(source, tree, cut.contents, geometry::SE3()), out_m > 0.0);
    const double margin_m = out_m == 0.0 ? 0.0 : std::min(out_m + 1.0 - 2.0, 1000.0);
    EXPECT_NEAR(tree.volume_margin_m(), margin_m, 1e-3);
    const Box3 box = local_bounding_box(tree.volume(tree.root()), geometry::SE3());
    EXPECT_NEAR(box.max().x(), 2.0 + margin_m, 1e-3);
    EXPECT_NEAR(local_bounding_box(tree.stated_volume(cut.contents[0].node, 0), geometry::SE3()).max().x(), 2.0, 1e-9);
    EXPECT_FALSE(widen_to_contents(source, tree, cut.contents, geometry::SE3())) << "once";
  }
}

TEST_F(LoadRegion, WholeTilesetInOrder) {
  const LoadedTiles tiles = load(source_);
  EXPECT_EQ(tiles.tiles_wanted, 2);
  EXPECT_EQ(tiles.tiles_loaded, 2);
  EXPECT_EQ(tiles.tiles_failed, 0);
  EXPECT_TRUE(tiles.complete);
  EXPECT_EQ(tiles.triangles, 2);
  EXPECT_FALSE(tiles.local_frame.has_value());
  EXPECT_THAT(tiles.attribution, ElementsAre("City", "Survey"));
  ASSERT_EQ(tiles.meshes.size(), 2U);
  EXPECT_EQ(tiles.meshes[0].name, "west.b3dm");
  EXPECT_EQ(tiles.meshes[0].mesh.vertices[0], Vec3(-6, 0, 0));
  EXPECT_EQ(tiles.meshes[1].mesh.vertices[2], Vec3(5, 0, 1));
  EXPECT_EQ(tiles.region.size, Vec3(20, 4, 4));
}

TEST_F(LoadRegion, ReadsOnlyTheCut) {
  LoadOptions options;
  options.center_local = Vec3(5, 0, 0);
  options.size = Vec3(4, 4, 4);
  const LoadedTiles tiles = load(source_, options);
  EXPECT_THAT(source_.reads(), ElementsAre(::testing::Pair("east.glb", 1), ::testing::Pair("tileset.json", 1)));
  EXPECT_EQ(tiles.bytes_read,
            static_cast<std::int64_t>(source_.file("east.glb").size() + source_.file("tileset.json").size()));
  options.error_m = 5;
  const LoadedTiles coarse = load(source_, options);
  EXPECT_EQ(coarse.meshes.at(0).name, "root.glb");
  EXPECT_EQ(coarse.geometric_error_max_m, 5);
  EXPECT_NE(coarse.cut_hash, tiles.cut_hash);
}

TEST_F(LoadRegion, MissingTileIsNamedOrCounted) {
  source_.remove("west.b3dm");
  EXPECT_THAT(base::test_support::error_of([&] { load(source_); }), HasSubstr("west.b3dm: is missing"));
  LoadOptions options;
  options.allow_incomplete = true;
  const LoadedTiles tiles = load(source_, options);
  EXPECT_FALSE(tiles.complete);
  EXPECT_EQ(tiles.tiles_wanted, 2);
  EXPECT_EQ(tiles.tiles_loaded, 1);
  EXPECT_EQ(tiles.tiles_failed, 1);
  EXPECT_THAT(tiles.failures, ElementsAre("west.b3dm: is missing"));
}

TEST_F(LoadRegion, FirstFailureIsNamedWhateverTheThreadsDo) {
  source_.add("west.b3dm", std::string("garbage garbage"));
  source_.remove("east.glb");
  for (int i = 0; i < 20; ++i)
    EXPECT_THAT(base::test_support::error_of([&] { load(source_); }), HasSubstr("west.b3dm: is not a tile"));
}

TEST_F(LoadRegion, MissingExternalTilesetIsNamedOrCounted) {
  Json root = fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 10, 2, 2), 5);
  root["children"] = {leaf(-5, "west.json"), leaf(5, "east.glb")};
  source_.add("tileset.json", fetch::test_support::tileset(root).dump());
  EXPECT_THAT(base::test_support::error_of([&] { load(source_); }), HasSubstr("tile root/0: west.json: is missing"));
  LoadOptions options;
  options.allow_incomplete = true;
  const LoadedTiles tiles = load(source_, options);
  EXPECT_FALSE(tiles.complete);
  EXPECT_EQ(tiles.tiles_wanted, 2);
  EXPECT_EQ(tiles.tiles_failed, 1);
}

TEST_F(LoadRegion, EmptyRegionNamesTheExtent) {
  LoadOptions options;
  options.center_local = Vec3(500, 0, 0);
  options.size = Vec3(4, 4, 4);
  const std::string message = base::test_support::error_of([&] { load(source_, options); });
  EXPECT_THAT(message, HasSubstr("no tile with content overlaps the region x 498.0 … 502.0"));
  EXPECT_THAT(message, HasSubstr("spans x -10.0 … 10.0"));
}

TEST_F(LoadRegion, FlightThatSeesNothingIsToldWhereItIs) {
  LoadOptions options;
  const auto message_from = [&](const std::vector<Vec3>& positions) {
    options.flight = FlightSelection{};
    for (const Vec3& position : positions)
      options.flight->view_cones.push_back({position, Vec3::UnitZ(), 0.5, 1000.0});  // upwards
    return base::test_support::error_of([&] { load(source_, options); });
  };
  const std::string far = message_from({Vec3(500, 0, 30), Vec3(510, 5, 31)});
  EXPECT_THAT(far, HasSubstr("the flight sees nothing of the tileset: it flies at x 500.0 … 510.0, y 0.0 … 5.0, z 30.0 "
                             "… 31.0 m, and the tileset spans x -10.0 … 10.0"));
  EXPECT_THAT(far, HasSubstr(" m away; positions are metres east, north and up"));
  const std::string above = message_from({Vec3(0, 0, 12)});
  EXPECT_THAT(above, HasSubstr(", 10 m away; check the camera's direction (pitch_deg -90 is straight down"));
}

TEST_F(LoadRegion, TilesetWithoutContentSaysSo) {
  source_.add("tileset.json", fetch::test_support::tileset(
                                  fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 10, 2, 2), 5))
                                  .dump());
  EXPECT_THAT(base::test_support::error_of([&] { load(source_); }), HasSubstr("the tileset is empty"));
}

TEST_F(LoadRegion, WrongOptionsAreTold) {
  const auto message = [&](const auto& change) {
    LoadOptions options;
    change(options);
    return base::test_support::error_of([&] { load(source_, options); });
  };
  EXPECT_THAT(message([](LoadOptions& o) {
                o.center = geometry::Geodetic{1, 2, {0}};
                o.size = Vec3(1, 1, 1);
              }),
              HasSubstr("not georeferenced: give --center-local"));
  EXPECT_THAT(message([](LoadOptions& o) { o.center_local = Vec3(0, 0, 0); }), HasSubstr("centre without a size"));
  EXPECT_THAT(message([](LoadOptions& o) { o.size = Vec3(-1, 1, 1); }), HasSubstr("above 0 metres"));
  EXPECT_THAT(message([](LoadOptions& o) { o.error_m = -1; }), HasSubstr("--error"));
  EXPECT_THAT(message([](LoadOptions& o) { o.origin = geometry::Geodetic{91, 0, {0}}; }), HasSubstr("latitude"));
  EXPECT_THAT(message([](LoadOptions& o) {
                o.center = geometry::Geodetic{1, 2, {0}};
                o.center_local = Vec3(0, 0, 0);
              }),
              HasSubstr("not both"));
}

TEST_F(LoadRegion, HeightNotGivenSpansTheTileset) {
  LoadOptions options;
  options.center_local = Vec3(5, 0, NAN);
  options.size = Vec3(4, 4, 0);
  const LoadedTiles tiles = load(source_, options);
  EXPECT_EQ(tiles.region.center, Vec3(5, 0, 0));
  EXPECT_EQ(tiles.region.size, Vec3(4, 4, 4));
  options.center_local = Vec3(5, 0, 1);
  EXPECT_EQ(load(source_, options).region.size.z(), 6);  // as far below 1 as the tileset reaches
}

TEST_F(LoadRegion, OriginGivesAPlaceToATilesetWithoutOne) {
  LoadOptions options;
  options.origin = geometry::Geodetic{-0.24, -78.52, {0}};
  options.size = Vec3(4, 4, 4);
  const geometry::LocalFrame frame(*options.origin);
  options.center = frame.geodetic_from_local(Vec3(5, 0, 0));
  const LoadedTiles tiles = load(source_, options);
  ASSERT_TRUE(tiles.local_frame.has_value());
  EXPECT_EQ(tiles.local_frame->origin().latitude_deg, -0.24);
  EXPECT_LT((tiles.region.center - Vec3(5, 0, 0)).norm(), 1e-6);
  EXPECT_EQ(tiles.meshes.at(0).mesh.vertices[0], Vec3(4, 0, 0));
}

/// A georeferenced site: the tree's frame is earth-centred, by a transform that also scales.
TEST(LoadRegionOnEarth, LocalFrameIsEastNorthUpAtTheCentre) {
  const geometry::LocalFrame site({48.0, 11.0, {500}});
  Json root = fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 10, 10, 10), 0, "a.glb");
  geometry::Mat4 T = site.T_ecef_local().matrix();
  T.topLeftCorner<3, 3>() *= 2;
  root["transform"] = std::vector<double>(T.data(), T.data() + 16);
  MemorySource source(fetch::test_support::tileset(root));
  source.add("a.glb", fetch::test_support::triangle_glb({1, 2, 3, 4, 5, 6, 7, 8, 10}));
  const LoadedTiles whole = load(source);
  ASSERT_TRUE(whole.local_frame.has_value());
  EXPECT_NEAR(whole.local_frame->origin().latitude_deg, 48, 1e-9);
  EXPECT_NEAR(whole.local_frame->origin().height.m, 500, 1e-6);
  EXPECT_LT((whole.meshes.at(0).mesh.vertices[0] - Vec3(2, -6, 4)).norm(), 1e-6);
  EXPECT_LT((whole.region.size - Vec3(40, 40, 40)).norm(), 1e-6);

  LoadOptions options;
  options.center = site.geodetic_from_local(Vec3(3, 4, 5));
  options.size = Vec3(10, 10, 10);
  const LoadedTiles off = load(source, options);
  EXPECT_LT((off.meshes.at(0).mesh.vertices[0] - Vec3(-1, -10, -1)).norm(), 1e-4);  // frames tilt by a microradian
  options.origin = site.origin();
  const LoadedTiles same = load(source, options);
  EXPECT_LT((same.meshes.at(0).mesh.vertices[0] - Vec3(2, -6, 4)).norm(), 1e-6);
  EXPECT_LT((same.region.center - Vec3(3, 4, 5)).norm(), 1e-6);

  options.center->height.m = NAN;
  options.size->z() = 0;
  EXPECT_NEAR(load(source, options).region.size.z(), 40, 1e-6);
  options.origin.reset();
  EXPECT_NEAR(load(source, options).local_frame->origin().height.m, 500, 1e-3);

  LoadOptions local;
  local.center_local = Vec3(0, 0, 0);
  local.size = Vec3(1, 1, 1);
  EXPECT_THAT(base::test_support::error_of([&] { load(source, local); }), HasSubstr("is georeferenced: give --center"));
}

TEST(LoadRegionOnEarth, ALargePlaceWantsACentre) {
  MemorySource source(fetch::test_support::tileset(
      fetch::test_support::tile({{"region", {0.1, 0.8, 0.11, 0.81, 0, 100}}}, 0, "a.glb")));
  const std::string message = base::test_support::error_of([&] { load(source); });
  EXPECT_THAT(message, HasSubstr("more than 4 km²; give --center and --size"));
  EXPECT_THAT(message, HasSubstr("around latitude 46.1"));
}

TEST(LoadRegionOnEarth, TheGlobeDoesNotTellTheHeightOfTheGround) {
  Json root = fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 7e6, 7e6, 7e6), 1e6);
  MemorySource source(fetch::test_support::tileset(root));
  LoadOptions options;
  options.center = geometry::Geodetic{48, 11, {NAN}};
  options.size = Vec3(100, 100, 0);
  EXPECT_THAT(base::test_support::error_of([&] { load(source, options); }), HasSubstr("give the height"));
}

TEST(LoadRegionFiles, OneFileInManyPlacesIsReadOnce) {
  Json root = fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 100, 100, 100), 5);
  for (int i = 0; i < 10; ++i) {
    Json child = fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 2, 2, 2), 0, "a.glb");
    child["transform"] = {i % 2 == 0 ? 1 : -1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 10 * i, 0, 0, 1};
    root["children"].push_back(child);
  }
  MemorySource source(fetch::test_support::tileset(root));
  source.add("a.glb", triangle_at(0));
  const LoadedTiles tiles = load(source);
  EXPECT_EQ(source.reads().at("a.glb"), 1);
  ASSERT_EQ(tiles.meshes.size(), 10U);
  EXPECT_EQ(tiles.meshes[4].mesh.vertices[1], Vec3(41, 0, 0));
  EXPECT_EQ(tiles.meshes[5].mesh.vertices[1], Vec3(49, 0, 0));  // mirrored, so wound the other way round
  EXPECT_EQ(tiles.meshes[5].mesh.triangles[0], (geometry::Triangle{0, 2, 1}));
}

TEST(LoadRegionFiles, ATextureThatTilesShareIsDecodedOnce) {
  Json root = fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 100, 100, 100), 5);
  MemorySource source;
  for (int i = 0; i < 8; ++i) {
    const std::string uri = "sub/" + std::to_string(i) + ".glb";
    root["children"].push_back(fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 2, 2, 2), 0, uri));
    GltfWriter writer;
    writer.json()["images"] = {{{"uri", "../shared.png"}}};
    writer.json()["textures"] = {{{"source", 0}}};
    writer.json()["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
    const std::size_t positions = writer.add_accessor<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}, 3);
    const std::size_t uv = writer.add_accessor<float>({0, 0, 1, 0, 0, 1}, 2);
    writer.add_primitive({{"attributes", {{"POSITION", positions}, {"TEXCOORD_0", uv}}}, {"material", 0}});
    source.add(uri, writer.glb());
  }
  source.add("tileset.json", fetch::test_support::tileset(root).dump());
  source.add("shared.png", imaging::encode_png(imaging::RgbImage(4, 4, {1, 2, 3})));
  const LoadedTiles tiles = load(source);
  EXPECT_EQ(source.reads().at("shared.png"), 1);
  ASSERT_GT(tiles.meshes.size(), 1U);
  for (const imaging::TexturedMesh& mesh : tiles.meshes) EXPECT_EQ(mesh.texture, tiles.meshes[0].texture);
  source.add("shared.png", std::string("garbage"));
  EXPECT_THAT(base::test_support::error_of([&] { load(source); }), HasSubstr("shared.png"));
  LoadOptions bare;
  bare.textures = false;
  EXPECT_TRUE(load(source, bare).complete);
}

TEST(LoadRegionFiles, TilesetsUpAxisTurnsItsContents) {
  Json json = fetch::test_support::tileset(
      fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 9, 9, 9), 0, "a.glb"));
  json["asset"]["gltfUpAxis"] = "Z";
  MemorySource source(json);
  source.add("a.glb", fetch::test_support::triangle_glb({1, 2, 3, 4, 5, 6, 7, 8, 9}));
  EXPECT_EQ(load(source).meshes.at(0).mesh.vertices[0], Vec3(1, 2, 3));
}

TEST(LoadRegionFiles, DataUriAsContent) {
  // Percent escapes can carry any byte; base64 would hide the tested characters.
  std::string escaped;
  for (const char c : fetch::test_support::triangle_glb()) {
    char code[4];
    std::snprintf(code, sizeof code, "%%%02X", static_cast<unsigned char>(c));
    escaped += code;
  }
  MemorySource source(fetch::test_support::tileset(fetch::test_support::tile(
      fetch::test_support::box_volume(0, 0, 0, 2, 2, 2), 0, "data:model/gltf-binary," + escaped)));
  EXPECT_EQ(load(source).triangles, 1);
}

TEST(LoadRegionFiles, RequiredExtensionsAreRefusedByName) {
  Json json = fetch::test_support::tileset(
      fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 2, 2, 2), 0, "a.glb"));
  json["extensionsRequired"] = {"ACME_secret"};
  MemorySource source(json);
  EXPECT_THAT(base::test_support::error_of([&] { load(source); }), HasSubstr("ACME_secret"));
}

TEST(LoadRegionFiles, ProgressReachesTheEnd) {
  MemorySource source(fetch::test_support::tileset(
      fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 2, 2, 2), 0, "a.glb")));
  source.add("a.glb", triangle_at(0));
  std::int64_t last = 0;
  load_region(source, "place", {}, [&](std::int64_t done, std::int64_t total, std::string_view) {
    last = done;
    if (done > 0) {
      EXPECT_EQ(total, 1);
    }
  });
  EXPECT_EQ(last, 1);
}

Box3 bounds_of(const LoadedTiles& tiles) {
  Box3 box;
  for (const imaging::TexturedMesh& mesh : tiles.meshes) box.extend(geometry::bounds(mesh.mesh));
  return box;
}

double area_of(const LoadedTiles& tiles) {
  double area_m2 = 0;
  for (const imaging::TexturedMesh& mesh : tiles.meshes) area_m2 += geometry::surface_area_m2(mesh.mesh);
  return area_m2;
}

/// Counts and area from another program: see the docs of the test data.
TEST(LoadRegionRealData, MachangaraWhole) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/machangara_photogrammetry");
  LoadOptions options;
  options.textures = false;
  const LoadedTiles tiles = load_region(folder.string(), options);
  EXPECT_TRUE(tiles.complete);
  EXPECT_EQ(tiles.tiles_loaded, 462);
  EXPECT_EQ(tiles.triangles, 3029330);
  EXPECT_NEAR(area_of(tiles), 356094.874, 0.001);
  EXPECT_EQ(tiles.geometric_error_max_m, 0);
  EXPECT_NEAR(bounds_of(tiles).center().z(), 2891.5, 1);
}

TEST(LoadRegionRealData, MachangaraMiddle) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/machangara_photogrammetry");
  LoadOptions options;
  options.center_local = Vec3(347.8, -131.4, 2893);
  options.size = Vec3(250, 250, 48);
  const LoadedTiles tiles = load_region(folder.string(), options);
  const Box3 box = tiles.region.box();
  std::int64_t touching = 0;
  for (const imaging::TexturedMesh& mesh : tiles.meshes) {
    EXPECT_NE(mesh.texture, nullptr);
    EXPECT_EQ(mesh.uv.size(), mesh.mesh.vertices.size());
    for (const geometry::Triangle& triangle : mesh.mesh.triangles) {
      Box3 corners;
      for (const std::uint32_t corner : triangle) corners.extend(mesh.mesh.vertices[corner]);
      touching += corners.intersects(box) ? 1 : 0;
    }
  }
  EXPECT_EQ(touching, 838435);
}

TEST(LoadRegionRealData, SameResultForAnyNumberOfThreads) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/machangara_photogrammetry");
  LoadOptions options;
  options.center_local = Vec3(347.8, -131.4, 2893);
  options.size = Vec3(60, 60, 48);
  const LoadedTiles many = load_region(folder.string(), options);
  const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
  const LoadedTiles one = load_region(folder.string(), options);
  EXPECT_EQ(many.cut_hash, one.cut_hash);
  ASSERT_EQ(many.meshes.size(), one.meshes.size());
  for (std::size_t i = 0; i < one.meshes.size(); ++i) {
    EXPECT_EQ(many.meshes[i].name, one.meshes[i].name);
    EXPECT_EQ(many.meshes[i].mesh.vertices, one.meshes[i].mesh.vertices);
    EXPECT_EQ(many.meshes[i].mesh.triangles, one.meshes[i].mesh.triangles);
    EXPECT_EQ(many.meshes[i].texture->pixels, one.meshes[i].texture->pixels);
  }
}

TEST(LoadRegionRealData, MeshoptAndQuantisedAndWebp) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/paphos_agora_meshopt");
  const LoadedTiles tiles = load_region(folder.string(), {});
  EXPECT_EQ(tiles.tiles_loaded, 7);
  EXPECT_EQ(tiles.triangles, 195591);
  EXPECT_TRUE(
      std::any_of(tiles.meshes.begin(), tiles.meshes.end(), [](const auto& mesh) { return mesh.texture != nullptr; }));
}

}  // namespace
}  // namespace tileflight::tileset::load_test
