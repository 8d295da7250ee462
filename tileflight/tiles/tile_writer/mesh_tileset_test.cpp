#include "tileflight/tiles/tile_writer/mesh_tileset.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/srgb.h"
#include "tileflight/core/geometry/triangle_index.h"
#include "tileflight/tiles/simplification/simplify.h"
#include "tileflight/tiles/tile_writer/test_hills.h"

namespace tileflight::tile_writer::mesh_tileset_test {
namespace {

using geometry::Triangle;
using geometry::Vec3;
using imaging::RgbImage;
using namespace test_hills;
using imaging::TexturedMesh;
using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

MeshTilesetOptions small_tiles() {
  MeshTilesetOptions options;
  options.tile_triangles = 350;
  options.jpeg_quality = 95;
  options.copyright = "a test, CC0";
  return options;
}

class MeshTileset : public ::testing::Test {
 protected:
  void SetUp() override { summary_ = write_mesh_tileset(folder_ / "place", source_, small_tiles()); }

  tests::TemporaryFolder folder_;
  std::vector<TexturedMesh> source_ = make_place();
  MeshTilesetSummary summary_;
};

TEST_F(MeshTileset, LeavesHoldEachTriangleOnce) {
  const tileset::LoadedTiles loaded = load(folder_ / "place", 0.0);
  EXPECT_TRUE(loaded.complete);
  EXPECT_EQ(loaded.geometric_error_max_m, 0.0);
  EXPECT_EQ(loaded.tiles_loaded, 16);
  EXPECT_EQ(loaded.attribution.front(), "a test, CC0");
  EXPECT_EQ(places_of(simplification::merge_meshes(loaded.meshes)), places_of(simplification::merge_meshes(source_)));
  ASSERT_FALSE(loaded.meshes.empty());
  for (const TexturedMesh& mesh : loaded.meshes) EXPECT_LE(mesh.mesh.triangles.size(), 350U);
}

TEST_F(MeshTileset, LeavesLookLikeTheSource) {
  EXPECT_EQ(summary_.texture_scale, 1.0);
  const ColorDifference difference = color_difference(load(folder_ / "place", 0.0).meshes);
  EXPECT_LT(difference.mean, 1.2);
  EXPECT_LT(difference.largest, 8);
}

TEST_F(MeshTileset, EachLevelIsWithinItsErrorAndLooksLikeTheSource) {
  ASSERT_EQ(summary_.levels.size(), 3U);
  const geometry::TriangleMesh source = simplification::merge_meshes(source_);
  double finer_m = 0.0;
  std::int64_t finer_triangles = summary_.levels.back().triangles;
  for (std::size_t i = 2; i-- > 0;) {
    const TilesetLevel& level = summary_.levels[i];
    const tileset::LoadedTiles loaded = load(folder_ / "place", level.geometric_error_m);
    const geometry::TriangleMesh surface = simplification::merge_meshes(loaded.meshes);
    EXPECT_EQ(loaded.triangles, level.triangles);
    EXPECT_EQ(loaded.tiles_loaded, level.tiles);
    EXPECT_LE(sampled_distance_m(surface, source), level.geometric_error_m);
    EXPECT_LE(sampled_distance_m(source, surface), level.geometric_error_m);
    EXPECT_GE(level.geometric_error_m, finer_m);
    EXPECT_LT(level.geometric_error_m, 4.0);
    EXPECT_LT(level.triangles, 0.3 * static_cast<double>(finer_triangles));
    const ColorDifference difference = color_difference(loaded.meshes);
    EXPECT_LT(difference.mean, 4) << i;
    EXPECT_LT(difference.largest, 45) << i << ": what no triangle of the source uses must not show";
    finer_m = level.geometric_error_m;
    finer_triangles = level.triangles;
  }
}

TEST_F(MeshTileset, NoLevelHasCracksBetweenItsTiles) {
  ASSERT_EQ(summary_.levels.size(), 3U);
  for (const TilesetLevel& level : summary_.levels) {
    const double outline_m = kEdge_m * kSheets / 2 - level.geometric_error_m - 1e-6;
    const auto uses = edge_uses(simplification::merge_meshes(load(folder_ / "place", level.geometric_error_m).meshes));
    ASSERT_FALSE(uses.empty());
    for (const auto& [edge, count] : uses) {
      EXPECT_LE(count, 2);
      if (count == 2) continue;  // otherwise it must lie on the outline of the site
      EXPECT_TRUE(std::max(std::fabs(edge[0]), std::fabs(edge[1])) >= outline_m) << edge[0] << " " << edge[1];
      EXPECT_TRUE(std::max(std::fabs(edge[3]), std::fabs(edge[4])) >= outline_m) << edge[3] << " " << edge[4];
    }
  }
}

void check_tile(const json& tile, const json* parent) {
  const auto check_inside = [](const json& inner, const json& outer) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double gap = std::fabs(inner[axis].get<double>() - outer[axis].get<double>());
      EXPECT_LE(gap + inner[3 + 4 * axis].get<double>(), outer[3 + 4 * axis].get<double>() + 1e-9);
    }
  };
  check_inside(tile["content"]["boundingVolume"]["box"], tile["boundingVolume"]["box"]);
  if (parent != nullptr) {
    EXPECT_LE(tile["geometricError"].get<double>(), (*parent)["geometricError"].get<double>());
    check_inside(tile["boundingVolume"]["box"], (*parent)["boundingVolume"]["box"]);
  }
  EXPECT_EQ(tile["geometricError"] == 0.0, !tile.contains("children"));
  for (const json& child : tile.value("children", json::array())) check_tile(child, &tile);
}

