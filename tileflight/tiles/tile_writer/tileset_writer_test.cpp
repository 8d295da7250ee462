#include "tileflight/tiles/tile_writer/tileset_writer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/noise.h"
#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/tiles/simplification/simplify.h"
#include "tileflight/tiles/tileset/load.h"

namespace tileflight::tile_writer::tileset_writer_test {
namespace {

using geometry::Vec3;
using imaging::TexturedMesh;
using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr double kLatitudeDeg = 35.31, kLongitudeDeg = -80.74, kHeight_m = 190.0;
constexpr double kEdge_m = 20.0;
constexpr int kSide = 4, kCells = 12;

double hills(double x, double y) {
  return 2.0 * std::sin(0.11 * x) + 1.3 * std::cos(0.17 * y) + 0.3 * base::value_noise(x / 2, y / 2, 3);
}

TexturedMesh make_sheet(double x0, double y0) {
  TexturedMesh out;
  constexpr std::uint32_t kRow = kCells + 1;
  for (std::uint32_t j = 0; j < kRow; ++j) {
    for (std::uint32_t i = 0; i < kRow; ++i) {
      const double x = x0 + kEdge_m * i / kCells, y = y0 + kEdge_m * j / kCells;
      out.mesh.vertices.emplace_back(x, y, hills(x, y));
      out.uv.emplace_back(static_cast<float>(i) / kCells, static_cast<float>(j) / kCells);
      if (i == kCells || j == kCells) continue;
      const std::uint32_t a = j * kRow + i;
      out.mesh.triangles.push_back({a, a + 1, a + 1 + kRow});
      out.mesh.triangles.push_back({a, a + 1 + kRow, a + kRow});
    }
  }
  const auto byte = [](double v) { return static_cast<std::uint8_t>(std::lround(60 + 120 * v)); };
  const double share_x = (x0 / kEdge_m + kSide / 2.0) / kSide, share_y = (y0 / kEdge_m + kSide / 2.0) / kSide;
  out.texture = std::make_shared<imaging::RgbImage>(48, 48, imaging::Rgb8{byte(share_x), byte(share_y), 90});
  out.wrap_u = out.wrap_v = imaging::Wrap::kClampToEdge;
  return out;
}

/// 4 x 4 adjacent sheets of hills, 80 m x 80 m around the origin, each of a different colour.
std::vector<TexturedMesh> make_place() {
  std::vector<TexturedMesh> sheets;
  for (int j = 0; j < kSide; ++j)
    for (int i = 0; i < kSide; ++i) sheets.push_back(make_sheet(kEdge_m * (i - kSide / 2), kEdge_m * (j - kSide / 2)));
  return sheets;
}

TilesetOptions place_options() {
  TilesetOptions options;
  options.level_errors_m = {0.4, 0.1};
  options.copyright = "a test, CC0";
  options.T_ecef_local = geometry::LocalFrame({kLatitudeDeg, kLongitudeDeg, {kHeight_m}}).T_ecef_local();
  return options;
}

tileset::LoadedTiles load(const std::filesystem::path& folder, double error_m) {
  tileset::LoadOptions options;
  options.error_m = error_m;
  options.origin = geometry::Geodetic{kLatitudeDeg, kLongitudeDeg, {kHeight_m}};
  return tileset::load_region(folder.string(), options);
}

class Tileset : public ::testing::Test {
 protected:
  void SetUp() override { summary_ = write_tileset(folder_ / "place", sheets_, place_options()); }

