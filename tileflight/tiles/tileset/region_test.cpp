#include "tileflight/tiles/tileset/region.h"

#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/tiles/fetch/test_tilesets.h"
#include "tileflight/tiles/tileset/load.h"
#include "tileflight/tiles/tileset/placement.h"
#include "tileflight/tiles/tileset/region_file.h"
#include "tileflight/tiles/tileset/selection.h"

namespace tileflight::tileset::region_test {
namespace {

using base::test_support::error_of;
using Eigen::Vector2d;
using fetch::test_support::Json;
using fetch::test_support::MemorySource;
using geometry::Box3;
using geometry::Geodetic;
using geometry::LocalFrame;
using geometry::PolygonArea;
using geometry::Prism;
using geometry::Ring;
using geometry::SE3;
using geometry::Vec3;
using ::testing::HasSubstr;

class Random {
 public:
  double in(double low, double high) { return std::uniform_real_distribution<double>(low, high)(engine_); }
  Vec3 vector(double reach) { return {in(-reach, reach), in(-reach, reach), in(-reach, reach)}; }

 private:
  std::mt19937 engine_{21};
};

Ring rectangle(double west, double south, double east, double north) {
  return {{west, south}, {east, south}, {east, north}, {west, north}};
}

/// An L and an island, one with a hole.
Region two_parts() {
  Region region{Vec3(10, 10, 5), Vec3(60, 40, 10)};
  region.parts.push_back({PolygonArea({{{-20, -10}, {10, -10}, {10, -4}, {-14, -4}, {-14, 20}, {-20, 20}}}), 0, 10});
  region.parts.push_back({PolygonArea({rectangle(20, 0, 40, 20), rectangle(24, 4, 36, 16)}), 2, 6});
  return region;
}

bool holds(const Region& region, const Vec3& point) {
  return std::any_of(region.parts.begin(), region.parts.end(), [&](const Prism& p) { return contains(p, point); });
}

/// No volume that contains a point of a polygon may be left out, and few without any may be selected.
TEST(Region, VolumesThatHoldAPointOfAPolygonMeetIt) {
  Random random;
  const Region region = two_parts();
  int met = 0;
  int met_and_sampled = 0;
  for (int i = 0; i < 1500; ++i) {
    const SE3 T_local_tileset(
        Eigen::Quaterniond(random.in(-1, 1), random.in(-1, 1), random.in(-1, 1), random.in(-1, 1)), random.vector(20));
    OrientedBox box{T_local_tileset.inverse() * Vec3(random.vector(30) + Vec3(10, 10, 5)), geometry::Mat3::Zero()};
    for (int k = 0; k < 3; ++k) box.half_axes.col(k) = random.vector(4);
    const BoundingSphere sphere{box.center, random.in(0, 6)};
    const bool box_met = intersects(box, T_local_tileset, region);
    const bool sphere_met = intersects(sphere, T_local_tileset, region);
    bool box_sampled = false;
    bool sphere_sampled = false;
    for (int k = 0; k < 200; ++k) {
      const Vec3 u = random.vector(1);
      box_sampled = box_sampled || holds(region, T_local_tileset * Vec3(box.center + box.half_axes * u));
      if (u.norm() <= 1)
        sphere_sampled = sphere_sampled || holds(region, T_local_tileset * Vec3(sphere.center + sphere.radius_m * u));
    }
    ASSERT_TRUE(!box_sampled || box_met) << i;
    ASSERT_TRUE(!sphere_sampled || sphere_met) << i;
    met += box_met ? 1 : 0;
    met_and_sampled += box_sampled ? 1 : 0;
  }
  EXPECT_GT(met_and_sampled, 55);
  EXPECT_LT(met, 2 * met_and_sampled);
}

/// A quadtree of 8 x 8 leaves of 10 m: only the leaves that intersect a polygon's edges or interior are selected.
TEST(Region, TheCutOfAPolygon) {
  Json root = fetch::test_support::tile({{"box", {40, 40, 5, 40, 0, 0, 0, 40, 0, 0, 0, 5}}}, 10);
  root["children"] = Json::array();
  for (int i = 0; i < 64; ++i) {
    const double x = 10 * (i % 8) + 5;
    const double y = 10 * (i / 8) + 5;
    root["children"].push_back({{"boundingVolume", {{"box", {x, y, 5, 4.9, 0, 0, 0, 4.9, 0, 0, 0, 5}}}},
                                {"geometricError", 0},
                                {"content", {{"uri", std::to_string(i) + ".glb"}}}});
  }
  MemorySource source(fetch::test_support::tileset(root));
  const auto cut_of = [&](const Region& region) {
    TilesetTree tree(source);
    std::vector<std::string> uris;
    for (const CutContent& content : select_cut(tree, region_criterion(region, SE3(), 0)).contents)
      uris.push_back(content.uri);
    return uris;
  };
  Region ring{Vec3(40, 40, 5), Vec3(80, 80, 10)};
  ring.parts.push_back({PolygonArea({rectangle(1, 1, 79, 79), rectangle(9.99, 9.99, 70.01, 70.01)}), 0, 10});
  EXPECT_EQ(cut_of(ring).size(), 28U);  // the outermost row all around
  Region corner{Vec3(40, 40, 5), Vec3(80, 80, 10)};
  corner.parts.push_back({PolygonArea({{{1, 1}, {18, 1}, {1, 18}}}), 0, 10});
  EXPECT_THAT(cut_of(corner), ::testing::ElementsAre("0.glb", "1.glb", "8.glb"));  // 9 begins beyond the slope
  Region above = corner;
  above.parts[0].bottom_m = 11;
  above.parts[0].top_m = 12;
  EXPECT_TRUE(cut_of(above).empty());

  TilesetTree tree(source);
  const RefinementCriterion both =
      union_criterion(region_criterion(corner, SE3(), 0), region_criterion(ring, SE3(), 100));
  EXPECT_EQ(select_cut(tree, both).contents.size(), 29U - 1U);  // the corner's three are among the ring's
}

/// Edges are straight in longitude and latitude: checked with points just inside and outside of them.
TEST(Region, APrismOfAMapSPolygon) {
  Random random;
  const GeographicArea area{{rectangle(24.5, 60.0, 25.5, 60.4), rectangle(24.9, 60.1, 25.1, 60.2)}, 20, std::nullopt};
  const LocalFrame frame({60.2, 25.0, {10}});
  const Prism prism = to_local_prism(area, frame, Box3(Vec3(-1e5, -1e5, -30), Vec3(1e5, 1e5, 900)));
  EXPECT_NEAR(prism.bottom_m, 10, 1e-6);
  EXPECT_EQ(prism.top_m, 900);
  for (int i = 0; i < 20000; ++i) {
    const double longitude = random.in(24.4, 25.6);
    const double latitude = random.in(59.95, 60.45);
    const auto in = [&](const Ring& r, double beyond) {
      return longitude > r[0].x() - beyond && longitude < r[2].x() + beyond && latitude > r[0].y() - beyond &&
             latitude < r[2].y() + beyond;
    };
    constexpr double kMillimetre_deg = 2e-8;
    const bool surely_in = in(area.rings[0], -kMillimetre_deg) && !in(area.rings[1], kMillimetre_deg);
    const bool surely_out = !in(area.rings[0], kMillimetre_deg) || in(area.rings[1], -kMillimetre_deg);
    const Vec3 local = frame.local_from_geodetic({latitude, longitude, {10}});
    const bool answer = prism.base.contains(local.head<2>());
    ASSERT_TRUE(!surely_in || answer) << longitude << " " << latitude;
    ASSERT_TRUE(!surely_out || !answer) << longitude << " " << latitude;
  }
}

class RegionFile : public ::testing::Test {
 protected:
  std::filesystem::path file(const Json& json, const std::string& name = "area.geojson") {
    base::write_file(folder_.path() / name, json.dump());
    return folder_.path() / name;
  }

