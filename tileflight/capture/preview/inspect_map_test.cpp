#include "tileflight/capture/preview/inspect_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

namespace tileflight::preview::propose_region_test {
namespace {

using geometry::Vec3;

struct Place {
  render::GroundGrid grid;
  imaging::FloatImage heights_m;

  Place(double pixel_m, int width, int height)
      : grid{-pixel_m * width / 2, pixel_m * height / 2, pixel_m, width, height},
        heights_m(width, height, std::nanf("")) {}

  /// Adds a surface of constant height in a rectangle of the ground.
  void add(double west, double south, double east, double north, float height_m) {
    for (int y = 0; y < grid.height; ++y) {
      for (int x = 0; x < grid.width; ++x) {
        const double e = grid.west_m + grid.pixel_m * (x + 0.5), n = grid.north_m - grid.pixel_m * (y + 0.5);
        if (e > west && e < east && n > south && n < north) heights_m(x, y) = height_m;
      }
    }
  }
  ProposedRegion proposed() const { return propose_region(grid, heights_m).value(); }
};

TEST(ProposeRegion, IsTheSurfacesOwnBoxWithAMargin) {
  Place place(1.0, 400, 300);
  place.add(-60, -40, 100, 80, 10.0F);
  place.add(-60, -40, 0, 80, 40.0F);
  const ProposedRegion p = place.proposed();
  EXPECT_NEAR(p.center.x(), 20, 1.01);
  EXPECT_NEAR(p.center.y(), 20, 1.01);
  EXPECT_NEAR(p.center.z(), 25, 0.51);
  EXPECT_NEAR(p.size.x(), 160, 2.01);
  EXPECT_NEAR(p.size.y(), 120, 2.01);
  EXPECT_GE(p.size.z(), 30 + 2 * 3);
  EXPECT_DOUBLE_EQ(p.voxel_m, 0.5);
  EXPECT_GT(p.surface_share, 0.98);
}

TEST(ProposeRegion, LeavesOutStrayPieces) {
  Place place(1.0, 1000, 1000);
  place.add(-100, -100, 100, 100, 5.0F);
  place.add(450, 450, 455, 455, 500.0F);
  const ProposedRegion p = place.proposed();
  EXPECT_NEAR(p.size.x(), 200, 3);
  EXPECT_NEAR(p.center.x(), 0, 2);
  EXPECT_LT(p.size.z(), 20) << "nor their heights";
}

TEST(ProposeRegion, OfACityIsWhereMostOfItIs) {
  Place place(4.0, 1000, 700);  // 4 km x 2.8 km
  place.add(-1990, -1390, 1990, 1390, 0.0F);
  ProposedRegion p = place.proposed();
  EXPECT_NEAR(p.size.x(), 500, 1);
  EXPECT_NEAR(p.size.y(), 500, 1);
  EXPECT_LT(p.center.head<2>().norm(), 60) << "all are as full: the one in the middle";
  EXPECT_DOUBLE_EQ(p.voxel_m, 1.0);

  Place holes(4.0, 1000, 700);
  for (int i = -19; i < 19; ++i) holes.add(100 * i, -1390, 100 * i + 20, 1390, 0.0F);  // strips
  holes.add(1000, 500, 1600, 1100, 0.0F);
  p = holes.proposed();
  EXPECT_NEAR(p.center.x(), 1300, 70);
  EXPECT_NEAR(p.center.y(), 800, 70);
}

TEST(ProposeRegion, OfAStatueIsFine) {
  Place place(0.02, 500, 500);
  place.add(-1.5, -1, 1.5, 1, 2.0F);
  place.add(-0.2, -0.2, 0.2, 0.2, 20.0F);
  const ProposedRegion p = place.proposed();
  EXPECT_DOUBLE_EQ(p.voxel_m, 0.1);
  EXPECT_NEAR(p.size.x(), 3, 0.21);
}

TEST(ProposeRegion, OfNothingIsNone) {
  const Place empty(1.0, 20, 20);
  EXPECT_FALSE(propose_region(empty.grid, empty.heights_m));
}

TEST(ProposeRegion, IsAskedForByOptions) {
  const ProposedRegion p{.center = {12.5, -3, 100}, .size = {250, 240.5, 60}, .voxel_m = 0.05, .surface_share = 1.0};
  EXPECT_EQ(to_cli_options(p, std::nullopt), "--center-local 12.5,-3,100 --size 250,240.5,60 --voxel 0.05");
  const geometry::LocalFrame frame({35.310344, -80.740007, {190.0}});
  EXPECT_EQ(
      to_cli_options({.center = Vec3::Zero(), .size = {250, 250, 60}, .voxel_m = 1.0, .surface_share = 1.0}, frame),
      "--center 35.310344,-80.740007,190 --size 250,250,60 --voxel 1");
  const nlohmann::json json = to_json(p, frame);
  const geometry::Geodetic there = frame.geodetic_from_local(p.center);
  EXPECT_NEAR(json["region"]["center_geodetic"]["lat"].get<double>(), there.latitude_deg, 1e-12);
  EXPECT_EQ(json["voxel_size"], 0.05);
  EXPECT_TRUE(to_json(p, std::nullopt)["region"]["center_geodetic"].is_null());
}

}  // namespace
}  // namespace tileflight::preview::propose_region_test
