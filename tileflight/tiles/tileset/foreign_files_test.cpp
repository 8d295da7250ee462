#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "tests/test_data.h"
#include "tileflight/core/base/files.h"
#include "tileflight/tiles/fetch/test_tilesets.h"
#include "tileflight/tiles/tile_content/content.h"
#include "tileflight/tiles/tileset/inspect.h"
#include "tileflight/tiles/tileset/load.h"
#include "tileflight/tiles/tileset/subtree.h"

/// Third-party files, valid and broken: each is read correctly or gives one clear error line.
namespace tileflight::tileset::foreign_files_test {
namespace {

namespace fs = std::filesystem;
using base::test_support::error_of;
using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::Not;

std::vector<fs::path> files_below(const fs::path& folder, const std::vector<std::string>& endings) {
  std::vector<fs::path> files;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
    const std::string ending = entry.path().extension().string();
    if (std::find(endings.begin(), endings.end(), ending) != endings.end()) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

LoadedTiles load(const fs::path& file, const LoadOptions& options = {}) { return load_region(file.string(), options); }

TEST(ForeignFiles, EveryTilesetOfTheValidatorIsReadOrNamed) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "invalid/validator_specs");
  int read = 0;
  int refused = 0;
  int inspectable = 0;
  for (const fs::path& file : files_below(folder, {".json"})) {
    SCOPED_TRACE(file);
    const std::string message = base::test_support::error_of([&] { load(file); });
    const std::string inspected = base::test_support::error_of([&] { inspect_tileset(file.string()); });
    ++(message.empty() ? read : refused);
    inspectable += inspected.empty() ? 1 : 0;
    EXPECT_THAT(message, Not(HasSubstr("\n")));
    EXPECT_THAT(inspected, Not(HasSubstr("\n")));
    EXPECT_LT(message.size(), 1000U);
  }
  // Most tilesets refer to contents that are not in the repository.
  EXPECT_GE(read, 16);
  EXPECT_GT(refused, 100);
  EXPECT_GT(inspectable, 100);
}

/// Faults that change what would be loaded, and a word of the expected message.
TEST(ForeignFiles, FaultsOfTheValidatorAreNamed) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "invalid/validator_specs/tilesets");
  const std::pair<const char*, const char*> cases[] = {
      {"boundingVolumeBoxArrayInvalidElementType.json", "box is string, expected a number"},
      {"boundingVolumeRegionArrayElementsOutOfRange.json", "boundingVolume.region has an angle outside of its range"},
      {"boundingVolumeRegionInvalidArrayLength.json", "region has"},
      {"boundingVolumeSphereArrayElementOutOfRange.json", "radius of the bounding sphere is negative"},
      {"extensionsRequiredInvalidType.json", "extensionsRequired is"},
      {"implicitTilingValid.json", "example-0-0-0.subtree: is missing"},
      {"implicitTilingContentsUriTemplateVariableInvalid.json", "the unknown variable {"},
      {"implicitTilingSubtreeLevelsInvalidValue.json", "subtreeLevels"},
      {"implicitTilingSubtreesUriMissing.json", "subtrees.uri is missing"},
      {"implicitTilingInvalidType.json", "implicitTiling is"},
      {"tileContentBoundingVolumeInvalidType.json", "boundingVolume is"},
      {"tileContentsInvalidType.json", "contents is"},
      {"tileRefineWrongType.json", "refine is"},
      {"tilesetGeometricErrorNegative.json", "geometricError is negative"},
      {"tileTransformNotAffine.json", "the transform is not affine"},
      {"extensionRequiredButNotUsed.json", "needs extensions that are not supported"}};
  for (const auto& [file, wanted] : cases) {
    const std::filesystem::path path = folder / file;
    EXPECT_THAT(base::test_support::error_of([&] { load(path); }), HasSubstr(wanted)) << file;
  }
}

TEST(ForeignFiles, WhatTheValidatorCallsValidIsRead) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "invalid/validator_specs/tilesets");
  for (const char* file : {"validTilesetWithValidB3dm.json", "validTilesetWithValidGltf.json"}) {
    EXPECT_GT(load(folder / file).triangles, 0) << file;
  }
  // Their only fault is the alignment of their parts.
  EXPECT_EQ(load(folder / "validTilesetWithInvalidPnts.json").points, 1000);
  EXPECT_GE(load(folder / "validTilesetWithInvalidI3dm.json").meshes.size(), 25U);
}

