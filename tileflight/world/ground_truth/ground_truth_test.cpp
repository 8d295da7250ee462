#include "tileflight/world/ground_truth/ground_truth.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <octomap/octomap.h>
#include <tiny_gltf.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <random>
#include <set>
#include <span>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/core/geometry/nearest.h"
#include "tileflight/core/geometry/point_order.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/world/ground_truth/mesh_glb.h"
#include "tileflight/world/ground_truth/octree.h"
#include "tileflight/world/ground_truth/quantization_floor.h"
#include "tileflight/world/ground_truth/truth_folder.h"

namespace tileflight::ground_truth::ground_truth_test {
namespace {

using geometry::Box3;
using geometry::Vec3;
using imaging::TexturedMesh;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

/// A textured, hilly square of side x side quads of 1 m, its first corner at `corner`.
TexturedMesh hills(std::uint32_t side, const Vec3& corner) {
  TexturedMesh m;
  m.name = "hills";
  for (std::uint32_t y = 0; y <= side; ++y) {
    for (std::uint32_t x = 0; x <= side; ++x) {
      m.mesh.vertices.push_back(corner + Vec3(x, y, 2.0 * std::sin(0.3 * x) * std::cos(0.2 * y)));
      m.uv.emplace_back(static_cast<float>(x) / side, static_cast<float>(y) / side);
    }
  }
  for (std::uint32_t y = 0; y < side; ++y) {
    for (std::uint32_t x = 0; x < side; ++x) {
      const std::uint32_t a = y * (side + 1) + x, b = a + 1, c = a + side + 1;
      m.mesh.triangles.push_back({a, b, c});
      m.mesh.triangles.push_back({b, c + 1, c});
    }
  }
  imaging::RgbImage texture(64, 64);
  for (std::size_t i = 0; i < texture.pixels.size(); ++i) texture.pixels[i] = {static_cast<std::uint8_t>(i), 80, 40};
  m.texture = std::make_shared<const imaging::RgbImage>(std::move(texture));
  return m;
}

const Vec3 kCorner(222.8, -256.4, 2885.123456);

/// Whether the bytes decode as JPEG, by the library with which the project reads images.
bool decode_image(tinygltf::Image* image, int, std::string*, std::string*, int, int, const unsigned char* bytes,
                  int size, void*) {
  const auto decoded = imaging::decode_rgb(std::as_bytes(std::span(bytes, static_cast<std::size_t>(size))), "texture");
  image->width = decoded.width;
  image->height = decoded.height;
  return image->mimeType == "image/jpeg";
}

tinygltf::Model load_glb(const std::filesystem::path& file) {
  tinygltf::TinyGLTF loader;
  loader.SetImageLoader(decode_image, nullptr);
  tinygltf::Model model;
  std::string error, warning;
  EXPECT_TRUE(loader.LoadBinaryFromFile(&model, &error, &warning, file.string())) << error;
  EXPECT_EQ(warning, "");
  return model;
}

TEST(MeshGlb, RoundTripKeepsMillimetresFarFromTheOrigin) {
  const tests::TemporaryFolder folder;
  const TexturedMesh near = hills(20, kCorner);
  const TexturedMesh far = hills(10, Vec3(1.2e6, -4.7e6, 4.1e6));
  write_mesh_glb(folder / "m.glb", {near, far}, true);
  const geometry::TriangleMesh read = read_mesh_glb(folder / "m.glb");
  const geometry::TriangleMesh expected = scene::merge_meshes({near, far});
  EXPECT_EQ(read.triangles, expected.triangles);
  ASSERT_EQ(read.vertices.size(), expected.vertices.size());
  for (std::size_t i = 0; i < read.vertices.size(); ++i) {
    EXPECT_LT((read.vertices[i] - expected.vertices[i]).norm(), 1e-5);
  }
}

TEST(MeshGlb, IsWhatGltfReadersExpect) {
  const tests::TemporaryFolder folder;
  TexturedMesh textured = hills(4, kCorner);
  TexturedMesh coloured = hills(3, kCorner + Vec3(10, 0, 0));
  coloured.texture = nullptr;
  coloured.uv.clear();
  coloured.colors.assign(coloured.mesh.vertices.size(), {10, 20, 30, 255});
  TexturedMesh same_texture = textured;
  same_texture.wrap_u = imaging::Wrap::kClampToEdge;
  write_mesh_glb(folder / "m.glb", {textured, coloured, same_texture}, true);
  const tinygltf::Model model = load_glb(folder / "m.glb");
  ASSERT_EQ(model.meshes.size(), 3U);
  ASSERT_EQ(model.images.size(), 1U);  // shared
  EXPECT_EQ(model.images[0].width, 64);
  EXPECT_EQ(model.textures.size(), 2U);
  EXPECT_EQ(model.samplers[1].wrapS, TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE);
  EXPECT_EQ(model.materials[1].pbrMetallicRoughness.baseColorTexture.index, -1);
  EXPECT_TRUE(model.meshes[1].primitives[0].attributes.contains("COLOR_0"));
  EXPECT_FALSE(model.meshes[1].primitives[0].attributes.contains("TEXCOORD_0"));
  // North, the second local axis, is -z in glTF; up is y.
  const geometry::Mat4 turn = Eigen::Map<const geometry::Mat4>(model.nodes[0].matrix.data());
  EXPECT_EQ((turn * Vec3(1, 2, 3).homogeneous()).head<3>(), Vec3(1, 3, -2));
  const auto& positions =
      model.accessors[static_cast<std::size_t>(model.meshes[0].primitives[0].attributes.at("POSITION"))];
  EXPECT_NEAR(positions.maxValues[0], 2.0, 1e-6);  // relative to the middle
}

TEST(MeshGlb, WithoutTextures) {
  const tests::TemporaryFolder folder;
  write_mesh_glb(folder / "m.glb", {hills(4, kCorner)}, false);
  EXPECT_TRUE(load_glb(folder / "m.glb").images.empty());
}

TEST(MeshGlb, EveryKindOfDamageIsRefused) {
  const tests::TemporaryFolder folder;
  write_mesh_glb(folder / "m.glb", {hills(2, kCorner)}, false);
  const std::string whole = base::read_text(folder / "m.glb");
  const auto read_bytes = [&](const std::string& bytes) {
    base::write_file(folder / "d.glb", bytes);
    return read_mesh_glb(folder / "d.glb");
  };
  EXPECT_THAT([&] { read_bytes(""); }, ThrowsMessage<InputError>(HasSubstr("is not a readable GLB file")));
  EXPECT_THAT([&] { read_bytes("solid stl"); }, ThrowsMessage<InputError>(HasSubstr("is not a readable GLB file")));
  for (std::size_t size = 0; size < whole.size(); size += 7) {
    EXPECT_THAT([&] { read_bytes(whole.substr(0, size)); },
                ThrowsMessage<InputError>(HasSubstr("is not a readable GLB file")))
        << size;
  }
  std::mt19937 random(1);
  for (int i = 0; i < 500; ++i) {
    std::string damaged = whole;
    damaged[random() % damaged.size()] = static_cast<char>(random());
    try {
      read_bytes(damaged);  // may be luck
    } catch (const InputError&) {
    }
  }
}

TEST(Octree, HoldsTheSameOccupiedLeaves) {
  const tests::TemporaryFolder folder;
  const TexturedMesh m = hills(30, kCorner);
  const geometry::VoxelGrid grid = voxelize(m.mesh, Box3(kCorner, kCorner + Vec3(30, 30, 8)), 0.5);
  write_octree(folder / "o.bt", grid);
  octomap::OcTree tree(1.0);
  ASSERT_TRUE(tree.readBinary((folder / "o.bt").string()));
  EXPECT_DOUBLE_EQ(tree.getResolution(), 0.5);
  tree.expand();
  std::set<geometry::Cell> leaves;
  for (auto leaf = tree.begin_leafs(); leaf != tree.end_leafs(); ++leaf) {
    if (!tree.isNodeOccupied(*leaf)) continue;
    const auto index = [](double coordinate) { return static_cast<std::int32_t>(std::floor(coordinate / 0.5)); };
    leaves.insert({index(leaf.getX()), index(leaf.getY()), index(leaf.getZ())});
  }
  EXPECT_EQ(std::vector(leaves.begin(), leaves.end()), grid.occupied);
  EXPECT_THAT(base::read_text(folder / "o.bt"), HasSubstr("222.8 -256.4 2885.123456"));
}

TEST(Octree, MoreCellsThanOctoMapHolds) {
  const tests::TemporaryFolder folder;
  EXPECT_THAT(
      [&] {
        write_octree(folder / "o.bt", {Vec3::Zero(), 1.0, {32769, 1, 1}, {}});
      },
      ThrowsMessage<InputError>(HasSubstr("at most 32768 cells")));
}

TEST(GroundTruth, IsWrittenAndReadBack) {
  const tests::TemporaryFolder folder;
  const Box3 box(kCorner + Vec3(5, 5, -4), kCorner + Vec3(15, 25, 4));
  GroundTruthOptions options;
  options.voxel_m = 0.5;
  const TexturedMesh outside = hills(3, kCorner + Vec3(100, 0, 0));
  const GroundTruthSummary result = write_ground_truth({hills(30, kCorner), outside}, box, options, folder.path());
  for (const char* name : {"mesh.glb", "surface.ply", "voxels.binvox", "voxels.ply", "octree.bt"}) {
    EXPECT_TRUE(std::filesystem::exists(folder / name)) << name;
  }
  // 10 x 20 quads of two triangles, and those around that reach the box's faces (which lie on the quads' borders).
  EXPECT_GE(result.triangles, 400U);
  EXPECT_LE(result.triangles, 12U * 22U * 2U);

  const GroundTruth truth = read_ground_truth(folder.path());
  EXPECT_EQ(truth.mesh.triangles.size(), result.triangles);
  const geometry::PointCloud surface = read_surface_samples(folder.path());
  EXPECT_EQ(surface.size(), result.surface_points);
  EXPECT_EQ(surface.normals.size(), result.surface_points);
  EXPECT_EQ(truth.voxel_centers.size(), result.voxels.occupied.size());
  EXPECT_DOUBLE_EQ(truth.voxel_m, 0.5);
  EXPECT_EQ(voxelize(hills(30, kCorner).mesh, box, 0.5).occupied, result.voxels.occupied);
  ASSERT_FALSE(surface.empty());
  for (const Vec3& p : surface.positions) EXPECT_LT(box.exteriorDistance(p), 1e-9);
  const geometry::NearestIndex centers(truth.voxel_centers.positions);
  ASSERT_EQ(result.quantization_floor_m.size(), surface.size());
  for (std::size_t i = 0; i < surface.size(); ++i)
    EXPECT_DOUBLE_EQ(result.quantization_floor_m[i], centers.nearest(surface.positions[i])->distance_m);
}

/// A triangle with a square hole, and a square beside it: everything outside both is left out.
TEST(GroundTruth, PolygonsCutTheBox) {
  const tests::TemporaryFolder folder;
  const auto square = [](double x, double y, double size) -> geometry::Ring {
    return {{x, y}, {x + size, y}, {x + size, y + size}, {x, y + size}};
  };
  const Box3 box(Vec3(0, 0, -4), Vec3(30, 30, 4));
  const TexturedMesh mesh = hills(30, Vec3::Zero());
  GroundTruthOptions options;
  options.prisms.push_back({geometry::PolygonArea({{{1, 1}, {25.3, 1}, {1, 25.3}}, square(4, 4, 6)}), -4, 0.5});
  options.prisms.push_back({geometry::PolygonArea({square(22.25, 22.25, 5)}), -4, 4});
  const auto wanted = [&](const Vec3& p) {
    const bool in_hole = p.x() > 4 && p.x() < 10 && p.y() > 4 && p.y() < 10;
    const bool in_triangle = p.x() > 1 && p.y() > 1 && p.x() + p.y() < 26.3 && p.z() <= 0.5;
    return (in_triangle && !in_hole) || (p.head<2>() - Eigen::Vector2d(24.75, 24.75)).cwiseAbs().maxCoeff() < 2.5;
  };
  const geometry::PointCloud cloud{.positions = {Vec3(2, 2, 3), Vec3(23, 23, 3), Vec3(5, 5, 0), Vec3(2, 2, -3)}};
  const GroundTruthSummary result = write_ground_truth({mesh}, box, options, folder.path(), {}, {cloud});
  EXPECT_EQ(result.cloud_points, 2U);
  std::set<geometry::Cell> expected;
  for (const geometry::Cell& cell : voxelize(mesh.mesh, box, 1.0).occupied) {
    if (wanted(result.voxels.center(cell))) expected.insert(cell);
  }
  expected.insert({23, 23, 7});
  expected.insert({2, 2, 1});
  EXPECT_EQ(std::set(result.voxels.occupied.begin(), result.voxels.occupied.end()), expected);
  const GroundTruth truth = read_ground_truth(folder.path());
  const geometry::PointCloud samples = read_surface_samples(folder.path());
  ASSERT_FALSE(samples.empty());
  for (const Vec3& p : samples.positions) EXPECT_TRUE(wanted(p)) << p.transpose();
  // Triangles have edges of at most 2 m: each has a corner that near to what is wanted.
  EXPECT_EQ(truth.mesh.triangles.size(), result.triangles);
  std::size_t with_corner = 0;
  for (const geometry::Triangle& t : mesh.mesh.triangles) {
    with_corner += std::ranges::any_of(t, [&](auto corner) { return wanted(mesh.mesh.vertices[corner]); }) ? 1 : 0;
  }
  EXPECT_GE(result.triangles, with_corner);
  EXPECT_LE(result.triangles, with_corner + with_corner / 3);
}

TEST(GroundTruth, PointsAloneAreATruthWithoutAMesh) {
  const tests::TemporaryFolder folder;
  const Box3 box(Vec3::Zero(), Vec3(4, 4, 4));
  write_ground_truth({}, box, {}, folder.path(), {}, {{.positions = {Vec3(1.5, 1.5, 1.5), Vec3(3.5, 0.5, 0.5)}}});
  const GroundTruth truth = read_ground_truth(folder.path());
  EXPECT_TRUE(truth.mesh.triangles.empty());
  EXPECT_EQ(read_surface_samples(folder.path()).size(), 2U);
  EXPECT_EQ(truth.voxel_centers.positions, (std::vector<Vec3>{Vec3(1.5, 1.5, 1.5), Vec3(3.5, 0.5, 0.5)}));
}

TEST(GroundTruth, SameInputsGiveSameBytes) {
  const tests::TemporaryFolder folder;
  const Box3 box(kCorner, kCorner + Vec3(20, 20, 4));
  for (const char* name : {"a", "b"}) {
    std::filesystem::create_directory(folder / name);
    write_ground_truth({hills(30, kCorner)}, box, {}, folder / name);
  }
  for (const char* name : {"mesh.glb", "surface.ply", "voxels.binvox", "voxels.ply", "octree.bt"}) {
    EXPECT_EQ(base::sha256_hex_of_file(folder / "a" / name), base::sha256_hex_of_file(folder / "b" / name));
  }
}

TEST(GroundTruth, BadInputIsNamed) {
  const tests::TemporaryFolder folder;
  const auto expect = [&](const std::vector<TexturedMesh>& meshes, const Box3& box, double voxel_m,
                          const char* message) {
    GroundTruthOptions options;
    options.voxel_m = voxel_m;
    EXPECT_THAT([&] { write_ground_truth(meshes, box, options, folder.path()); },
                ThrowsMessage<InputError>(HasSubstr(message)));
  };
  const TexturedMesh m = hills(5, Vec3::Zero());
  const Box3 box(Vec3::Zero(), Vec3(5, 5, 5));
  expect({m}, Box3(), 1.0, "region: is empty");
  expect({m}, Box3(Vec3(50, 50, 50), Vec3(60, 60, 60)), 1.0, "region: contains no triangle");
  expect({}, box, 1.0, "region: contains no triangle");
  expect({m}, box, 0.0, "above zero");
  TexturedMesh broken = m;
  broken.mesh.vertices[0].x() = std::nan("");
  expect({broken}, box, 1.0, "not finite");
  EXPECT_THAT([&] { write_ground_truth({m}, box, {}, folder / "no_such_folder"); },
              ThrowsMessage<InputError>(HasSubstr("No such file or directory")));
  EXPECT_THAT([&] { read_ground_truth(folder / "no_such_folder"); },
              ThrowsMessage<InputError>(HasSubstr("voxels.ply: cannot be opened")));
}

TEST(GroundTruth, FullDiskIsAnError) {
  const tests::TemporaryFolder folder;
  std::filesystem::create_symlink("/dev/full", folder / "surface.ply");
  EXPECT_THAT(
      [&] { write_ground_truth({hills(5, Vec3::Zero())}, Box3(Vec3::Zero(), Vec3(5, 5, 5)), {}, folder.path()); },
      ThrowsMessage<InputError>(HasSubstr("No space left on device")));
}

/// The blocks of a region in a grid of `count` by `count`.
std::vector<CellRange> blocks_of(const std::array<std::int32_t, 3>& dims, std::int32_t count) {
  std::vector<CellRange> blocks;
  for (std::int32_t x = 0; x < count; ++x) {
    for (std::int32_t y = 0; y < count; ++y) {
      blocks.push_back({{x * dims[0] / count, y * dims[1] / count, 0},
                        {(x + 1) * dims[0] / count - 1, (y + 1) * dims[1] / count - 1, dims[2] - 1}});
    }
  }
  return blocks;
}

using Corners = std::array<std::array<double, 3>, 3>;

std::vector<Corners> sorted_triangles(const geometry::TriangleMesh& mesh) {
  std::vector<Corners> triangles;
  for (const geometry::Triangle& t : mesh.triangles) {
    Corners& corners = triangles.emplace_back();
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t a = 0; a < 3; ++a) corners[k][a] = mesh.vertices[t[k]][static_cast<Eigen::Index>(a)];
  }
  std::sort(triangles.begin(), triangles.end());
  return triangles;
}

/// Content of a region's folders, in an order that does not depend on blocks.
struct Content {
  std::vector<Corners> triangles;
  geometry::PointCloud surface;
  std::vector<Vec3> centers;
  std::vector<geometry::Cell> cells;
  nlohmann::json floor;
  std::size_t cloud_points = 0;
};

void add_folder(const std::filesystem::path& folder, const CellRange& block, Content& content) {
  if (!std::filesystem::exists(folder / "voxels.ply")) return;
  const geometry::VoxelGrid grid = geometry::read_binvox(folder / "voxels.binvox");
  for (const geometry::Cell& cell : grid.occupied)
    content.cells.push_back({cell.x + block.low[0], cell.y + block.low[1], cell.z + block.low[2]});
  for (const Vec3& center : geometry::read_cloud(folder / "voxels.ply").positions) content.centers.push_back(center);
  const geometry::PointCloud samples = read_surface_samples(folder);
  content.surface.positions.insert(content.surface.positions.end(), samples.positions.begin(), samples.positions.end());
  content.surface.normals.insert(content.surface.normals.end(), samples.normals.begin(), samples.normals.end());
  if (!std::filesystem::exists(folder / "mesh.glb")) return;
  for (const Corners& t : sorted_triangles(read_mesh_glb(folder / "mesh.glb"))) content.triangles.push_back(t);
}

class GroundTruthBlocks : public ::testing::TestWithParam<std::tuple<int, bool>> {};

TEST_P(GroundTruthBlocks, AreTogetherExactlyTheRegion) {
  const auto [count, in_polygon] = GetParam();
  // Hills of small triangles, one triangle that is larger than any block, and a tile of points; the region's sides are
  // no multiple of the voxel.
  std::vector<imaging::TexturedMesh> meshes{hills(30, kCorner), hills(4, kCorner)};
  meshes[1].mesh.vertices.push_back(kCorner + Vec3(-10, -10, 7));
  meshes[1].mesh.vertices.push_back(kCorner + Vec3(60, 5, 1));
  meshes[1].mesh.vertices.push_back(kCorner + Vec3(5, 70, 2));
  const auto n = static_cast<std::uint32_t>(meshes[1].mesh.vertices.size());
  meshes[1].mesh.triangles = {{n - 3, n - 2, n - 1}};
  if (!meshes[1].uv.empty()) meshes[1].uv.resize(n);
  if (!meshes[1].colors.empty()) meshes[1].colors.resize(n);
  geometry::PointCloud points;
  for (int i = 0; i < 400; ++i) points.positions.push_back(kCorner + Vec3(0.075 * i, 0.3 + 29.0 / (1 + i % 40), 6.3));
  const Box3 box(kCorner + Vec3(0.4, 0.2, -0.3), kCorner + Vec3(29.7, 28.9, 8.1));
  GroundTruthOptions options{.voxel_m = 0.7, .samples_per_m2 = 9.0};
  if (in_polygon) {
    const Vec3 c = kCorner;
    const geometry::Ring ring{{c.x() + 2, c.y() + 3}, {c.x() + 25, c.y() + 1}, {c.x() + 15, c.y() + 27}};
    options.prisms.push_back({geometry::PolygonArea({ring}), c.z() - 5, c.z() + 20});
  }

  const tests::TemporaryFolder whole_folder;
  Content whole, parts;
  const GroundTruthSummary all = write_ground_truth(meshes, box, options, whole_folder.path(), {}, {points});
  QuantizationFloor whole_floor(0.7), floor(0.7);
  whole_floor.add(all.quantization_floor_m);
  add_folder(whole_folder.path(), whole_grid(all.voxels.dims), whole);
  std::size_t triangles = 0, samples = 0, cloud_points = 0;
  for (const CellRange& block : blocks_of(all.voxels.dims, count)) {
    const tests::TemporaryFolder folder;
    GroundTruthSummary part;
    options.block = {block, 1};
    do {
      part = write_ground_truth(meshes, box, options, folder.path(), {}, {points});
      options.block->border *= 2;
    } while (part.border_too_narrow);
    floor.add(part.quantization_floor_m);
    triangles += part.triangles;
    samples += part.surface_points;
    cloud_points += part.cloud_points;
    add_folder(folder.path(), block, parts);
  }
  geometry::sort_by_position(parts.surface);
  std::sort(parts.triangles.begin(), parts.triangles.end());
  std::sort(parts.cells.begin(), parts.cells.end());
  EXPECT_GT(all.cloud_points, 50U);
  EXPECT_EQ(triangles, all.triangles);
  EXPECT_EQ(samples, all.surface_points);
  EXPECT_EQ(cloud_points, all.cloud_points);
  EXPECT_EQ(parts.cells, all.voxels.occupied);
  EXPECT_EQ(parts.triangles, whole.triangles);
  EXPECT_EQ(parts.surface.positions, whole.surface.positions);
  EXPECT_EQ(parts.surface.normals, whole.surface.normals);
  EXPECT_EQ(floor.statistics(), whole_floor.statistics());
  const auto by_axis = [](const Vec3& a, const Vec3& b) {
    return std::tuple(a.x(), a.y(), a.z()) < std::tuple(b.x(), b.y(), b.z());
  };
  std::sort(parts.centers.begin(), parts.centers.end(), by_axis);
  EXPECT_EQ(parts.centers, whole.centers);
}

INSTANTIATE_TEST_SUITE_P(OfAnySize, GroundTruthBlocks,
                         ::testing::Combine(::testing::Values(1, 2, 3, 7, 40), ::testing::Bool()));

}  // namespace
}  // namespace tileflight::ground_truth::ground_truth_test