  tests::TemporaryFolder folder_;
  std::vector<TexturedMesh> sheets_ = make_place();
  TilesetSummary summary_;
};

TEST_F(Tileset, TheFinestLevelComesBackInItsPlaceOnEarth) {
  const tileset::LoadedTiles loaded = load(folder_ / "place", 0.0);
  EXPECT_TRUE(loaded.complete);
  EXPECT_EQ(loaded.tiles_loaded, kSide * kSide);
  EXPECT_EQ(loaded.triangles, 2 * kSide * kSide * kCells * kCells);
  EXPECT_EQ(loaded.geometric_error_max_m, 0.0);
  ASSERT_FALSE(loaded.attribution.empty());
  EXPECT_EQ(loaded.attribution.front(), "a test, CC0");
  const geometry::TriangleMesh before = simplification::merge_meshes(sheets_),
                               after = simplification::merge_meshes(loaded.meshes);
  EXPECT_NEAR(surface_area_m2(after), surface_area_m2(before), 0.01);
  EXPECT_LT(simplification::hausdorff_distance_m(after, before), 2e-3);
}

TEST_F(Tileset, EachLevelIsWithinItsGeometricErrorBothWays) {
  ASSERT_EQ(summary_.levels.size(), 3U);
  const geometry::TriangleMesh finest = simplification::merge_meshes(sheets_);
  double last_m = 1e9;
  std::int64_t last_triangles = 0;
  for (const TilesetLevel& level : summary_.levels) {
    EXPECT_LT(level.geometric_error_m, last_m);
    EXPECT_GT(level.triangles, last_triangles);
    last_m = level.geometric_error_m;
    last_triangles = level.triangles;
    const tileset::LoadedTiles loaded = load(folder_ / "place", level.geometric_error_m);
    EXPECT_EQ(loaded.triangles, level.triangles);
    EXPECT_EQ(loaded.tiles_loaded, level.tiles);
    EXPECT_LE(simplification::hausdorff_distance_m(simplification::merge_meshes(loaded.meshes), finest),
              1.02 * level.geometric_error_m + 3e-3);
  }
  EXPECT_EQ(last_m, 0.0);
}

/// Number of triangles that use each edge, by the positions of its ends.
std::map<std::array<std::array<double, 3>, 2>, int> edge_uses(const geometry::TriangleMesh& mesh) {
  std::map<std::array<std::array<double, 3>, 2>, int> uses;
  const auto place = [&](std::uint32_t vertex) {
    const Vec3 v = (mesh.vertices[vertex] * 1000).array().round();
    return std::array<double, 3>{v.x(), v.y(), v.z()};
  };
  for (const geometry::Triangle& t : mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      std::array<std::array<double, 3>, 2> edge{place(t[k]), place(t[(k + 1) % 3])};
      if (edge[1] < edge[0]) std::swap(edge[0], edge[1]);
      ++uses[edge];
    }
  }
  return uses;
}

TEST_F(Tileset, NoLevelHasCracksBetweenTiles) {
  ASSERT_EQ(summary_.levels.size(), 3U);
  for (const TilesetLevel& level : summary_.levels) {
    const tileset::LoadedTiles loaded = load(folder_ / "place", level.geometric_error_m);
    const auto uses = edge_uses(simplification::merge_meshes(loaded.meshes));
    ASSERT_FALSE(uses.empty());
    for (const auto& [edge, count] : uses) {
      if (count == 2) continue;
      EXPECT_EQ(count, 1);  // only along the outline of the site
      const double half_mm = 1000 * kEdge_m * kSide / 2;
      const bool on_x = std::fabs(std::fabs(edge[0][0]) - half_mm) < 2 && std::fabs(edge[0][0] - edge[1][0]) < 2;
      const bool on_y = std::fabs(std::fabs(edge[0][1]) - half_mm) < 2 && std::fabs(edge[0][1] - edge[1][1]) < 2;
      EXPECT_TRUE(on_x || on_y) << edge[0][0] << " " << edge[0][1];
    }
  }
}

double plan_area_m2(const geometry::TriangleMesh& mesh, const geometry::Triangle& t) {
  const Vec3 ab = mesh.vertices[t[1]] - mesh.vertices[t[0]], ac = mesh.vertices[t[2]] - mesh.vertices[t[0]];
  return 0.5 * std::fabs(ab.x() * ac.y() - ab.y() * ac.x());
}

TEST_F(Tileset, TexturesKeepTheirPlaceAtEveryLevel) {
  ASSERT_EQ(summary_.levels.size(), 3U);
  for (const TilesetLevel& level : summary_.levels) {
    const tileset::LoadedTiles loaded = load(folder_ / "place", level.geometric_error_m);
    ASSERT_FALSE(loaded.meshes.empty());
    for (const TexturedMesh& mesh : loaded.meshes) {
      ASSERT_TRUE(mesh.texture);
      for (const geometry::Triangle& t : mesh.mesh.triangles) {
        const Vec3 middle = (mesh.mesh.vertices[t[0]] + mesh.mesh.vertices[t[1]] + mesh.mesh.vertices[t[2]]) / 3;
        if (plan_area_m2(mesh.mesh, t) < 0.01) continue;  // upright slivers along an edge belong to either side
        const Eigen::Vector2f uv = (mesh.uv[t[0]] + mesh.uv[t[1]] + mesh.uv[t[2]]) / 3;
        const imaging::Rgb8 color =
            (*mesh.texture)(static_cast<int>(uv.x() * static_cast<float>(mesh.texture->width)),
                            static_cast<int>(uv.y() * static_cast<float>(mesh.texture->height)));
        EXPECT_NEAR(color[0], 60 + 120 * (std::floor(middle.x() / kEdge_m) + kSide / 2.0) / kSide, 8);
        EXPECT_NEAR(color[1], 60 + 120 * (std::floor(middle.y() / kEdge_m) + kSide / 2.0) / kSide, 8);
      }
    }
  }
}

void check_tile(const json& tile, const json* parent) {
  if (parent != nullptr) {
    EXPECT_LE(tile["geometricError"].get<double>(), (*parent)["geometricError"].get<double>());
    const auto& inner = tile["boundingVolume"]["box"];
    const auto& outer = (*parent)["boundingVolume"]["box"];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double gap = std::fabs(inner[axis].get<double>() - outer[axis].get<double>());
      EXPECT_LE(gap + inner[3 + 4 * axis].get<double>(), outer[3 + 4 * axis].get<double>() + 1e-9);
    }
  }
  EXPECT_EQ(tile["geometricError"] == 0.0, !tile.contains("children"));
  for (const json& child : tile.value("children", json::array())) check_tile(child, &tile);
}