TEST(ForeignFiles, EveryContentIsReadOrNamed) {
  for (const char* name : {"invalid/validator_specs", "tilesets/cesiumjs_specs_data", "tilesets/cesium_native_testdata",
                           "tilesets/tools_specs", "tilesets/cesium_3d_tiles_samples"}) {
    TILEFLIGHT_REQUIRE_TEST_DATA(folder, name);
    const std::vector<fs::path> files =
        files_below(folder, {".b3dm", ".glb", ".gltf", ".cmpt", ".i3dm", ".pnts", ".vctr", ".geom"});
    ASSERT_GE(files.size(), 100U) << name;
    for (const fs::path& file : files) {
      const std::vector<std::byte> bytes = base::read_bytes(file);
      tile_content::ContentOptions options;
      options.read_resource = [&](const std::string& uri) { return base::read_bytes(file.parent_path() / uri); };
      options.textures = false;
      const std::string message =
          base::test_support::error_of([&] { tile_content::decode_content(bytes, "tile", options); });
      EXPECT_THAT(message, Not(HasSubstr("\n"))) << file;
    }
  }
}

TEST(ForeignFiles, ARealTileCutShortOrDamaged) {
  TILEFLIGHT_REQUIRE_TEST_DATA(file, "tilesets/machangara_photogrammetry/4/02502.b3dm");
  const std::vector<std::byte> whole = base::read_bytes(file);
  EXPECT_EQ(base::test_support::error_of([&] { tile_content::decode_content(whole, "tile"); }), "");
  for (std::size_t length = 0; length < whole.size(); length += 1 + length / 64) {
    EXPECT_NE(
        base::test_support::error_of([&] { tile_content::decode_content(std::span(whole).first(length), "tile"); }), "")
        << length;
  }
  std::mt19937 random(1);
  for (int i = 0; i < 100; ++i) {
    std::vector<std::byte> damaged = whole;
    for (int k = 0; k < 3; ++k) damaged[random() % damaged.size()] = static_cast<std::byte>(random());
    EXPECT_THAT(base::test_support::error_of([&] { tile_content::decode_content(damaged, "tile"); }),
                Not(HasSubstr("\n")));
  }
}

/// Buildings of Cesium's own test tilesets stand near longitude -75.61, latitude 40.04 (degrees).
TEST(ForeignFiles, CesiumBatchedTilesetsStandWhereTheyShould) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/cesiumjs_specs_data/Batched");
  int read = 0;
  for (const char* name :
       {"BatchedWithBatchTable", "BatchedWithTransformBox", "BatchedWithTransformSphere", "BatchedWithTransformRegion",
        "BatchedWithRtcCenter", "BatchedTextured", "BatchedColors", "BatchedWithVertexColors", "BatchedDeprecated1",
        "BatchedDeprecated2", "BatchedWithContentDataUri", "BatchedWGS84"}) {
    SCOPED_TRACE(name);
    const LoadedTiles tiles = load(folder / name / "tileset.json");
    ++read;
    EXPECT_GT(tiles.triangles, 0);
    ASSERT_TRUE(tiles.local_frame.has_value());
    EXPECT_NEAR(tiles.local_frame->origin().longitude_deg, -75.612, 0.01);
    EXPECT_NEAR(tiles.local_frame->origin().latitude_deg, 40.0425, 0.01);
    geometry::Box3 box;
    for (const imaging::TexturedMesh& mesh : tiles.meshes) box.extend(geometry::bounds(mesh.mesh));
    // Ten buildings inside the bounding volume that the tile gives (which is loose by the size of a building).
    EXPECT_LT(tiles.region.box().exteriorDistance(box.center()), 1.0);
    EXPECT_LT(box.sizes().maxCoeff(), 300.0);
    EXPECT_LT(box.sizes().z(), 60.0);  // upright: the footprint is wider than the buildings are high
  }
  EXPECT_EQ(read, 12);
}

TEST(ForeignFiles, CesiumTilesetTrees) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/cesiumjs_specs_data/Tilesets");
  EXPECT_EQ(load(folder / "Tileset" / "tileset.json").tiles_loaded, 5);  // ADD: the parent and its four children
  LoadOptions coarse;
  coarse.error_m = 70;
  EXPECT_EQ(load(folder / "Tileset" / "tileset.json", coarse).tiles_loaded, 1);
  EXPECT_EQ(load(folder / "TilesetOfTilesets" / "tileset.json").tiles_loaded, 5);
}

/// The same site in two ways: a tile's own transform must not affect what does not belong to it.
TEST(ForeignFiles, ExternalTilesetsWithTransforms) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/tools_specs/combineTilesets/externalsWithTransform");
  const LoadedTiles tiles = load(folder / "tileset.json");
  EXPECT_EQ(tiles.tiles_loaded, 3);
  ASSERT_FALSE(tiles.meshes.empty());
  for (const imaging::TexturedMesh& mesh : tiles.meshes) {
    EXPECT_LT(tiles.region.box().exteriorDistance(geometry::bounds(mesh.mesh).center()), 1e-3) << mesh.name;
  }
}

