#include "tileflight/tiles/tile_writer/large_mesh_tileset.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <fstream>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/glb_writer.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/tiles/mesh_files/mesh_source.h"
#include "tileflight/tiles/tile_writer/test_hills.h"

namespace tileflight::tile_writer::large_mesh_tileset_test {
namespace {

using namespace test_hills;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;
namespace fs = std::filesystem;

/// Puts meshes into a spill as the readers of files do.
void spill_meshes(const std::vector<TexturedMesh>& meshes, mesh_files::MeshSpill& spill) {
  for (const TexturedMesh& mesh : meshes) {
    const auto first = static_cast<std::uint32_t>(spill.vertices.size()),
               first_uv = static_cast<std::uint32_t>(spill.uv.size());
    for (std::size_t i = 0; i < mesh.mesh.vertices.size(); ++i) {
      const Vec3& p = mesh.mesh.vertices[i];
      mesh_files::SpilledVertex vertex{.position = {p.x(), p.y(), p.z()}};
      if (!mesh.colors.empty()) vertex.color = mesh.colors[i];
      spill.vertices.push_back(vertex);
    }
    for (const Eigen::Vector2f& uv : mesh.uv) spill.uv.push_back({uv.x(), uv.y()});
    for (const Triangle& t : mesh.mesh.triangles) {
      mesh_files::SpilledFace face{.material = static_cast<std::uint32_t>(spill.materials.size())};
      for (std::size_t k = 0; k < 3; ++k) {
        face.position[k] = first + t[k];
        face.uv[k] = mesh.uv.empty() ? mesh_files::kInvalidIndex : first_uv + t[k];
      }
      spill.faces.push_back(face);
    }
    spill.materials.push_back({.texture = mesh.texture ? spill.texels.add(*mesh.texture) : nullptr,
                               .wrap_u = mesh.wrap_u,
                               .wrap_v = mesh.wrap_v,
                               .base_color = mesh.base_color,
                               .has_colors = !mesh.colors.empty()});
  }
}

/// 256 leaves in 16 buckets; blocks of several sizes on the way up.
MeshTilesetOptions tiny_tiles() {
  MeshTilesetOptions options;
  options.tile_triangles = 40;
  options.jpeg_quality = 95;
  options.copyright = "a test, CC0";
  return options;
}

LargeMeshLimits tiny_limits() {
  return {.sample_triangles = 2000, .bucket_triangles = 400, .block_bytes = 400'000, .threads = 2};
}

MeshTilesetSummary tile_out_of_core(const fs::path& folder, const std::vector<TexturedMesh>& source,
                                    const LargeMeshLimits& limits) {
  fs::create_directories(folder);
  mesh_files::MeshSpill spill(folder / "work");
  spill_meshes(source, spill);
  return write_large_mesh_tileset(folder, spill, tiny_tiles(), limits);
}

class LargeMesh : public ::testing::Test {
 protected:
  void SetUp() override { summary_ = tile_out_of_core(folder_ / "large", source_, tiny_limits()); }

  tests::TemporaryFolder folder_;
  std::vector<TexturedMesh> source_ = make_place();
  MeshTilesetSummary summary_;
};

TEST_F(LargeMesh, LeavesHoldEachTriangleOnceWithItsTexels) {
  ASSERT_EQ(summary_.levels.size(), 5U);
  const tileset::LoadedTiles loaded = load(folder_ / "large", 0.0);
  EXPECT_TRUE(loaded.complete);
  EXPECT_EQ(loaded.attribution.front(), "a test, CC0");
  EXPECT_EQ(places_of(simplification::merge_meshes(loaded.meshes)), places_of(simplification::merge_meshes(source_)));
  for (const TexturedMesh& mesh : loaded.meshes) EXPECT_LE(mesh.mesh.triangles.size(), 60U);
  EXPECT_EQ(summary_.texture_scale, 1.0);
  // JPEG changes small images more than large ones; the leaves made in memory look the same.
  write_mesh_tileset(folder_ / "whole", source_, tiny_tiles());
  const ColorDifference difference = color_difference(loaded.meshes);
  const ColorDifference whole = color_difference(load(folder_ / "whole", 0.0).meshes);
  EXPECT_LT(difference.mean, 1.2);
  EXPECT_NEAR(difference.mean, whole.mean, 0.1);
  EXPECT_LT(difference.largest, 16) << "texels that no triangle uses differ by far more";
  EXPECT_FALSE(fs::exists(folder_ / "large/work"));
}

TEST_F(LargeMesh, LevelsAreLikeThoseMadeInMemory) {
  const MeshTilesetSummary whole = write_mesh_tileset(folder_ / "whole", source_, tiny_tiles());
  const geometry::TriangleMesh source = simplification::merge_meshes(source_);
  ASSERT_EQ(whole.levels.size(), summary_.levels.size());
  for (std::size_t i = 0; i < whole.levels.size(); ++i) {
    const TilesetLevel &level = summary_.levels[i], &other = whole.levels[i];
    const tileset::LoadedTiles loaded = load(folder_ / "large", level.geometric_error_m);
    const geometry::TriangleMesh surface = simplification::merge_meshes(loaded.meshes);
    EXPECT_EQ(loaded.triangles, level.triangles);
    EXPECT_LE(sampled_distance_m(surface, source), level.geometric_error_m + 1e-6);
    EXPECT_LE(sampled_distance_m(source, surface), level.geometric_error_m + 1e-6);
    // Blocks of 16 tiny tiles consist of border to a good part, which stays.
    EXPECT_LE(level.geometric_error_m, 4 * other.geometric_error_m) << i;
    EXPECT_GE(level.geometric_error_m, 0.7 * other.geometric_error_m) << i;
    EXPECT_LT(static_cast<double>(level.triangles), 4.0 * static_cast<double>(other.triangles)) << i;
    EXPECT_LT(color_difference(loaded.meshes).mean,
              1.5 * color_difference(load(folder_ / "whole", other.geometric_error_m).meshes).mean + 1);
    if (i > 0) {
      EXPECT_LE(level.geometric_error_m, summary_.levels[i - 1].geometric_error_m);
    }
  }
}

/// Edges of one triangle that do not lie on the outline of the site. Where three of them lie on one line, a triangle
/// without area was left out between them: that is no gap.
int cracks(const std::vector<TexturedMesh>& meshes, const TilesetLevel& level) {
  const double outline_m = kEdge_m * kSheets / 2 - level.geometric_error_m - 1e-6;
  const auto is_inside = [&](double x, double y) { return std::max(std::fabs(x), std::fabs(y)) < outline_m; };
  std::vector<std::array<Vec3, 2>> open;
  for (const auto& [edge, uses] : edge_uses(simplification::merge_meshes(meshes)))
    if (uses == 1 && (is_inside(edge[0], edge[1]) || is_inside(edge[3], edge[4])))
      open.push_back({Vec3(edge[0], edge[1], edge[2]), Vec3(edge[3], edge[4], edge[5])});
  int count = 0;
  for (const auto& ends : open) {
    const Vec3 &a = ends[0], &b = ends[1];
    const auto continues = [&](const std::array<Vec3, 2>& other) {
      const bool meets = (other[0] == a || other[0] == b) != (other[1] == a || other[1] == b);
      return meets && (other[1] - other[0]).cross(b - a).norm() < 1e-9;
    };
    count += std::any_of(open.begin(), open.end(), continues) ? 0 : 1;
  }
  return count;
}

int cracks(const fs::path& folder, const TilesetLevel& level) {
  return cracks(load(folder, level.geometric_error_m).meshes, level);
}

TEST_F(LargeMesh, NoLevelHasCracksBetweenTilesOrBlocks) {
  for (const TilesetLevel& level : summary_.levels) EXPECT_EQ(cracks(folder_ / "large", level), 0);
  // The check finds cracks: a tile that is missing leaves some.
  std::vector<TexturedMesh> meshes = load(folder_ / "large", 0.0).meshes;
  meshes.erase(meshes.begin() + static_cast<std::ptrdiff_t>(meshes.size() / 2));
  EXPECT_GT(cracks(meshes, summary_.levels.back()), 0);
}

TEST_F(LargeMesh, BytesDependOnNothingButTheMesh) {
  LargeMeshLimits limits = tiny_limits();
  limits.threads = 1;
  tile_out_of_core(folder_ / "serial", source_, limits);
  std::size_t files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder_ / "serial")) {
    if (!entry.is_regular_file()) continue;
    const fs::path name = fs::relative(entry.path(), folder_ / "serial");
    EXPECT_EQ(base::sha256_hex_of_file(folder_ / "large" / name), base::sha256_hex_of_file(entry.path())) << name;
    ++files;
  }
  EXPECT_GT(files, 300U);
}

TEST_F(LargeMesh, FewerSmallerBlocksFitTogetherToo) {
  LargeMeshLimits limits = tiny_limits();
  for (const std::uint64_t bytes : {std::uint64_t{1}, std::uint64_t{1} << 40}) {
    limits.block_bytes = bytes;
    const fs::path folder = folder_ / std::to_string(bytes);
    const MeshTilesetSummary summary = tile_out_of_core(folder, source_, limits);
    for (const TilesetLevel& level : summary.levels) EXPECT_EQ(cracks(folder, level), 0) << bytes;
  }
}

TEST(LargeMeshes, AFewTrianglesAreOneTileAndNoneAreRefused) {
  const tests::TemporaryFolder folder;
  TexturedMesh mesh;
  mesh.mesh.vertices = {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {0, 8, 0}};
  mesh.mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  mesh.base_color = {0.5F, 0.25F, 1.0F, 1.0F};
  EXPECT_EQ(tile_out_of_core(folder / "x", {mesh}, {}).levels.size(), 1U);
  const tileset::LoadedTiles loaded = load(folder / "x", 0.0);
  EXPECT_EQ(loaded.triangles, 1) << "the other one has no area";
  EXPECT_EQ(loaded.meshes[0].base_color, mesh.base_color);
  mesh.mesh.triangles = {{0, 2, 3}};
  EXPECT_THAT([&] { tile_out_of_core(folder / "y", {mesh}, {}); },
              ThrowsMessage<InputError>(HasSubstr("no triangle with an area")));
  mesh.mesh.triangles = {};
  EXPECT_THAT([&] { tile_out_of_core(folder / "z", {mesh}, {}); }, ThrowsMessage<InputError>(HasSubstr("no triangle")));
  EXPECT_THAT([&] { require_free_space(folder.path(), std::uintmax_t{1} << 60, "a test"); },
              ThrowsMessage<InputError>(HasSubstr("a test needs about 1152921504.6 GB of free disk space")));
}

/// Triangles with their corners, colours and texels at the corners, as far as one can see them.
using Seen = std::array<std::array<double, 8>, 3>;

std::vector<Seen> sorted(std::vector<Seen> triangles) {
  std::sort(triangles.begin(), triangles.end());
  return triangles;
}

std::vector<Seen> seen_in(const std::vector<TexturedMesh>& meshes) {
  std::vector<Seen> out;
  for (const TexturedMesh& m : meshes)
    for (const Triangle& t : m.mesh.triangles) {
      Seen seen{};
      for (std::size_t k = 0; k < 3; ++k) {
        const Vec3& p = m.mesh.vertices[t[k]];
        seen[k] = {p.x(), p.y(), p.z(), 0, 0, double{m.base_color[0]}, 0, m.texture ? m.texture->width : -1.0};
        if (m.texture) seen[k][3] = double{m.uv[t[k]].x()}, seen[k][4] = double{m.uv[t[k]].y()};
        if (!m.colors.empty()) seen[k][6] = m.colors[t[k]][0] + 256.0 * m.colors[t[k]][1];
      }
      out.push_back(seen);
    }
  return sorted(out);
}

std::vector<Seen> seen_in(mesh_files::MeshSpill& spill) {
  std::vector<Seen> out;
  spill.for_each_triangle([&](const mesh_files::SourceTriangle& t) {
    const mesh_files::SurfaceAppearance& look = spill.materials[t.material];
    Seen seen{};
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 p = t.corner(k);
      seen[k] = {p.x(),
                 p.y(),
                 p.z(),
                 double{t.uv[k][0]},
                 double{t.uv[k][1]},
                 double{look.base_color[0]},
                 0,
                 look.texture ? look.texture->width : -1.0};
      if (look.has_colors) seen[k][6] = t.color[k][0] + 256.0 * t.color[k][1];
    }
    out.push_back(seen);
  });
  return sorted(out);
}