TEST_F(MeshTileset, TheTreeIsValid) {
  const json tileset = json::parse(base::read_text(folder_ / "place" / "tileset.json"));
  EXPECT_EQ(tileset["root"]["refine"], "REPLACE");
  EXPECT_GE(tileset["geometricError"].get<double>(), tileset["root"]["geometricError"].get<double>());
  check_tile(tileset["root"], nullptr);
}

TEST_F(MeshTileset, BytesDoNotDependOnTheNumberOfThreads) {
  constexpr int kThreads = 8;  // more than there may be cores
  const tbb::global_control allowed(tbb::global_control::max_allowed_parallelism, kThreads);
  tbb::task_arena(1).execute([&] { write_mesh_tileset(folder_ / "serial", source_, small_tiles()); });
  tbb::task_arena(kThreads).execute([&] { write_mesh_tileset(folder_ / "parallel", source_, small_tiles()); });
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_ / "serial")) {
    if (!entry.is_regular_file()) continue;
    const std::filesystem::path name = std::filesystem::relative(entry.path(), folder_ / "serial");
    const std::string hash = base::sha256_hex_of_file(entry.path());
    EXPECT_EQ(base::sha256_hex_of_file(folder_ / "parallel" / name), hash) << name;
    EXPECT_EQ(base::sha256_hex_of_file(folder_ / "place" / name), hash) << name;
    ++files;
  }
  EXPECT_EQ(files, 1U + 1 + 4 + 16);
}

TEST_F(MeshTileset, TexturesShrinkToTheSizeAllowed) {
  MeshTilesetOptions options = small_tiles();
  options.max_atlas_px = 96;
  options.levels = 3;
  const MeshTilesetSummary summary = write_mesh_tileset(folder_ / "small", source_, options);
  EXPECT_LT(summary.texture_scale, 0.9);
  const tileset::LoadedTiles loaded = load(folder_ / "small", 0.0);
  int textured = 0;
  for (const TexturedMesh& mesh : loaded.meshes) {
    if (!mesh.texture) continue;
    ++textured;
    EXPECT_LE(mesh.texture->width, 96);
    EXPECT_LE(mesh.texture->height, 96);
  }
  EXPECT_GT(textured, 0);
  EXPECT_LT(color_difference(loaded.meshes).mean, 2.5);
}

TEST(MeshTilesetWriter, AFewTrianglesAreOneTile) {
  const tests::TemporaryFolder folder;
  TexturedMesh mesh;
  mesh.mesh.vertices = {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}};
  mesh.mesh.triangles = {{0, 1, 2}};
  mesh.base_color = {0.5F, 0.25F, 1.0F, 1.0F};
  const MeshTilesetSummary summary = write_mesh_tileset(folder / "x", {mesh}, {});
  ASSERT_EQ(summary.levels.size(), 1U);
  EXPECT_EQ(summary.levels[0].geometric_error_m, 0.0);
  const tileset::LoadedTiles loaded = load(folder / "x", 0.0);
  EXPECT_EQ(loaded.triangles, 1);
  EXPECT_EQ(loaded.meshes[0].base_color, mesh.base_color);
  // More levels than triangles: cells stay empty, nothing is lost.
  MeshTilesetOptions deep;
  deep.levels = 4;
  write_mesh_tileset(folder / "deep", {mesh}, deep);
  EXPECT_EQ(load(folder / "deep", 0.0).triangles, 1);
  EXPECT_EQ(load(folder / "deep", 100.0).triangles, 1);
}

TEST(MeshTilesetWriter, WildTextureCoordinatesAreHeld) {
  const tests::TemporaryFolder folder;
  TexturedMesh mesh;
  mesh.mesh.vertices = {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {4, 4, 1}};
  mesh.mesh.triangles = {{0, 1, 2}, {1, 3, 2}};
  mesh.uv = {{0, 0}, {1e30F, 0}, {0, -1e30F}, {50, 50}};
  mesh.texture = std::make_shared<RgbImage>(4, 4, imaging::Rgb8{10, 200, 90});
  MeshTilesetOptions options;
  options.max_atlas_px = 256;
  options.levels = 2;
  EXPECT_LT(write_mesh_tileset(folder / "x", {mesh}, options).texture_scale, 1.0);
  const std::vector<TexturedMesh> meshes = load(folder / "x", 0.0).meshes;
  ASSERT_FALSE(meshes.empty());
  for (const TexturedMesh& m : meshes) {
    ASSERT_NE(m.texture, nullptr);
    EXPECT_NEAR((*m.texture)(0, 0)[1], 200, 2);
  }
}

TEST(MeshTilesetWriter, RefusesAnEmptyPlace) {
  const tests::TemporaryFolder folder;
  EXPECT_THAT([&] { write_mesh_tileset(folder / "x", {}, {}); },
              ThrowsMessage<InputError>(HasSubstr("there is no triangle to write")));
  EXPECT_THAT([&] { write_mesh_tileset(folder / "x", {TexturedMesh{}}, {}); },
              ThrowsMessage<InputError>(HasSubstr("there is no triangle to write")));
}

}  // namespace
}  // namespace tileflight::tile_writer::mesh_tileset_test