/// One model exported in four conventions and converted to glTF 2.0; some with CESIUM_RTC.
TEST(ForeignFiles, ModelsOfAnyUpAxisStandUpright) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/tools_specs/upgradeTileset/upAxisHandling/golden");
  for (const char* name : {"glTF1-x-up-with-gltfUpAxis-x", "glTF1-y-up", "glTF1-y-up-with-gltfUpAxis-y",
                           "glTF1-z-up-with-gltfUpAxis-z", "glTF2"}) {
    const LoadedTiles tiles = load(folder / name);
    ASSERT_FALSE(tiles.meshes.empty()) << name;
    geometry::Box3 box;
    for (const imaging::TexturedMesh& mesh : tiles.meshes) box.extend(geometry::bounds(mesh.mesh));
    EXPECT_LT((box.min() - Vec3(0, -1, 0)).norm(), 1e-3) << name;
    EXPECT_LT((box.max() - Vec3(2, 2, 4)).norm(), 1e-3) << name;
  }
}

TEST(ForeignFiles, ModelsOfGltf1AreRefused) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/tools_specs/upgradeTileset/upAxisHandling/input");
  for (const char* name : {"glTF1-x-up", "glTF1-y-up-with-gltfUpAxis-y", "glTF1-z-up-instanced"}) {
    EXPECT_THAT(base::test_support::error_of([&] { load(folder / name); }), HasSubstr("upgrade the tileset")) << name;
  }
}

tile_content::DecodedContent decoded(const fs::path& file) {
  return tile_content::decode_content(base::read_bytes(file), file.filename(), {.textures = false});
}

/// A hexagon of radius 1, drawn in each of the seven modes.
TEST(ForeignFiles, AHexagonInEveryPrimitiveMode) {
  TILEFLIGHT_REQUIRE_TEST_DATA(
      file, "tilesets/cesium_native_testdata/CesiumGltfReader/test/data/MeshPrimitiveModes/MeshPrimitiveModes.gltf");
  const tile_content::DecodedContent content = decoded(file);
  ASSERT_EQ(content.meshes.size(), 3U);
  for (const imaging::TexturedMesh& mesh : content.meshes) {
    EXPECT_NEAR(geometry::surface_area_m2(mesh.mesh), 1.5 * std::sqrt(3.0), 1e-3);
  }
  ASSERT_EQ(content.clouds.size(), 1U);
  EXPECT_EQ(content.clouds[0].size(), 7U);
  EXPECT_THAT(content.warnings, ::testing::ElementsAre(HasSubstr("lines have no surface")));
}

/// One model, plain and packed with positions of 9, 12 and 15 bits.
TEST(ForeignFiles, ADuckPlainAndMeshopt) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/cesium_native_testdata/CesiumGltfReader/test/data/DucksMeshopt");
  const auto duck = [&](const char* name) {
    const tile_content::DecodedContent content = decoded(folder / name);
    EXPECT_EQ(content.meshes.size(), 1U) << name;
    return content.meshes.at(0).mesh;
  };
  const geometry::TriangleMesh plain = duck("Duck.glb");
  const geometry::Box3 bounds = geometry::bounds(plain);
  for (const auto& [name, bits] : {std::pair{"Duck-vp-9-vt-9-vn-9.glb", 9},
                                   {"Duck-vp-12-vt-12-vn-12.glb", 12},
                                   {"Duck-vp-15-vt-15-vn-15.glb", 15}}) {
    const geometry::TriangleMesh packed = duck(name);
    const double step = bounds.sizes().maxCoeff() / std::exp2(bits);
    EXPECT_LT((geometry::bounds(packed).min() - bounds.min()).cwiseAbs().maxCoeff(), step) << name;
    EXPECT_LT((geometry::bounds(packed).max() - bounds.max()).cwiseAbs().maxCoeff(), step) << name;
    const double area_m2 = geometry::surface_area_m2(plain);
    EXPECT_NEAR(geometry::surface_area_m2(packed), area_m2, 0.03 * area_m2) << name;
  }
}

/// Boxes that hold cubes of exactly the size that the file's name says.
TEST(ForeignFiles, ContentsFillTheirBoundingBoxes) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/cesium_3d_tiles_samples/1.1/BoundingBoxTests");
  int tilesets = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (!entry.is_directory()) continue;
    ++tilesets;
    const LoadedTiles tiles = load(entry.path() / "tileset.json");
    ASSERT_FALSE(tiles.meshes.empty()) << entry.path();
    geometry::Box3 box;
    for (const imaging::TexturedMesh& mesh : tiles.meshes) box.extend(geometry::bounds(mesh.mesh));
    EXPECT_LT((box.min() - tiles.region.box().min()).norm(), 1e-3) << entry.path();
    EXPECT_LT((box.max() - tiles.region.box().max()).norm(), 1e-3) << entry.path();
  }
  EXPECT_EQ(tilesets, 6);
}

