// The voxel grid of a real place, whose exact numbers of occupied cells are known from independent code.
#include <gtest/gtest.h>

#include "tests/test_data.h"
#include "tileflight/tiles/tileset/load.h"
#include "tileflight/world/ground_truth/voxelize.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::voxel_counts_test {
namespace {

using geometry::Vec3;

/// All finest triangles about the middle 250 m x 250 m x 48 m of the survey.
geometry::TriangleMesh middle_of_machangara(const std::filesystem::path& tileset) {
  tileset::LoadOptions options;
  options.center_local = Vec3(347.8, -131.4, 2893.0);
  options.size = Vec3(250.0, 250.0, 48.0);
  options.textures = false;
  return scene::merge_meshes(tileset::load_region(tileset.string(), options).meshes);
}

TEST(VoxelCounts, MachangaraMatchesTheKnownCounts) {
  TILEFLIGHT_REQUIRE_TEST_DATA(tileset, "tilesets/machangara_photogrammetry");
  const geometry::TriangleMesh mesh = middle_of_machangara(tileset);
  const geometry::Box3 box(Vec3(222.8, -256.4, 2869.0), Vec3(472.8, -6.4, 2917.0));
  struct Known {
    double edge_m;
    double cells;
  };
  // 25 parts in a million: open or closed faces, float or double positions.
  for (const auto& [edge_m, cells] : {Known{1.0, 105'411}, {0.5, 426'594}, {0.25, 1'717'374}, {0.1, 10'765'777}}) {
    const auto counted = static_cast<double>(ground_truth::voxelize(mesh, box, edge_m).occupied.size());
    EXPECT_NEAR(counted, cells, 25e-6 * cells) << edge_m;
  }
}

}  // namespace
}  // namespace tileflight::voxel_counts_test
