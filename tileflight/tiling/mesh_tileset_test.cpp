#include "tileflight/tiling/mesh_tileset.h"

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
#include "tileflight/base/files.h"
#include "tileflight/base/input_error.h"
#include "tileflight/base/srgb.h"
#include "tileflight/geometry/triangle_index.h"
#include "tileflight/simplification/simplify.h"
#include "tileflight/tiles/load.h"

namespace tileflight::tiling::mesh_tileset_test {
namespace {

using geometry::Triangle;
using geometry::Vec3;
using imaging::RgbImage;
using imaging::TexturedMesh;
using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr int kSheets = 4, kCells = 12;  ///< sheets along a side of the site, cells along a side of a sheet
constexpr double kEdge_m = 20.0;
constexpr int kSlot_px = 128, kInset_px = 4;  ///< square of a sheet in its atlas, and its unused border

/// Heights that are exact in floats, so that surfaces can be compared exactly.
double height(double x, double y) {
  const double z = 2.0 * std::sin(0.11 * x) + 1.3 * std::cos(0.17 * y) + 0.4 * std::sin(0.9 * x) * std::sin(0.7 * y);
  return std::round(64 * z) / 64;
}

/// Colour of the site, sRGB.
std::array<double, 3> color(double x, double y) {
  return {128 + 80 * std::sin(0.09 * x), 128 + 80 * std::cos(0.11 * y), 128 + 60 * std::sin(0.05 * (x + y))};
}

/// Sheet (i, j) in slot `slot` of an atlas of `columns` columns; odd slots are rotated by 90 degrees.
struct Slot {
  int column = 0, row = 0;
  bool turned = false;
  double x0 = 0, y0 = 0;

  Slot(int slot, int columns, int i, int j)
      : column(slot % columns),
        row(slot / columns),
        turned(slot % 2 == 1),
        x0(kEdge_m * (i - kSheets / 2)),
        y0(kEdge_m * (j - kSheets / 2)) {}