TEST(ForeignFiles, ALeafThatIsMissingIsNamed) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/cesium_3d_tiles_samples/1.0/TilesetWithDiscreteLOD");
  EXPECT_THAT(base::test_support::error_of([&] { load(folder); }), HasSubstr("dragon_high.b3dm: is missing"));
  LoadOptions options;
  options.allow_incomplete = true;
  EXPECT_EQ(load(folder, options).tiles_failed, 1);
  options = {};
  options.error_m = 1;  // the middle one is there
  EXPECT_TRUE(load(folder, options).complete);
}

TEST(ForeignFiles, AnArchiveThatHoldsNothing) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/tools_specs/packages");
  EXPECT_THAT(base::test_support::error_of([&] { load(folder / "valid.3tz"); }),
              HasSubstr("is empty: none of its tiles has content"));
}

TEST(ForeignFiles, TexturesInKtx2) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/matterport_cedarcreek_ktx2/mesh_tiles");
  const LoadedTiles tiles = load(folder / "3.json");
  EXPECT_TRUE(tiles.complete);
  EXPECT_EQ(tiles.tiles_loaded, 12);
  EXPECT_GT(tiles.triangles, 10000);
  ASSERT_FALSE(tiles.meshes.empty());
  for (const imaging::TexturedMesh& mesh : tiles.meshes) EXPECT_NE(mesh.texture, nullptr);
}

/// Every subtree of the validator, as that of a quadtree of three levels with one content.
TEST(ForeignFiles, EverySubtreeOfTheValidatorIsReadOrNamed) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "invalid/validator_specs/subtrees");
  auto tiling = std::make_shared<ImplicitTiling>();
  tiling->subtree_levels = 3;
  tiling->available_levels = 6;
  tiling->content_templates = {"content"};
  tiling->root_volume = OrientedBox{Vec3::Zero(), geometry::Mat3::Identity()};
  const auto message_of = [&](const char* name) {
    return base::test_support::error_of([&] {
      parse_subtree(base::read_bytes(folder / name), {tiling, {}}, name,
                    [&](const std::string& uri) { return base::read_bytes(folder / uri); });
    });
  };
  const std::vector<fs::path> files = files_below(folder, {".json", ".subtree"});
  ASSERT_GE(files.size(), 25U);
  for (const fs::path& file : files) {
    EXPECT_THAT(message_of(file.filename().c_str()), Not(HasSubstr("\n"))) << file;
  }
  const std::pair<const char*, const char*> cases[] = {
      {"binarySubtreeComputedLengthInvalid.subtree", "truncated"},
      {"binarySubtreeInvalidMagic.subtree", "not valid JSON"},
      {"binarySubtreeInvalidVersion.subtree", "version"},
      {"binarySubtreeJsonInvalid.subtree", "not valid JSON"},
      {"subtreeChildSubtreeAvailabilityInvalidType.json", "childSubtreeAvailability is"},
      {"subtreeTileAvailabilityBitstreamAndConstant.json", "both bitstream and constant"},
      {"subtreeTileAvailabilityMissing.json", "tileAvailability is missing"},
      {"subtreeTileAvailabilityNeitherBitstreamNorConstant.json", "no bitstream and no constant"}};
  for (const auto& [file, wanted] : cases) EXPECT_THAT(message_of(file), HasSubstr(wanted)) << file;
  EXPECT_EQ(message_of("binarySubtreeValid.subtree"), "");
}

/// Composites inside each other, and one of instances.
TEST(ForeignFiles, RealComposites) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/cesiumjs_specs_data/Composite");
  const LoadedTiles plain = load(folder / "Composite" / "tileset.json");
  const LoadedTiles nested = load(folder / "CompositeOfComposite" / "tileset.json");
  EXPECT_GT(plain.triangles, 0);
  EXPECT_EQ(nested.triangles, plain.triangles);
  EXPECT_GT(load(folder / "CompositeOfInstanced" / "tileset.json").meshes.size(), 25U);
}

TEST(ForeignFiles, SeveralContentsOfOneTile) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/cesium_3d_tiles_samples/1.1/MultipleContents");
  const LoadedTiles tiles = load(folder / "tileset.json");
  EXPECT_EQ(tiles.tiles_loaded, tiles.tiles_wanted);
  EXPECT_GT(tiles.tiles_loaded, 1);
}

/// A point cloud seen from close up by a viewer, beside buildings.
TEST(ForeignFiles, PointsAndBuildingsBesideEachOther) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/cesium_3d_tiles_samples/1.0/TilesetWithRequestVolume");
  const LoadedTiles tiles = load(folder / "tileset.json");
  EXPECT_TRUE(tiles.complete);
  EXPECT_GT(tiles.points, 0);
  EXPECT_GT(tiles.triangles, 0);
}

}  // namespace
}  // namespace tileflight::tileset::foreign_files_test
