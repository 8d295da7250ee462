#include "tileflight/capture/preview/ground_view.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tests/tiny_place.h"
#include "tileflight/capture/preview/inspect_map.h"

namespace tileflight::preview::ground_view_test {
namespace {

using geometry::Box3;
using geometry::Vec3;
using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;
using tests::TinyPlace;

constexpr std::uintmax_t kPlenty = 1'000'000'000;

class GroundViewTest : public ::testing::Test {
 protected:
  void SetUp() override { TinyPlace::write(folder_.path()); }

  place::PlaceReader open() const {
    return {folder_.path().string(), {.allow_large_area = true}, fetch::Use::kAnalyse};
  }
  GroundView look(std::uintmax_t memory = kPlenty, double error_m = 0.0) const {
    place::PlaceReader place = open();
    const Box3 box = place.placement().region.box();
    return render_ground_view(place, fit_ground_grid(box, 200),
                              {.error_m = error_m, .top_down = {}, .max_memory_bytes = memory}, {});
  }

  tests::TemporaryFolder folder_;
};

TEST_F(GroundViewTest, HeightsAreThoseOfThePlace) {
  const GroundView view = look();
  EXPECT_EQ(view.tiles, 4);
  EXPECT_EQ(view.parts, 1);
  int seen = 0;
  for (int y = 0; y < view.grid.height; ++y) {
    for (int x = 0; x < view.grid.width; ++x) {
      const double east = view.grid.west_m + view.grid.pixel_m * (x + 0.5);
      const double north = view.grid.north_m - view.grid.pixel_m * (y + 0.5);
      const bool is_there = std::max(std::abs(east), std::abs(north)) < TinyPlace::kHalf;
      const float height_m = view.image.height_m(x, y);
      EXPECT_EQ(std::isfinite(height_m), is_there) << east << " " << north;
      if (!is_there) continue;
      ++seen;
      EXPECT_NEAR(height_m, TinyPlace::height(east, north), 0.25) << "the highest of the pixel, on facets of a metre";
    }
  }
  EXPECT_GT(seen, 30000);
}

TEST_F(GroundViewTest, CoarseTilesWhereTheyWillDo) {
  const GroundView view = look(kPlenty, 5.0);
  EXPECT_EQ(view.tiles, 1);
  EXPECT_NEAR(view.image.height_m(100, 100), TinyPlace::height(0, 0), 1.5);
}

TEST_F(GroundViewTest, LittleMemoryIsQuartersOfTheSamePicture) {
  const GroundView whole = look();
  // A quarter has 3200 triangles of some 200 bytes.
  const GroundView parts = look(900'000);
  EXPECT_GT(parts.parts, 3);
  EXPECT_FALSE(parts.is_coarser);
  std::size_t differ = 0;
  for (std::size_t i = 0; i < whole.image.rgb.pixels.size(); ++i)
    differ += whole.image.rgb.pixels[i] == parts.image.rgb.pixels[i] ? 0 : 1;
  EXPECT_LT(static_cast<double>(differ), 0.02 * static_cast<double>(whole.image.rgb.pixels.size()))
      << "all but where rounding tells which side of an edge is seen";
  const GroundView coarse = look(300'000);
  EXPECT_TRUE(coarse.is_coarser);
  EXPECT_THAT(ground_view_warnings(coarse), testing::ElementsAre(HasSubstr("coarser tiles")));
  EXPECT_NEAR(coarse.image.height_m(100, 100), TinyPlace::height(0, 0), 1.5);
  EXPECT_THAT([&] { look(1000); }, ThrowsMessage<tileset::MemoryLimitExceeded>(
                                       HasSubstr("a single tile takes more memory than is allowed")));
}

TEST_F(GroundViewTest, AMissingTileIsMarkedAndTold) {
  std::filesystem::remove(folder_ / "3.glb");  // the north-east
  const GroundView view = look();
  ASSERT_EQ(view.missing.size(), 1U);
  EXPECT_THAT(view.missing[0].failure, HasSubstr("3.glb"));
  const auto outlines = missing_outlines(view);
  ASSERT_EQ(outlines.size(), 1U);
  EXPECT_EQ(outlines[0].corners[0], geometry::Vec2(0, 0));
  EXPECT_EQ(outlines[0].corners[2], geometry::Vec2(40, 40));
  EXPECT_TRUE(std::isnan(view.image.height_m(150, 50)));
  EXPECT_THAT(ground_view_warnings(view), testing::ElementsAre(HasSubstr("3.glb")));
}

TEST_F(GroundViewTest, SurfaceBoundsAreTighterThanTheVolumes) {
  nlohmann::json tileset = TinyPlace::tileset();
  tileset["root"]["boundingVolume"]["box"] = {0, 0, 100, 500, 0, 0, 0, 500, 0, 0, 0, 400};
  TinyPlace::write_file(folder_ / "tileset.json", tileset.dump());
  place::PlaceReader place = open();
  for (const std::uintmax_t memory : {kPlenty, std::uintmax_t{700'000}}) {
    const Box3 box = surface_bounds(place, 0.0, memory, {});
    EXPECT_NEAR(box.min().x(), -40, 1e-4);
    EXPECT_NEAR(box.max().y(), 40, 1e-4);
    EXPECT_NEAR(box.min().z(), 97, 0.2);
    EXPECT_NEAR(box.max().z(), 103, 0.2);
  }
}

TEST(GroundGridTest, HoldsTheBoxWithSquarePixels) {
  for (const Vec3& size : {Vec3(100, 80, 5), Vec3(30, 300, 1), Vec3(0.2, 0.1, 9), Vec3(0, 0, 0)}) {
    const Box3 box(Vec3(7, -9, 0) - size / 2, Vec3(7, -9, 0) + size / 2);
    const render::GroundGrid grid = fit_ground_grid(box, 500);
    EXPECT_EQ(std::max(grid.width, grid.height), 500);
    EXPECT_GE(3 * std::min(grid.width, grid.height), 499);
    EXPECT_LE(grid.west_m, box.min().x());
    EXPECT_GE(grid.east_m(), box.max().x());
    EXPECT_LE(grid.south_m(), box.min().y());
    EXPECT_GE(grid.north_m, box.max().y());
    EXPECT_NEAR((grid.west_m + grid.east_m()) / 2, 7, 1e-9);
  }
}

TEST(ShortName, IsTheFolderOrTheFile) {
  EXPECT_EQ(place::source_display_name("/data/old town/tileset.json"), "old town");
  EXPECT_EQ(place::source_display_name("/data/old town/"), "old town");
  EXPECT_EQ(place::source_display_name("/data/old.3tz"), "old.3tz");
  EXPECT_EQ(place::source_display_name("https://example.org/place/tileset.json?key=secret"), "place");
  EXPECT_EQ(place::source_display_name("google"), "google");
}

TEST_F(GroundViewTest, TheMapSaysWhatItFound) {
  const std::filesystem::path picture = folder_ / "map.png";
  const nlohmann::json found =
      inspect_map({.source = folder_.path().string(), .load = {}, .error_m = {}, .longer_side_px = 200}, picture);
  EXPECT_TRUE(std::filesystem::file_size(picture) > 10000);
  EXPECT_NEAR(found["map"]["surface"]["max"][0].get<double>(), 40, 0.5);
  EXPECT_NEAR(found["map"]["surface"]["min"][2].get<double>(), 97, 0.3);
  EXPECT_EQ(found["proposal"]["voxel_size"], 0.5);
  EXPECT_EQ(found["attribution"][0], "Tiny Place, CC0");
  EXPECT_TRUE(found["frame"]["origin_lat"].is_null());
  EXPECT_FALSE(found["georeferenced"].get<bool>());
  EXPECT_THAT(inspect_map_text(found), HasSubstr("--center-local 0,0,100 --size 80,80,"));
}

TEST_F(GroundViewTest, RegionsThatHoldNothingAndOtherEndingsAreRefused) {
  InspectMapSettings settings{.source = folder_.path().string(), .load = {}, .error_m = {}, .longer_side_px = 200};
  const auto refusal = [&](const std::string& name) {
    return tests::refusal_of([&] { inspect_map(settings, folder_ / name); });
  };
  EXPECT_THAT(refusal("map.txt"), HasSubstr("(.png or .jpg expected)"));
  settings.load.center_local = Vec3(500, 0, NAN);
  settings.load.size = Vec3(50, 50, 0);
  EXPECT_THAT(refusal("map.png"), HasSubstr("there is no surface in the region"));
  settings.load = {};
  settings.longer_side_px = 5;
  EXPECT_THAT(refusal("map.png"), HasSubstr("--pixels"));
  settings.longer_side_px = 1000;
  settings.max_memory_bytes = 10'000'000;
  EXPECT_THAT(refusal("map.png"), AllOf(HasSubstr("a map of 1000 x 1000 pixels"), HasSubstr("--memory")));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "map.png"));
}

}  // namespace
}  // namespace tileflight::preview::ground_view_test