  static Json polygon(const std::vector<Ring>& rings) {
    Json coordinates = Json::array();
    for (Ring ring : rings) {
      ring.push_back(ring.front());
      coordinates.push_back(Json::array());
      for (const Vector2d& p : ring) coordinates.back().push_back({p.x(), p.y()});
    }
    return {{"type", "Polygon"}, {"coordinates", coordinates}};
  }

  static Json feature(const Json& geometry, const Json& properties = Json::object()) {
    return {{"type", "Feature"}, {"geometry", geometry}, {"properties", properties}};
  }

  tests::TemporaryFolder folder_;
};

TEST_F(RegionFile, FeaturesWithHeightsOfTheirOwn) {
  const Json low = feature(polygon({rectangle(8, 47, 8.01, 47.01), rectangle(8.002, 47.002, 8.004, 47.004)}),
                           {{"min_height", 400}, {"max_height", 450}});
  const Json multi = {{"type", "MultiPolygon"},
                      {"coordinates",
                       {polygon({rectangle(8.02, 47, 8.03, 47.01)})["coordinates"],
                        polygon({rectangle(8.04, 47, 8.05, 47.01)})["coordinates"]}}};
  LoadOptions load;
  set_region_from_geojson({file({{"type", "FeatureCollection"},
                                 {"features", {low, feature(multi, {{"min_height", 420}, {"max_height", 700}})}}})},
                          load);
  ASSERT_EQ(load.areas.size(), 3U);
  EXPECT_EQ(load.areas[0].rings.size(), 2U);
  EXPECT_EQ(*load.areas[0].max_height_m, 450);
  EXPECT_EQ(*load.areas[2].min_height_m, 420);
  EXPECT_NEAR(load.center->height.m, 550, 1e-9);
  EXPECT_NEAR(load.size->z(), 300, 1e-9);
  EXPECT_NEAR(load.center->longitude_deg, 8.025, 1e-9);
  LoadOptions two_files;
  set_region_from_geojson({file(low, "a.geojson"), file(multi, "b.geojson")}, two_files);
  EXPECT_EQ(two_files.areas.size(), 3U);
  EXPECT_EQ(two_files.size->z(), 0);  // the second has no heights: the tileset's own
  EXPECT_TRUE(std::isnan(two_files.center->height.m));
}

TEST_F(RegionFile, AreasOnBothSidesOfTheAntimeridian) {
  const Json fiji = {{"type", "MultiPolygon"},
                     {"coordinates",
                      {polygon({rectangle(179.9, -17, 180, -16.9)})["coordinates"],
                       polygon({rectangle(-180, -17, -179.9, -16.9)})["coordinates"]}}};
  LoadOptions load;
  set_region_from_geojson({file(fiji)}, load);
  EXPECT_NEAR(load.center->longitude_deg, 180, 1e-9);
  EXPECT_LT(load.size->x(), 22000);
  EXPECT_THAT(base::test_support::error_of([&] {
                read_geojson_areas(file(polygon({{{179.9, -17}, {-179.9, -17}, {-179.9, -16}, {179.9, -16}}})));
              }),
              HasSubstr("crosses the antimeridian"));
}

TEST_F(RegionFile, FaultsAreNamed) {
  const auto fault = [&](const Json& json) {
    return base::test_support::error_of([&] { read_geojson_areas(file(json)); });
  };
  EXPECT_THAT(fault({{"type", "Point"}, {"coordinates", {1, 2}}}), HasSubstr("has no Polygon"));
  EXPECT_THAT(fault({{"type", "Polygon"}, {"coordinates", {{{0, 0}, {1, 0}, {1, 1}, {0, 1}}}}}),
              HasSubstr("not closed"));
  EXPECT_THAT(fault({{"type", "Polygon"}, {"coordinates", {{{0, 0}, {1, 0}, {0, 0}}}}}), HasSubstr("fewer than four"));
  EXPECT_THAT(fault({{"type", "Polygon"}, {"coordinates", {{{0, 0}, {1, 99}, {1, 1}, {0, 0}}}}}), HasSubstr("degrees"));
  EXPECT_THAT(fault({{"type", "Polygon"}, {"coordinates", {{{0, 85}, {90, 85}, {180, 85}, {-90, 85}, {0, 85}}}}}),
              HasSubstr("surrounds a pole"));
  EXPECT_THAT(
      fault({{"type", "Polygon"}, {"coordinates", {{{-180, 80}, {180, 80}, {180, 90}, {-180, 90}, {-180, 80}}}}}),
      HasSubstr("surrounds a pole"));
  EXPECT_THAT(
      fault({{"type", "Polygon"}, {"coordinates", {{{170, 10}, {-170, 10}, {-170, 11}, {170, 11}, {170, 10}}}}}),
      HasSubstr("crosses the antimeridian"));
  EXPECT_THAT(fault({{"type", "Polygon"}, {"coordinates", 3}}), HasSubstr("not usable GeoJSON"));
  EXPECT_THAT(fault(feature(polygon({rectangle(0, 0, 1, 1)}), {{"min_height", 5}, {"max_height", 5}})),
              HasSubstr("min_height is not below"));
  EXPECT_THAT(fault(feature(polygon({rectangle(0, 0, 1, 1)}), {{"min_height", "low"}})),
              HasSubstr("not usable GeoJSON"));
}

/// A tileset in a local frame cannot be cut by polygons unless its position is given.
TEST_F(RegionFile, TheRegionOfAPlaceThatIsNotOnTheEarth) {
  MemorySource source(
      fetch::test_support::tileset(fetch::test_support::tile({{"box", {0, 0, 5, 40, 0, 0, 0, 40, 0, 0, 0, 5}}}, 10)));
  TilesetTree tree(source);
  LoadOptions load;
  set_region_from_geojson({file(polygon({rectangle(8, 47, 8.0002, 47.0002)}))}, load);
  EXPECT_THAT(base::test_support::error_of([&] { resolve_placement(tree, load, "s"); }),
              HasSubstr("not georeferenced"));
  load.origin = Geodetic{47, 8, {300}};
  const Placement placed = resolve_placement(tree, load, "s");
  ASSERT_EQ(placed.region.parts.size(), 1U);
  EXPECT_NEAR(placed.region.parts[0].base.bounds().min().norm(), 0, 1e-3);
  EXPECT_NEAR(placed.region.box().max().y(), 22.24, 0.05);  // 0.0002 degrees of latitude
  EXPECT_NEAR(placed.region.box().max().z(), 10, 1e-9);     // the tileset's own heights
}

}  // namespace
}  // namespace tileflight::tileset::region_test
