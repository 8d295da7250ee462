#include "tileflight/tiles/tile_content/pnts.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "tests/test_data.h"
#include "tileflight/tiles/fetch/test_tilesets.h"
#include "tileflight/tiles/tile_content/tile_table.h"
#include "tileflight/tiles/tileset/load.h"

namespace tileflight::tileset::pnts_test {
namespace {

using base::test_support::error_of;
using base::test_support::to_raw_bytes;
using fetch::test_support::Json;
using geometry::PointCloud;
using geometry::Vec3;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Color = std::array<std::uint8_t, 3>;

PointCloud read(const Json& table, const std::string& binary, const tile_content::ContentOptions& options = {}) {
  const tile_content::DecodedContent content = tile_content::decode_content(
      base::test_support::to_bytes(fetch::test_support::container("pnts", {table, binary})), "p", options);
  EXPECT_TRUE(content.meshes.empty());
  return content.clouds.at(0);
}

TEST(Pnts, FloatsWithColoursNormalsAndIds) {
  const std::string positions = base::test_support::to_raw_bytes<float>({1, 2, 3, 4, 5, 6});
  const std::string colors = base::test_support::to_raw_bytes<std::uint8_t>({255, 0, 1, 2, 3, 4});
  const std::string normals = base::test_support::to_raw_bytes<float>({0, 0, 1, 0, 1, 0});
  const std::string ids = base::test_support::to_raw_bytes<std::uint8_t>({7, 200});
  const PointCloud cloud = read({{"POINTS_LENGTH", 2},
                                 {"POSITION", {{"byteOffset", 0}}},
                                 {"RGB", {{"byteOffset", 24}}},
                                 {"NORMAL", {{"byteOffset", 32}}},
                                 {"BATCH_ID", {{"byteOffset", 56}, {"componentType", "UNSIGNED_BYTE"}}},
                                 {"RTC_CENTER", {10, 20, 30}}},
                                positions + colors + "  " + normals + ids);
  EXPECT_THAT(cloud.positions, ElementsAre(Vec3(11, 22, 33), Vec3(14, 25, 36)));
  EXPECT_THAT(cloud.colors, ElementsAre(Color{255, 0, 1}, Color{2, 3, 4}));
  EXPECT_EQ(cloud.normals[1], Eigen::Vector3f(0, 1, 0));
  EXPECT_THAT(cloud.scalars.at(tile_content::kFeatureIdScalar), ElementsAre(7, 200));
}

/// A tile of 0 points needs no positions; it is empty, not broken.
TEST(Pnts, NoPoints) {
  for (const Json& table :
       {Json{{"POINTS_LENGTH", 0}}, Json{{"POINTS_LENGTH", 0}, {"POSITION", {{"byteOffset", 0}}}}}) {
    const tile_content::DecodedContent content = tile_content::decode_content(
        base::test_support::to_bytes(fetch::test_support::container("pnts", {table, ""})), "p");
    EXPECT_TRUE(content.clouds.empty());
    EXPECT_TRUE(content.meshes.empty());
  }
}

TEST(Pnts, QuantisedWith565AndOctahedralNormals) {
  const std::string positions = base::test_support::to_raw_bytes<std::uint16_t>({0, 65535, 13107, 65535, 0, 0});
  const std::string colors =
      base::test_support::to_raw_bytes<std::uint16_t>({0xF800, 0x07E1});  // red; green and a little blue
  const std::string normals = base::test_support::to_raw_bytes<std::uint8_t>({128, 128, 255, 128});
  const PointCloud cloud = read({{"POINTS_LENGTH", 2},
                                 {"POSITION_QUANTIZED", {{"byteOffset", 0}}},
                                 {"QUANTIZED_VOLUME_OFFSET", {100, 0, -1}},
                                 {"QUANTIZED_VOLUME_SCALE", {10, 20, 5}},
                                 {"RGB565", {{"byteOffset", 12}}},
                                 {"NORMAL_OCT16P", {{"byteOffset", 16}}}},
                                positions + colors + normals);
  EXPECT_LT((cloud.positions[0] - Vec3(100, 20, 0)).norm(), 1e-9);
  EXPECT_LT((cloud.positions[1] - Vec3(110, 0, -1)).norm(), 1e-9);
  EXPECT_THAT(cloud.colors, ElementsAre(Color{255, 0, 0}, Color{0, 255, 8}));
  EXPECT_LT((cloud.normals[0] - Eigen::Vector3f(0, 0, 1)).norm(), 0.02F);
  EXPECT_LT((cloud.normals[1] - Eigen::Vector3f(1, 0, 0)).norm(), 0.02F);
}

TEST(Pnts, OneColourForAllAndPositionsInTheJson) {
  const PointCloud cloud =
      read({{"POINTS_LENGTH", 2}, {"POSITION", {0, 0, 0, 1, 1, 1}}, {"CONSTANT_RGBA", {9, 8, 7, 6}}}, "");
  EXPECT_THAT(cloud.colors, ElementsAre(Color{9, 8, 7}, Color{9, 8, 7}));
}

/// Encoding is the inverse: the octahedron's folded lower half included.
TEST(Octahedral, RoundTrip) {
  for (double z = -0.99; z < 1; z += 0.11) {
    for (double angle = 0.05; angle < 6.28; angle += 0.31) {
      const double r = std::sqrt(1 - z * z);
      const Vec3 n(r * std::cos(angle), r * std::sin(angle), z);
      Vec3 p = n / n.cwiseAbs().sum();
      if (p.z() < 0) {
        p = Vec3((1 - std::abs(p.y())) * (p.x() < 0 ? -1 : 1), (1 - std::abs(p.x())) * (p.y() < 0 ? -1 : 1), 0);
      }
      const double u = std::round((p.x() + 1) / 2 * 65535);
      const double v = std::round((p.y() + 1) / 2 * 65535);
      EXPECT_LT((tile_content::decode_octahedral(u, v, 65535) - n).norm(), 1e-4);
    }
  }
}

TEST(Pnts, FaultsAreNamed) {
  const auto message = [](const Json& table, const std::string& binary,
                          const tile_content::ContentOptions& options = {}) {
    return base::test_support::error_of([&] { read(table, binary, options); });
  };
  const std::string two = base::test_support::to_raw_bytes<float>({0, 0, 0, 1, 1, 1});
  EXPECT_THAT(message(Json::object(), two), HasSubstr("POINTS_LENGTH is missing"));
  EXPECT_THAT(message({{"POINTS_LENGTH", 2}}, two), HasSubstr("no POSITION and no POSITION_QUANTIZED"));
  EXPECT_THAT(message({{"POINTS_LENGTH", 3}, {"POSITION", {{"byteOffset", 0}}}}, two), HasSubstr("POSITION: lies"));
  EXPECT_THAT(message({{"POINTS_LENGTH", 4000000000U}, {"POSITION", {{"byteOffset", 0}}}}, two), HasSubstr("points"));
  EXPECT_THAT(message({{"POINTS_LENGTH", 2}, {"POSITION", {{"byteOffset", 0}}}},
                      base::test_support::to_raw_bytes<float>({0, 0, 0, 0, NAN, 0})),
              HasSubstr("not finite"));
  tile_content::ContentOptions few;
  few.limits.max_points = 1;
  EXPECT_THAT(message({{"POINTS_LENGTH", 2}, {"POSITION", {{"byteOffset", 0}}}}, two, few), HasSubstr("the limit"));
  const std::string whole =
      fetch::test_support::container("pnts", {{{"POINTS_LENGTH", 2}, {"POSITION", {{"byteOffset", 0}}}}, two});
  for (std::size_t length = 0; length < whole.size(); ++length) {
    EXPECT_NE(base::test_support::error_of(
                  [&] { tile_content::decode_content(base::test_support::to_bytes(whole.substr(0, length)), "p"); }),
              "")
        << length;
  }
}

/// Cesium's point clouds: a thousand points in a ball of 5 m around one location, in all encodings.
TEST(Pnts, RealPointCloudsStandInOnePlace) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/cesiumjs_specs_data/PointCloud");
  int read = 0;
  for (const char* name :
       {"PointCloudRGB", "PointCloudRGBA", "PointCloudRGB565", "PointCloudNoColor", "PointCloudConstantColor",
        "PointCloudNormals", "PointCloudNormalsOctEncoded", "PointCloudQuantized", "PointCloudQuantizedOctEncoded",
        "PointCloudDraco", "PointCloudDracoPartial", "PointCloudDracoBatched", "PointCloudBatched", "PointCloudWGS84",
        "PointCloudWithTransform", "PointCloudWithPerPointProperties"}) {
    SCOPED_TRACE(name);
    const LoadedTiles tiles = load_region((folder / name / "tileset.json").string(), {});
    EXPECT_TRUE(tiles.complete);
    ASSERT_EQ(tiles.clouds.size(), 1U);
    EXPECT_EQ(tiles.triangles, 0);
    EXPECT_EQ(tiles.points, static_cast<std::int64_t>(tiles.clouds[0].size()));
    EXPECT_GE(tiles.points, 500);
    const geometry::Box3 region(tiles.region.box().min() - Vec3::Constant(1),
                                tiles.region.box().max() + Vec3::Constant(1));
    std::size_t inside = 0;
    for (const Vec3& point : tiles.clouds[0].positions) inside += region.contains(point) ? 1 : 0;
    EXPECT_EQ(inside, tiles.clouds[0].size());
    for (const Eigen::Vector3f& normal : tiles.clouds[0].normals) EXPECT_NEAR(normal.norm(), 1, 0.02);
    ++read;
  }
  EXPECT_EQ(read, 16);
}

/// The same cloud in two encodings: Draco and uncompressed, quantised and not.
TEST(Pnts, CompressedFormsGiveTheSamePoints) {
  TILEFLIGHT_REQUIRE_TEST_DATA(folder, "tilesets/cesiumjs_specs_data/PointCloud");
  const auto cloud = [&](const char* name) {
    return load_region((folder / name / "tileset.json").string(), {}).clouds.at(0);
  };
  const auto middle = [](const PointCloud& c) {
    Vec3 sum = Vec3::Zero();
    for (const Vec3& p : c.positions) sum += p;
    return Vec3(sum / static_cast<double>(c.size()));
  };
  const PointCloud plain = cloud("PointCloudRGB");
  for (const char* name : {"PointCloudQuantized", "PointCloudRGB565", "PointCloudDraco"}) {
    const PointCloud other = cloud(name);
    EXPECT_LT((middle(other) - middle(plain)).norm(), 0.5) << name;
    EXPECT_EQ(other.colors.size(), other.size()) << name;
  }
}

}  // namespace
}  // namespace tileflight::tileset::pnts_test
