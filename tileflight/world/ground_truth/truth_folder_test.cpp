#include "tileflight/world/ground_truth/truth_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/geometry/voxel_grid.h"
#include "tileflight/world/ground_truth/ground_truth.h"

namespace tileflight::ground_truth::truth_folder_test {
namespace {

namespace fs = std::filesystem;
using geometry::Box3;
using geometry::TriangleMesh;
using geometry::Vec3;

const Vec3 kCorner(412.3, -871.9, 2900.4);

/// Matches a call that is refused with a line that holds the text.
MATCHER_P(refuses, text, "") {
  const std::string line = tests::refusal_of(arg);
  *result_listener << line;
  return line.find(text) != std::string::npos;
}

/// n x n squares of 1 m, in rows of alternating direction, so that triangles of a block do not follow each other.
imaging::TexturedMesh ground(int n, double up) {
  imaging::TexturedMesh m;
  for (int j = 0; j <= n; ++j) {
    for (int i = 0; i <= n; ++i)
      m.mesh.vertices.push_back(kCorner + Vec3(i, j, up + 0.7 * std::sin(0.9 * i) * std::cos(0.7 * j)));
  }
  const auto at = [n](int i, int j) { return static_cast<std::uint32_t>(j * (n + 1) + i); };
  for (int j = 0; j < n; ++j) {
    for (int k = 0; k < n; ++k) {
      const int i = j % 2 == 0 ? k : n - 1 - k;
      m.mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      m.mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  return m;
}

/// Corners of all triangles in their order.
std::vector<Vec3> corners(const TriangleMesh& mesh) {
  std::vector<Vec3> all;
  for (const geometry::Triangle& t : mesh.triangles) {
    for (const std::uint32_t corner : t) all.push_back(mesh.vertices[corner]);
  }
  return all;
}

/// A region that is written in one piece and in columns of so many cells.
struct Written {
  tests::TemporaryFolder whole, blocks;

  explicit Written(std::int32_t edge) {
    // Two contents, of which the second holds two meshes; a triangle that is larger than any block.
    std::vector<imaging::TexturedMesh> meshes{ground(20, 2.0), ground(12, 4.0), ground(7, 6.0)};
    const auto n = static_cast<std::uint32_t>(meshes[1].mesh.vertices.size());
    for (const Vec3& corner : {Vec3(-9, -4, 1), Vec3(35, 3, 5), Vec3(6, 33, 6)})
      meshes[1].mesh.vertices.push_back(kCorner + corner);
    meshes[1].mesh.triangles.insert(meshes[1].mesh.triangles.begin() + 9, {n, n + 1, n + 2});
    const auto second = static_cast<std::uint32_t>(meshes[1].mesh.triangles.size());
    const Box3 box(kCorner + Vec3(0.3, 0.2, 0), kCorner + Vec3(19.6, 19.9, 8));
    GroundTruthOptions options{.samples_per_m2 = 4.0};
    const auto dims = write_ground_truth(meshes, box, options, whole.path()).voxels.dims;
    nlohmann::json index = nlohmann::json::array();
    for (std::int32_t x = dims[0] - 1; x >= 0; x -= edge) {
      for (std::int32_t y = 0; y < dims[1]; y += edge) {
        const std::int32_t low_x = std::max(0, x - edge + 1), high_y = std::min(y + edge, dims[1]) - 1;
        const CellRange cells{{low_x, y, 0}, {x, high_y, dims[2] - 1}};
        const std::string name = std::to_string(x) + "_" + std::to_string(y);
        fs::create_directories(blocks.path() / name);
        options.block = {cells, 40, {{0, 0, {}}, {1, 0, {}}, {1, second, {}}}};
        write_ground_truth(meshes, box, options, blocks.path() / name);
        if (fs::is_empty(blocks.path() / name)) continue;
        const Vec3 low = box.min() + Vec3(low_x, y, 0), high = box.min() + Vec3(x + 1, high_y + 1, dims[2]);
        index.push_back(
            {{"folder", name}, {"min", {low.x(), low.y(), low.z()}}, {"max", {high.x(), high.y(), high.z()}}});
      }
    }
    base::write_file(blocks.path() / "index.json", nlohmann::json{{"blocks", index}}.dump());
  }
};

class TruthFolderTest : public ::testing::TestWithParam<std::int32_t> {};

TEST_P(TruthFolderTest, PartsHaveTheOrderOfTheWhole) {
  const Written written(GetParam());
  const TruthFolder whole(written.whole.path()), blocks(written.blocks.path());
  ASSERT_EQ(whole.size(), 1U);
  const TriangleMesh mesh = whole.read_meshes(whole.all_parts());
  EXPECT_EQ(corners(blocks.read_meshes(blocks.all_parts())), corners(mesh));
  std::vector<std::size_t> backwards = blocks.all_parts();
  std::ranges::reverse(backwards);
  EXPECT_EQ(corners(blocks.read_meshes(backwards)), corners(mesh));
  EXPECT_EQ(blocks.read_voxel_centers(backwards).positions, whole.read_voxel_centers(whole.all_parts()).positions);
  EXPECT_EQ(blocks.read_surface_samples().positions, whole.read_surface_samples().positions);
  EXPECT_EQ(blocks.voxel_m(), whole.voxel_m());
}

TEST_P(TruthFolderTest, BoundsOfPartsAreThoseOfTheirMeshes) {
  const Written written(GetParam());
  const TruthFolder blocks(written.blocks.path());
  if (blocks.size() == 1) return;
  Box3 all;
  for (const std::size_t part : blocks.all_parts()) {
    for (const Vec3& center : blocks.read_voxel_centers(part).positions)
      EXPECT_TRUE(blocks.voxel_bounds(part).contains(center));
    if (!blocks.has_mesh(part)) {
      EXPECT_TRUE(blocks.mesh_bounds(part).isEmpty());
      continue;
    }
    const Box3 box = geometry::bounds(blocks.read_mesh(part).mesh);
    EXPECT_EQ(blocks.mesh_bounds(part).min(), box.min());
    EXPECT_EQ(blocks.mesh_bounds(part).max(), box.max());
    all.extend(box);
  }
  const Box3 of_whole = geometry::bounds(read_ground_truth(written.whole.path()).mesh);
  EXPECT_EQ(all.min(), of_whole.min());
  EXPECT_EQ(all.max(), of_whole.max());
  for (const std::size_t part : blocks.all_parts()) {
    const auto found = blocks.parts_in(blocks.voxel_bounds(part));
    EXPECT_TRUE(std::ranges::count(found, part) == 1);
  }
}

INSTANTIATE_TEST_SUITE_P(OfAnySize, TruthFolderTest, ::testing::Values(3, 7, 30));

TEST(TruthFolder, OfAnEarlierVersionIsReadInTheOrderOfItsFiles) {
  const tests::TemporaryFolder folder;
  const std::vector<imaging::TexturedMesh> meshes{ground(4, 1.0), ground(3, 2.0)};
  write_mesh_glb(folder.path() / "mesh.glb", meshes, false);
  const NumberedMesh mesh = read_numbered_mesh_glb(folder.path() / "mesh.glb");
  ASSERT_EQ(mesh.numbers.size(), 2U * 16 + 2U * 9);
  for (std::size_t i = 0; i < mesh.numbers.size(); ++i) EXPECT_EQ(mesh.numbers[i], i);
}

TEST(TruthFolder, BrokenFilesAreOneLine) {
  const tests::TemporaryFolder folder;
  const auto with_index = [&](const std::string& text) {
    base::write_file(folder.path() / "index.json", text);
    return [&] { TruthFolder(folder.path()); };
  };
  EXPECT_THAT(with_index("[]"), refuses("names no blocks"));
  EXPECT_THAT(with_index(R"({"blocks": {"a": 1}})"), refuses("names no blocks"));
  EXPECT_THAT(with_index(R"({"blocks": [{"folder": 3}]})"), refuses("block 0 has no valid folder"));
  EXPECT_THAT(with_index(R"({"blocks": [{"folder": "a", "min": [0, 0], "max": [1, 1, 1]}]})"),
              refuses("block 0 has no valid folder"));
  for (const std::string& bytes :
       {std::string("glTF"), std::string(40, 'x'), std::string(R"(glTF)") + std::string(16, '\xff')}) {
    base::write_file(folder.path() / "mesh.glb", bytes);
    EXPECT_THAT([&] { read_mesh_glb_bounds(folder.path() / "mesh.glb"); }, refuses("mesh.glb"));
  }
  // A file of another program has no bounds, or other nodes.
  std::string json = R"({"nodes": [{"children": [1]}, {"mesh": 7}], "meshes": [], "accessors": []} )";
  while (json.size() % 4 != 0) json += ' ';
  const auto word = [](std::size_t n) {
    const auto number = static_cast<std::uint32_t>(n);
    return std::string(reinterpret_cast<const char*>(&number), 4);
  };
  base::write_file(folder.path() / "mesh.glb",
                   "glTF" + word(2) + word(20 + json.size()) + word(json.size()) + "JSON" + json);
  EXPECT_THAT([&] { read_mesh_glb_bounds(folder.path() / "mesh.glb"); },
              refuses("was not written by `tileflight extract`"));
}

}  // namespace
}  // namespace tileflight::ground_truth::truth_folder_test