TEST_F(Tileset, TheTreeIsValid) {
  const json tileset = json::parse(base::read_text(folder_ / "place" / "tileset.json"));
  EXPECT_EQ(tileset["asset"]["version"], "1.1");
  EXPECT_EQ(tileset["root"]["refine"], "REPLACE");
  EXPECT_GE(tileset["geometricError"].get<double>(), tileset["root"]["geometricError"].get<double>());
  check_tile(tileset["root"], nullptr);
}

/// Returns the hash of each file below a folder, by its name there.
std::map<std::string, std::string> hashes_of(const std::filesystem::path& folder) {
  std::map<std::string, std::string> hashes;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    hashes[std::filesystem::relative(entry.path(), folder).string()] = base::sha256_hex_of_file(entry.path());
  }
  return hashes;
}

TEST_F(Tileset, BytesDoNotDependOnTheNumberOfThreads) {
  tbb::task_arena(1).execute([&] { write_tileset(folder_ / "serial", sheets_, place_options()); });
  const auto serial = hashes_of(folder_ / "serial");
  EXPECT_EQ(serial.size(), 1U + 1 + 4 + 16) << "the tree, and the tiles of three levels";

  // More threads than there may be cores; until two of them have written tiles, as a busy core may leave it to one.
  constexpr int kThreads = 8, kMaxRounds = 100;
  const tbb::global_control allowed(tbb::global_control::max_allowed_parallelism, kThreads);
  tbb::task_arena arena(kThreads);
  std::set<std::thread::id> writers;
  for (int round = 0; round < kMaxRounds && writers.size() < 2; ++round) {
    arena.execute([&] {
      write_tileset(folder_ / "parallel", sheets_, place_options(),
                    [&](std::int64_t done, std::int64_t, std::string_view) {
                      if (done > 0) writers.insert(std::this_thread::get_id());
                    });
    });
  }
  EXPECT_GE(writers.size(), 2U);
  EXPECT_EQ(hashes_of(folder_ / "parallel"), serial);
  EXPECT_EQ(hashes_of(folder_ / "place"), serial);
}

TEST(TilesetWriter, RefusesAnEmptyPlace) {
  const tests::TemporaryFolder folder;
  EXPECT_THAT([&] { write_tileset(folder / "x", {}, {}); },
              ThrowsMessage<InputError>(HasSubstr("there is no triangle to write")));
  EXPECT_THAT([&] { write_tileset(folder / "x", {TexturedMesh{}}, {}); },
              ThrowsMessage<InputError>(HasSubstr("there is no triangle to write")));
}

}  // namespace
}  // namespace tileflight::tile_writer::tileset_writer_test
