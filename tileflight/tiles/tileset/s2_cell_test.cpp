#include "tileflight/tiles/tileset/s2_cell.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>

#include "tests/test_data.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/tiles/fetch/test_tilesets.h"
#include "tileflight/tiles/tileset/bounding_volume.h"
#include "tileflight/tiles/tileset/placement.h"
#include "tileflight/tiles/tileset/selection.h"

namespace tileflight::tileset::s2_cell_test {
namespace {

using base::test_support::error_of;
using fetch::test_support::Json;
using fetch::test_support::MemorySource;
using geometry::Box3;
using geometry::Geodetic;
using geometry::SE3;
using geometry::Vec3;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

Vec3 normal_at(double latitude_deg, double longitude_deg) {
  constexpr double kRad = std::numbers::pi / 180;
  return {std::cos(latitude_deg * kRad) * std::cos(longitude_deg * kRad),
          std::cos(latitude_deg * kRad) * std::sin(longitude_deg * kRad), std::sin(latitude_deg * kRad)};
}

/// The inverse: from a direction to its face and position there, 0 to 1 along each side.
struct FacePoint {
  std::uint32_t face;
  double s, t;
};

FacePoint face_point(const Vec3& n) {
  int axis = 0;
  n.cwiseAbs().maxCoeff(&axis);
  const auto face = static_cast<std::uint32_t>(n[axis] > 0 ? axis : axis + 3);
  // Rows: what u and v are on each face, by axis and sign.
  static constexpr std::array<std::array<int, 4>, 6> kUv = {
      {{1, 1, 2, 1}, {0, -1, 2, 1}, {0, -1, 1, -1}, {2, -1, 1, -1}, {2, -1, 0, 1}, {1, 1, 0, 1}}};
  const auto grid = [](double u) { return u >= 0 ? std::sqrt(1 + 3 * u) / 2 : 1 - std::sqrt(1 - 3 * u) / 2; };
  const double depth = std::abs(n[axis]);
  return {face, grid(kUv[face][1] * n[kUv[face][0]] / depth), grid(kUv[face][3] * n[kUv[face][2]] / depth)};
}

/// Position along a Hilbert curve that starts in the lower left corner and goes up first: the textbook's loop over
/// bits.
std::uint64_t hilbert(std::uint32_t level, std::uint32_t x, std::uint32_t y) {
  std::uint64_t out = 0;
  for (std::uint32_t side = level == 0 ? 0 : 1U << (level - 1); side > 0; side /= 2) {
    const std::uint32_t right = (x & side) != 0 ? 1 : 0;
    const std::uint32_t top = (y & side) != 0 ? 1 : 0;
    out = out * 4 + ((3 * right) ^ top);
    if (top == 0) {
      if (right == 1) {
        x = ~x;
        y = ~y;
      }
      std::swap(x, y);
    }
  }
  return out;
}

/// The id of the cell of a level that contains a direction. On odd faces the curve goes right first.
std::uint64_t id_at(const Vec3& normal, std::uint32_t level) {
  const FacePoint at = face_point(normal);
  const auto cells = static_cast<double>(1U << level);
  const auto x = static_cast<std::uint32_t>(std::min(at.s * cells, cells - 1));
  const auto y = static_cast<std::uint32_t>(std::min(at.t * cells, cells - 1));
  const std::uint64_t place = at.face % 2 == 0 ? hilbert(level, x, y) : hilbert(level, y, x);
  return std::uint64_t{at.face} << 61U | place << (61 - 2 * level) | std::uint64_t{1} << (60 - 2 * level);
}

bool holds(const S2Cell& cell, const Vec3& normal) {
  const FacePoint at = face_point(normal);
  const double size = std::ldexp(1.0, -static_cast<int>(cell.level));
  return at.face == cell.face && std::floor(at.s / size) == cell.i && std::floor(at.t / size) == cell.j;
}

class Random {
 public:
  double in(double low, double high) { return std::uniform_real_distribution<double>(low, high)(engine_); }
  Vec3 direction() { return Vec3(in(-1, 1), in(-1, 1), in(-1, 1)).normalized(); }