class SpilledFiles : public ::testing::Test {
 protected:
  void write(const std::string& name, const std::string& text) const { std::ofstream(folder_ / name) << text; }

  void expect_same(const std::vector<fs::path>& files, const mesh_files::MeshSourceOptions& options = {}) {
    mesh_files::MeshSpill spill(folder_ / "spill");
    mesh_files::spill_mesh_source(files, options, spill);
    const mesh_files::MeshSource source = mesh_files::read_mesh_source(files, options);
    EXPECT_EQ(seen_in(spill), seen_in(source.meshes));
    EXPECT_EQ(spill.copyrights, source.copyrights);
    for (const mesh_files::SurfaceAppearance& look : spill.materials) {
      if (!look.texture) continue;
      const mesh_files::TexelFetcher fetch = spill.texels.fetcher();
      const auto same = std::find_if(source.meshes.begin(), source.meshes.end(), [&](const TexturedMesh& m) {
        return m.texture && m.texture->width == look.texture->width;
      });
      ASSERT_NE(same, source.meshes.end());
      EXPECT_EQ(same->wrap_u, look.wrap_u);
      for (int x = 0; x < look.texture->width; ++x) EXPECT_EQ(fetch(*look.texture, x, 1), (*same->texture)(x, 1));
    }
  }

