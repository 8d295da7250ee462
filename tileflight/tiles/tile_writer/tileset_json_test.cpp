#include "tileflight/tiles/tile_writer/tileset_json.h"

#include <gtest/gtest.h>

#include <set>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/tiles/tile_writer/mesh_tileset.h"
#include "tileflight/tiles/tile_writer/test_hills.h"
#include "tileflight/tiles/tileset/inspect.h"

namespace tileflight::tile_writer::subtree_files_test {
namespace {

using namespace test_hills;

TEST(ImplicitTileset, CoordinatesAreThoseOfTheMortonIndex) {
  std::set<std::pair<std::uint32_t, std::uint32_t>> seen;
  for (std::size_t cell = 0; cell < 256; ++cell) {
    const auto [x, y] = implicit_coordinates(cell);
    EXPECT_TRUE(x < 16 && y < 16 && seen.insert({x, y}).second);
    for (std::size_t child = 0; child < 4; ++child)  // 3D Tiles 1.1: bit 0 of a child's index is x, bit 1 is y
      EXPECT_EQ(implicit_coordinates(4 * cell + child),
                (std::pair<std::uint32_t, std::uint32_t>(2 * x + child % 2, 2 * y + child / 2)));
  }
}

/// Both trees hold the same tiles with the same boxes and errors: every selection is the same. Six levels are more
/// than a subtree has, so there are subtrees below subtrees.
TEST(ImplicitTileset, HoldsWhatTheExplicitOneHolds) {
  const tests::TemporaryFolder folder;
  MeshTilesetOptions options;
  options.levels = 6;
  options.tile_triangles = 100;
  const std::vector<TexturedMesh> source{make_place()[2]};
  write_mesh_tileset(folder / "explicit", source, options);
  options.implicit = true;
  const MeshTilesetSummary summary = write_mesh_tileset(folder / "implicit", source, options);
  EXPECT_FALSE(base::read_text(folder / "implicit/tileset.json").find("children") < std::string::npos);
  std::vector<double> errors{0.0};
  for (const TilesetLevel& level : summary.levels) errors.push_back(level.geometric_error_m);
  for (const double error_m : errors) {
    const tileset::LoadedTiles a = load(folder / "explicit", error_m), b = load(folder / "implicit", error_m);
    EXPECT_TRUE(b.complete);
    EXPECT_EQ(a.tiles_loaded, b.tiles_loaded);
    EXPECT_EQ(a.geometric_error_max_m, b.geometric_error_max_m);
    EXPECT_EQ(places_of(simplification::merge_meshes(a.meshes)), places_of(simplification::merge_meshes(b.meshes)));
  }
}

}  // namespace
}  // namespace tileflight::tile_writer::subtree_files_test
