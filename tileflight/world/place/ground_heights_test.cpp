#include "tileflight/world/place/ground_heights.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tests/tiny_place.h"
#include "tileflight/tiles/tileset/load.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::place::ground_heights_test {
namespace {

using geometry::Vec3;
using nlohmann::json;
using testing::HasSubstr;
using tests::refusal_of;
using tests::TinyPlace;

class GroundHeightsTest : public ::testing::Test {
 protected:
  void SetUp() override { TinyPlace::write(folder_.path()); }

  json ask(const std::vector<GroundQuery>& points, const std::optional<geometry::Geodetic>& origin = {}) const {
    tileset::LoadOptions load;
    load.origin = origin;
    return ground_heights({folder_.path().string(), load}, points);
  }

  tests::TemporaryFolder folder_;
};

TEST_F(GroundHeightsTest, AreThoseThatRaysMeetInTheFinestTiles) {
  tileset::LoadedTiles loaded = tileset::load_region(folder_.path().string(), {});
  const scene::Scene scene(std::move(loaded.meshes));
  std::vector<GroundQuery> points;
  for (const auto& [x, y] : {std::pair(0.31, 0.27), {-17.3, 22.9}, {39.99, -39.99}, {5.0, 5.0}, {-0.001, 12.5}})
    points.push_back(parse_local_query(std::to_string(x) + "," + std::to_string(y)));
  const json found = ask(points);
  ASSERT_EQ(found["points"].size(), points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3 above(points[i].local->x(), points[i].local->y(), 500.0);
    const auto hit = scene.intersect({above, -Vec3::UnitZ()});
    ASSERT_TRUE(hit);
    EXPECT_NEAR(found["points"][i]["highest"]["local_z"].get<double>(), 500.0 - hit->distance_m, 1e-4);
    EXPECT_EQ(found["points"][i]["surfaces"].size(), 1U);
    EXPECT_TRUE(found["points"][i]["highest"]["height"].is_null()) << "it is not on the earth";
  }
}

TEST_F(GroundHeightsTest, ReadOnlyTheTilesThatTheLineGoesThrough) {
  std::filesystem::remove(folder_ / "root.glb");
  for (const char* other : {"0.glb", "1.glb", "2.glb"}) TinyPlace::write_file(folder_ / other, "broken");
  const json found = ask({parse_local_query("20,20")});
  EXPECT_EQ(found["tiles"], 1);
  EXPECT_NEAR(found["points"][0]["highest"]["local_z"].get<double>(), TinyPlace::height(20, 20), 1e-3);
  EXPECT_THAT(refusal_of([&] { ask({parse_local_query("-20,20")}); }), HasSubstr("2.glb"));
}

/// Marks what was found as perhaps not all.
TEST_F(GroundHeightsTest, ContinueWithoutMissingTilesIfThatIsAllowed) {
  std::filesystem::remove(folder_ / "2.glb");
  EXPECT_THAT(refusal_of([&] { ask({parse_local_query("-20,20")}); }), HasSubstr("--allow-incomplete"));
  tileset::LoadOptions load;
  load.allow_incomplete = true;
  const json found = ground_heights({folder_.path().string(), load}, {parse_local_query("-20,20")});
  EXPECT_EQ(found["points"][0]["tiles_missing"], 1);
  EXPECT_THAT(found["warnings"].dump(), HasSubstr("2.glb"));
  EXPECT_THAT(ground_heights_text(found), HasSubstr("no surface in the tiles that could be read"));
  const json whole = ground_heights({folder_.path().string(), load}, {parse_local_query("20,20")});
  EXPECT_EQ(whole["points"][0]["tiles_missing"], 0);
}

TEST_F(GroundHeightsTest, BesideThePlaceThereIsNoSurface) {
  const json found = ask({parse_local_query("41,0"), parse_local_query("-1e6,3")});
  ASSERT_EQ(found["points"].size(), 2U);
  for (const json& point : found["points"]) {
    EXPECT_TRUE(point["highest"].is_null());
    EXPECT_TRUE(point["lowest"].is_null());
    EXPECT_TRUE(point["surfaces"].empty());
  }
  EXPECT_EQ(found["tiles"], 0);
  EXPECT_THAT(ground_heights_text(found), HasSubstr("41,0: no surface\n"));
}

TEST_F(GroundHeightsTest, ByLatitudeAndLongitudeOnceItsZeroIsOnEarth) {
  const geometry::Geodetic origin{-0.24, -78.52, {2800.0}};
  const geometry::LocalFrame frame(origin);
  const Vec3 local(12.0, -7.0, TinyPlace::height(12, -7));
  const geometry::Geodetic place = frame.geodetic_from_local(local);
  GroundQuery query;
  query.geodetic = place;
  const json point = ask({query}, origin)["points"][0];
  EXPECT_NEAR(point["highest"]["height"].get<double>(), place.height.m, 2e-3);
  EXPECT_NEAR(point["highest"]["local_z"].get<double>(), local.z(), 2e-3);
  EXPECT_NEAR(point["local"][0].get<double>(), 12.0, 1e-3);
  EXPECT_NEAR(point["local"][1].get<double>(), -7.0, 1e-3);
  EXPECT_NEAR(point["highest"]["height_above_sea_level"].get<double>(), geometry::orthometric_from_ellipsoidal(place).m,
              2e-3);
  EXPECT_NEAR(point["lat"].get<double>(), place.latitude_deg, 1e-12);
  EXPECT_THAT(refusal_of([&] { ask({query}); }), HasSubstr("is not georeferenced: use --at-local"));
}

TEST_F(GroundHeightsTest, WhatIsNoPlaceIsRefused) {
  for (const char* text : {"", "12", "12,", "a,b", "1,2,3", "12;13", "nan,1", "1,inf", "91,0", "0,361"})
    EXPECT_THAT(refusal_of([&] { parse_geodetic_query(text); }), HasSubstr("--at " + std::string(text))) << text;
  EXPECT_EQ(parse_geodetic_query("-0.24,-78.52").geodetic->longitude_deg, -78.52);
  EXPECT_EQ(parse_local_query(" 1e3, -2").local->y(), -2.0);
}

}  // namespace
}  // namespace tileflight::place::ground_heights_test