  tests::TemporaryFolder folder_;
};

constexpr const char* kPositions = "v 0 0 0 255 0 9\nv 2 0 0\nv 2 1 0 0 128 0\nv 0 1 0.5\nv -1 0.5 0\n";

TEST_F(SpilledFiles, ObjFilesAreReadAsInMemory) {
  write("m.mtl", "newmtl wall\nmap_Kd -s 2 3 -o 0.25 0.5 -clamp on wall.png\nnewmtl door\nKd 0.5 0.2 0.1\n");
  imaging::write_rgb(folder_ / "wall.png", imaging::RgbImage(7, 3, {9, 80, 200}));
  write("a.obj", std::string("mtllib m.mtl\nvt 0 0\nvt 1 0.25\nvt 0.5 1\nvt nan 1\n") + kPositions +
                     "usemtl wall\nf 1/1 2/2 3/3 4/4\nf 1 2 5\nusemtl door\nf 1/1 4/2 5/3\nusemtl none\nf 2 3 5\n");
  write("b.obj",
        std::string("usemtl wall\n") + "v 0 0 0\nv 2 0 0\nv 2 1 0\nf 1 2 3\nf -1 -2 -3\nf 1 1 2\nmtllib m.mtl\n");
  expect_same({folder_ / "a.obj"});
  expect_same({folder_ / "a.obj", folder_ / "b.obj"}, {.up = tile_content::UpAxis::kY, .metres_per_unit = 0.25});
  expect_same({folder_ / "a.obj"}, {.textures = false});
  EXPECT_EQ(mesh_files::list_mesh_files({folder_.path()}),
            (std::vector<fs::path>{folder_ / "a.obj", folder_ / "b.obj"}));
  EXPECT_THAT(
      [&] {
        mesh_files::MeshSpill spill(folder_ / "s");
        write("c.obj", std::string(kPositions) + "f 1 2 9\n");
        mesh_files::spill_mesh_source({folder_ / "c.obj"}, {}, spill);
      },
      ThrowsMessage<InputError>(HasSubstr("c.obj, line 6")));
}