  /// Atlas texel of a position in the site.
  Eigen::Vector2d texel(double x, double y) const {
    const double s = (x - x0) / kEdge_m, t = (y - y0) / kEdge_m, inner = kSlot_px - 2 * kInset_px;
    return {column * kSlot_px + kInset_px + inner * (turned ? t : s),
            row * kSlot_px + kInset_px + inner * (turned ? s : t)};
  }
  void paint(RgbImage& atlas) const {
    for (int b = 0; b < kSlot_px; ++b)
      for (int a = 0; a < kSlot_px; ++a) {
        const double along = (a + 0.5 - kInset_px) / (kSlot_px - 2 * kInset_px);
        const double down = (b + 0.5 - kInset_px) / (kSlot_px - 2 * kInset_px);
        const auto c = color(x0 + kEdge_m * (turned ? down : along), y0 + kEdge_m * (turned ? along : down));
        atlas(column * kSlot_px + a, row * kSlot_px + b) = {
            static_cast<std::uint8_t>(c[0]), static_cast<std::uint8_t>(c[1]), static_cast<std::uint8_t>(c[2])};
      }
  }
};

void add_vertex(double x, double y, TexturedMesh& mesh) { mesh.mesh.vertices.emplace_back(x, y, height(x, y)); }

/// Appends one sheet of hills; `attribute(x, y)` is called for each vertex.
template <class Attribute>
void add_sheet(int i, int j, TexturedMesh& mesh, const Attribute& attribute) {
  const auto first = static_cast<std::uint32_t>(mesh.mesh.vertices.size());
  constexpr std::uint32_t kRow = kCells + 1;
  for (std::uint32_t b = 0; b < kRow; ++b)
    for (std::uint32_t a = 0; a < kRow; ++a) {
      // Steps of 20 / 12 m are no dyadic numbers: rounded to 1/64 m, the same from either side.
      const auto place = [](int sheet, std::uint32_t step) {
        return std::round(64 * kEdge_m * (sheet - kSheets / 2 + static_cast<double>(step) / kCells)) / 64;
      };
      add_vertex(place(i, a), place(j, b), mesh);
      attribute(mesh.mesh.vertices.back().x(), mesh.mesh.vertices.back().y());
      if (a == kCells || b == kCells) continue;
      const std::uint32_t at = first + b * kRow + a;
      mesh.mesh.triangles.push_back({at, at + 1, at + 1 + kRow});
      mesh.mesh.triangles.push_back({at, at + 1 + kRow, at + kRow});
    }
}

/// Rows `from` to `to` of sheets on one atlas whose unused parts are magenta. `shift`: integer offset of the texture
/// coordinates (whole repeats).
TexturedMesh textured_rows(int from, int to, float shift) {
  TexturedMesh mesh;
  const auto atlas = std::make_shared<RgbImage>(3 * kSlot_px, 3 * kSlot_px, imaging::Rgb8{255, 0, 255});
  for (int j = from; j < to; ++j)
    for (int i = 0; i < kSheets; ++i) {
      const Slot slot((j - from) * kSheets + i, 3, i, j);
      slot.paint(*atlas);
      add_sheet(i, j, mesh, [&](double x, double y) {
        const Eigen::Vector2d texel = slot.texel(x, y) / (3.0 * kSlot_px);
        mesh.uv.emplace_back(static_cast<float>(texel.x()) + shift, static_cast<float>(texel.y()));
      });
    }
  mesh.texture = atlas;
  return mesh;
}

/// 80 m x 80 m around the origin: two textured materials and one row coloured by vertex.
std::vector<TexturedMesh> make_place() {
  TexturedMesh colored;
  for (int i = 0; i < kSheets; ++i)
    add_sheet(i, 3, colored, [&](double x, double y) {
      const auto c = color(x, y);
      colored.colors.push_back(base::linear_rgba_from_srgb(
          {static_cast<float>(c[0] / 255), static_cast<float>(c[1] / 255), static_cast<float>(c[2] / 255)}));
    });
  return {textured_rows(0, 2, 0.0F), textured_rows(2, 3, 1.0F), colored};
}

MeshTilesetOptions small_tiles() {
  MeshTilesetOptions options;
  options.tile_triangles = 350;
  options.jpeg_quality = 95;
  options.copyright = "a test, CC0";
  return options;
}

tiles::LoadedTiles load(const std::filesystem::path& folder, double error_m) {
  tiles::LoadOptions options;
  options.error_m = error_m;
  return tiles::load_region(folder.string(), options);
}

/// Positions of each triangle's corners, starting at the smallest: equal lists mean equal surfaces, winding included.
std::vector<std::array<double, 9>> places_of(const geometry::TriangleMesh& mesh) {
  std::vector<std::array<double, 9>> out;
  for (const Triangle& t : mesh.triangles) {
    std::array<std::array<double, 9>, 3> turns{};
    for (std::size_t turn = 0; turn < 3; ++turn)
      for (std::size_t k = 0; k < 9; ++k)
        turns[turn][k] = mesh.vertices[t[(turn + k / 3) % 3]][static_cast<Eigen::Index>(k % 3)];
    out.push_back(*std::min_element(turns.begin(), turns.end()));
  }
  std::sort(out.begin(), out.end());
  return out;
}

/// Largest distance of sampled points of `from` (corners, and points within each triangle) to `to`.
double sampled_distance_m(const geometry::TriangleMesh& from, const geometry::TriangleMesh& to) {
  const geometry::TriangleIndex index(to);
  double farthest_m = 0;
  for (const Triangle& t : from.triangles)
    for (int i = 0; i <= 4; ++i)
      for (int j = 0; i + j <= 4; ++j) {
        const Vec3 &a = from.vertices[t[0]], &b = from.vertices[t[1]], &c = from.vertices[t[2]];
        farthest_m = std::max(farthest_m, index.nearest(a + (b - a) * i / 4 + (c - a) * j / 4)->distance_m);
      }
  return farthest_m;
}

/// Displayed colour of a mesh at a point of a triangle: texel, or vertex colours.
std::array<double, 3> shown(const TexturedMesh& mesh, const Triangle& t, const Vec3& weights) {
  std::array<double, 3> out{};
  if (!mesh.texture) {
    for (std::size_t c = 0; c < 3; ++c) {
      double linear = 0;
      for (std::size_t k = 0; k < 3; ++k)
        linear += weights[static_cast<Eigen::Index>(k)] * mesh.colors[t[k]][c] / 255.0;
      out[c] = 255.0 * static_cast<double>(base::srgb_from_linear(static_cast<float>(linear)));
    }
    return out;
  }
  Eigen::Vector2d uv = Eigen::Vector2d::Zero();
  for (std::size_t k = 0; k < 3; ++k) uv += weights[static_cast<Eigen::Index>(k)] * mesh.uv[t[k]].cast<double>();
  const imaging::Rgb8 texel =
      (*mesh.texture)(std::min(mesh.texture->width - 1, static_cast<int>(uv.x() * mesh.texture->width)),
                      std::min(mesh.texture->height - 1, static_cast<int>(uv.y() * mesh.texture->height)));
  for (std::size_t c = 0; c < 3; ++c) out[c] = texel[c];
  return out;
}

/// Largest and mean difference, in grey levels, between the displayed colours and those of the site.
struct ColorDifference {
  double largest = 0, mean = 0;
};
ColorDifference color_difference(const std::vector<TexturedMesh>& meshes) {
  ColorDifference out;
  double sum = 0;
  int count = 0;
  const std::array<Vec3, 4> weights{Vec3(1, 1, 1) / 3, Vec3(0.98, 0.01, 0.01), Vec3(0.01, 0.98, 0.01),
                                    Vec3(0.01, 0.01, 0.98)};
  for (const TexturedMesh& mesh : meshes)
    for (const Triangle& t : mesh.mesh.triangles)
      for (const Vec3& w : weights) {
        const auto& v = mesh.mesh.vertices;
        const Vec3 place = w[0] * v[t[0]] + w[1] * v[t[1]] + w[2] * v[t[2]];
        const auto is = shown(mesh, t, w), truth = color(place.x(), place.y());
        for (std::size_t c = 0; c < 3; ++c) {
          out.largest = std::max(out.largest, std::fabs(is[c] - truth[c]));
          sum += std::fabs(is[c] - truth[c]);
          ++count;
        }
      }
  out.mean = sum / count;
  return out;
}

class MeshTileset : public ::testing::Test {
 protected:
  void SetUp() override { summary_ = write_mesh_tileset(folder_ / "place", source_, small_tiles()); }

  tests::TemporaryFolder folder_;
  std::vector<TexturedMesh> source_ = make_place();
  MeshTilesetSummary summary_;
};

TEST_F(MeshTileset, LeavesHoldEachTriangleOnce) {
  const tiles::LoadedTiles loaded = load(folder_ / "place", 0.0);
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
    const tiles::LoadedTiles loaded = load(folder_ / "place", level.geometric_error_m);
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

/// Number of triangles that use each edge, by the positions of its ends.
std::map<std::array<double, 6>, int> edge_uses(const geometry::TriangleMesh& mesh) {
  std::map<std::array<double, 6>, int> uses;
  for (const Triangle& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      Vec3 a = mesh.vertices[t[k]], b = mesh.vertices[t[(k + 1) % 3]];
      if (std::lexicographical_compare(b.begin(), b.end(), a.begin(), a.end())) std::swap(a, b);
      ++uses[{a.x(), a.y(), a.z(), b.x(), b.y(), b.z()}];
    }
  return uses;
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
  const tiles::LoadedTiles loaded = load(folder_ / "small", 0.0);
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
  const tiles::LoadedTiles loaded = load(folder / "x", 0.0);
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
}  // namespace tileflight::tiling::mesh_tileset_test