 private:
  std::mt19937 engine_{13};
};

TEST(S2Cell, IdsOfRandomPlacesComeBackAsTheCellAboutThem) {
  Random random;
  for (int i = 0; i < 5000; ++i) {
    const Vec3 normal = random.direction();
    const auto level = static_cast<std::uint32_t>(random.in(0, 31));
    const std::optional<S2Cell> cell = s2_cell_from_id(id_at(normal, level));
    ASSERT_TRUE(cell);
    EXPECT_EQ(cell->level, level);
    ASSERT_TRUE(holds(*cell, normal)) << i;
    EXPECT_TRUE(holds(*cell, s2_normal(*cell, random.in(0.01, 0.99), random.in(0.01, 0.99))));
  }
}

TEST(S2Cell, KnownCells) {
  // Ids and tokens of the extension's own text.
  for (const auto& [id, token] : {std::pair{3458764513820540928ULL, "3"},
                                  {3170534137668829184ULL, "2c"},
                                  {3386706919782612992ULL, "2f"},
                                  {3332663724254167040ULL, "2e4"}}) {
    const auto by_id = s2_cell_from_id(id);
    const auto by_token = s2_cell_from_token(token);
    ASSERT_TRUE(by_id && by_token);
    EXPECT_EQ(std::tuple(by_id->face, by_id->level, by_id->i, by_id->j),
              std::tuple(by_token->face, by_token->level, by_token->i, by_token->j));
  }
  EXPECT_TRUE(holds(*s2_cell_from_token("89c6c7"), normal_at(39.9526, -75.1652)));  // Philadelphia's City Hall
  const Vec3 flying_fish_cove = s2_normal(*s2_cell_from_token("2ef59bd352b93ac3"), 0.5, 0.5);  // Christmas Island
  EXPECT_LT((flying_fish_cove - normal_at(-10.490091033598308, 105.64131803774308)).norm(), 1e-8);
  EXPECT_TRUE(s2_cell_from_token("04"));
}

TEST(S2Cell, WhatIsNoCell) {
  for (const char* token : {"", "X", "0", "NOT_A_VALID_TOKEN", "c4", "d", "2", "00000000000000001", "2g"}) {
    EXPECT_FALSE(s2_cell_from_token(token)) << token;
  }
}

/// Points of random cells, found by sampling around them, lie inside the volume and touch all its sides.
TEST(S2Volume, HoldsEveryPointOfTheCellAndLittleMore) {
  Random random;
  for (int i = 0; i < 60; ++i) {
    const auto level = static_cast<std::uint32_t>(i % 20);
    const S2Volume volume{*s2_cell_from_id(id_at(random.direction(), level)), random.in(-500, 0), random.in(10, 9000)};
    const Vec3 middle = center_of(volume);
    const SE3 T_local_tileset = geometry::LocalFrame(geometry::geodetic_from_ecef(middle)).T_local_ecef();
    const Box3 bounds = local_bounding_box(volume, T_local_tileset);
    Box3 seen;
    for (int k = 0; k < 2000; ++k) {
      const Vec3 normal = s2_normal(volume.cell, random.in(0, 1), random.in(0, 1));
      const double latitude_deg = std::asin(normal.z()) * 180 / std::numbers::pi;
      const double longitude_deg = std::atan2(normal.y(), normal.x()) * 180 / std::numbers::pi;
      const double height_m = random.in(volume.min_height_m, volume.max_height_m);
      const Vec3 point = T_local_tileset * geometry::ecef_from_geodetic({latitude_deg, longitude_deg, {height_m}});
      ASSERT_TRUE(bounds.contains(point)) << "level " << level;
      if (k % 20 == 0) {
        ASSERT_TRUE(intersects(volume, T_local_tileset, Box3(point, point)));
      }
      seen.extend(point);
    }
    // The cell is turned in the local frame: the box about its box is at most 1 + sin 2a as wide as its own.
    EXPECT_LT((bounds.sizes() - seen.sizes()).cwiseQuotient(bounds.sizes()).maxCoeff(), level < 3 ? 0.8 : 0.55);
    const Vec3 beyond = T_local_tileset * (middle + middle.normalized() * (volume.max_height_m * 2 + 100));
    if (level > 5) {
      EXPECT_FALSE(intersects(volume, T_local_tileset, Box3(beyond, beyond))) << level;
    }
  }
}

TEST(S2Volume, MovesWithNoTransformAndIsOnTheEarth) {
  const S2Volume volume{*s2_cell_from_token("89c6c7"), 0, 1000};
  geometry::Mat4 T = geometry::Mat4::Identity();
  T(0, 3) = 1e6;
  EXPECT_EQ(center_of(transformed(T, volume)), center_of(volume));
  const Geodetic middle = geometry::geodetic_from_ecef(center_of(volume));
  EXPECT_NEAR(middle.height.m, 500, 1e-6);
  EXPECT_NEAR(middle.latitude_deg, 39.95, 0.05);
  EXPECT_NEAR(middle.longitude_deg, -75.16, 0.05);
}

/// Children of a cell have the same ids as in S2, and their heights.
TEST(S2Volume, ImplicitTilingDividesCellsAsS2Does) {
  for (const char* token : {"1", "3", "5", "b", "89c6c7", "2e4"}) {
    ImplicitTiling tiling;
    tiling.octree = true;
    tiling.root_volume = S2Volume{*s2_cell_from_token(token), -100, 300};
    const S2Cell root = std::get<S2Volume>(tiling.root_volume).cell;
    const TileCoordinates at{3, {5, 2, 7}};
    const auto child = std::get<S2Volume>(implicit_volume(tiling, at));
    EXPECT_EQ(child.cell.level, root.level + 3);
    EXPECT_TRUE(holds(child.cell, s2_normal(root, 5.5 / 8, 2.5 / 8)));
    EXPECT_DOUBLE_EQ(child.min_height_m, 250);
    EXPECT_DOUBLE_EQ(child.max_height_m, 300);
    tiling.octree = false;
    EXPECT_DOUBLE_EQ(std::get<S2Volume>(implicit_volume(tiling, {3, {5, 2, 0}})).min_height_m, -100);
  }
}

Json s2_volume(const std::string& token, double low_m = 0, double high_m = 1000) {
  return {{"extensions",
           {{"3DTILES_bounding_volume_S2", {{"token", token}, {"minimumHeight", low_m}, {"maximumHeight", high_m}}}}}};
}

/// Four children of a cell, of which a region in one corner meets one.
TEST(S2Volume, TilesetsOfCellsAreSelectedFrom) {
  Json children = Json::array();
  const S2Cell root = *s2_cell_from_token("89c6c7");
  for (int k = 0; k < 4; ++k) {
    const std::uint64_t id = id_at(s2_normal(root, k % 2 == 0 ? 0.25 : 0.75, k < 2 ? 0.25 : 0.75), root.level + 1);
    char token[17];
    std::snprintf(token, sizeof token, "%016llx", static_cast<unsigned long long>(id));
    children.push_back({{"boundingVolume", s2_volume(token)},
                        {"geometricError", 0},
                        {"content", {{"uri", "t" + std::to_string(k) + ".glb"}}}});
  }
  Json tile = fetch::test_support::tile(s2_volume("89c6c7"), 10);
  tile["children"] = children;
  Json json = fetch::test_support::tileset(tile);
  json["extensionsRequired"] = {"3DTILES_bounding_volume_S2"};
  MemorySource source(json);
  TilesetTree tree(source);
  EXPECT_TRUE(is_georeferenced(tree));
  EXPECT_TRUE(unsupported_extensions(tree.tileset(tree.root())).empty());
  const S2Volume lower_right{s2_descendant(root, 1, 1, 0), 0, 0};
  const geometry::LocalFrame frame(geometry::geodetic_from_ecef(center_of(lower_right)));
  const TileCut cut = select_cut(tree, region_criterion({Vec3::Zero(), Vec3(500, 500, 1e5)}, frame.T_local_ecef(), 0));
  ASSERT_EQ(cut.contents.size(), 1U);
  EXPECT_EQ(cut.contents[0].uri, "t1.glb");
}

TEST(S2Volume, FaultsAreNamed) {
  const auto fault = [](const Json& volume) {
    return base::test_support::error_of(
        [&] { parse_tileset_json(fetch::test_support::tileset(fetch::test_support::tile(volume, 1)).dump(), "t"); });
  };
  EXPECT_THAT(fault(s2_volume("NOT_A_VALID_TOKEN")), HasSubstr("token 'NOT_A_VALID_TOKEN' is not an S2 cell"));
  EXPECT_THAT(fault(s2_volume("89c6c7", 2, 1)), HasSubstr("minimum height lies above its maximum"));
  EXPECT_THAT(fault({{"extensions", {{"3DTILES_bounding_volume_S2", {{"token", "3"}}}}}}),
              HasSubstr("minimumHeight is missing"));
  Json volume = s2_volume("3");
  volume["box"] = {1, 2, 3};
  EXPECT_THAT(fault(volume), HasSubstr("box"));
  volume["box"] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
  EXPECT_EQ(fault(volume), "");
}

TEST(S2Volume, RealFiles) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "invalid/validator_specs/extensions/boundingVolumeS2");
  const auto read = [&](const char* name) {
    const std::vector<std::byte> bytes = base::read_bytes(folder / name);
    return parse_tileset_json({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, name);
  };
  const auto volume = std::get<S2Volume>(read("validTilesetWithS2.json").tiles[0].bounding_volume);
  EXPECT_EQ(std::pair(volume.cell.face, volume.cell.level), std::pair(0U, 0U));
  EXPECT_EQ(volume.max_height_m, 10000);
  EXPECT_THAT(base::test_support::error_of([&] { read("s2TokenInvalidValue.json"); }), HasSubstr("is not an S2 cell"));
  EXPECT_THAT(base::test_support::error_of([&] { read("s2AndInvalidBox.json"); }), HasSubstr("box"));
}

TEST(Cylinder, IsHeldByTheBoxOfTheSameNumbers) {
  const Json cylinder = {
      {"extensions", {{"3DTILES_bounding_volume_cylinder", {{"cylinder", {1, 2, 3, 4, 0, 0, 0, 4, 0, 0, 0, 5}}}}}}};
  const auto parsed = [](const Json& root) {
    return parse_tileset_json(fetch::test_support::tileset(root).dump(), "t").tiles[0];
  };
  const auto box = std::get<OrientedBox>(parsed(fetch::test_support::tile(cylinder, 1)).bounding_volume);
  EXPECT_EQ(box.center, Vec3(1, 2, 3));
  EXPECT_EQ(box.half_axes.diagonal(), Vec3(4, 4, 5));
  Json implicit = fetch::test_support::tile(cylinder, 1);
  implicit["implicitTiling"] = {{"subdivisionScheme", "OCTREE"},
                                {"subtreeLevels", 2},
                                {"availableLevels", 3},
                                {"subtrees", {{"uri", "{level}.subtree"}}}};
  EXPECT_EQ(parsed(implicit).unsupported, "implicit tiling of a cylinder");
}

}  // namespace
}  // namespace tileflight::tileset::s2_cell_test