TEST_F(SpilledFiles, PlyFilesAreReadAsInMemory) {
  imaging::write_rgb(folder_ / "p.png", imaging::RgbImage(5, 4, {9, 80, 200}));
  write("a.ply",
        "ply\nformat ascii 1.0\ncomment TextureFile p.png\nelement vertex 4\nproperty float x\nproperty float y\n"
        "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
        "element face 2\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\nend_header\n"
        "0 0 0 255 188 0\n2 0 0 255 188 0\n2 1 0 255 188 0\n0 1 0 0 0 0\n"
        "4 0 1 2 3 8 0 0 1 0 1 1 0 1\n3 0 2 3 0\n");
  expect_same({folder_ / "a.ply"});
  expect_same({folder_ / "a.ply"}, {.textures = false});
}

TEST_F(SpilledFiles, GltfFilesAreReadAsInMemory) {
  std::vector<TexturedMesh> meshes = make_place();
  meshes[0].base_color = {0.5F, 1, 1, 1};
  base::write_file(folder_ / "a.glb", imaging::write_glb({meshes[0], meshes[2]}, {.copyright = "me"}));
  base::write_file(folder_ / "b.glb", imaging::write_glb({meshes[2]}, {.copyright = "you", .meshopt = true}));
  expect_same({folder_ / "a.glb", folder_ / "b.glb"});
  EXPECT_GT(mesh_files::estimated_memory_bytes({folder_ / "a.glb"}, true), fs::file_size(folder_ / "a.glb"));
}

TEST_F(SpilledFiles, MemoryIsEstimatedWithTheImages) {
  write("m.mtl", "newmtl wall\nmap_Kd wall.png\n");
  write("a.obj", std::string(kPositions) + "f 1 2 3\nmtllib m.mtl\n");
  const std::uintmax_t without = mesh_files::estimated_memory_bytes({folder_ / "a.obj"}, true);
  EXPECT_EQ(mesh_files::mesh_file_sizes({folder_ / "a.obj"}, true).images, 0U) << "the image is not there yet";
  imaging::write_rgb(folder_ / "wall.png", imaging::RgbImage(70, 30));
  EXPECT_EQ(mesh_files::mesh_file_sizes({folder_ / "a.obj"}, true).images, fs::file_size(folder_ / "wall.png"));
  EXPECT_GT(mesh_files::estimated_memory_bytes({folder_ / "a.obj"}, true), without);
  EXPECT_EQ(mesh_files::estimated_memory_bytes({folder_ / "a.obj"}, false), without);
}

}  // namespace
}  // namespace tileflight::tile_writer::large_mesh_tileset_test
