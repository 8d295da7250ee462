#include "tileflight/core/drawing/place_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace tileflight::drawing::place_map_test {
namespace {

using geometry::Vec2;
using geometry::Vec3;
using imaging::Rgb8;

/// A plane that rises to the east, red, with a hole in its south-west quarter.
PlaceMap red_map(int width = 300, int height = 240) {
  PlaceMap map{.title = "A red place",
               .notes = {"one line"},
               .attribution = "nobody",
               .ground = {},
               .frame = {},
               .outlines = {},
               .flight = {}};
  map.ground.extent = {-150.0, -150.0 + width, -100.0, -100.0 + height};
  map.ground.colors = imaging::RgbImage(width, height, {200, 30, 30});
  map.ground.heights_m = imaging::FloatImage(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x)
      map.ground.heights_m(x, y) = x < width / 2 && y >= height / 2 ? std::nanf("") : 0.1F * static_cast<float>(x);
  }
  return map;
}

std::size_t count_of(const imaging::RgbImage& image, const Rgb8& color) {
  return static_cast<std::size_t>(std::ranges::count(image.pixels, color));
}

TEST(PlaceMap, ShowsTheGroundAndHatchesWhereThereIsNone) {
  const PlaceMap map = red_map();
  const imaging::RgbImage image = draw_to_image(map);
  const std::size_t ground = count_of(image, {200, 30, 30});
  EXPECT_LT(ground, 3U * 300 * 240 / 4);
  EXPECT_GT(ground, 3U * 300 * 240 / 4 * 6 / 10) << "but for the grid, the arrow and the bar";
  EXPECT_GT(count_of(image, {202, 204, 208}), 2000U) << "hatched";
  EXPECT_EQ(draw_to_image(map).pixels, image.pixels) << "the same bytes";
}

TEST(PlaceMap, FitsWideAndNarrowPlaces) {
  const imaging::RgbImage wide = draw_to_image(red_map(600, 200)), narrow = draw_to_image(red_map(200, 600));
  EXPECT_GT(wide.height, 400) << "heights below the picture";
  EXPECT_GT(narrow.width, 400) << "heights beside it";
  PlaceMap level = red_map(64, 64);
  for (float& height_m : level.ground.heights_m.pixels) height_m = 5.0F;
  EXPECT_GT(draw_to_image(level).width, 0);
  for (float& height_m : level.ground.heights_m.pixels) height_m = std::nanf("");
  EXPECT_GT(draw_to_image(level).width, 0);
}

TEST(PlaceMap, FlightsAndOutlinesAreDrawn) {
  PlaceMap map = red_map();
  const std::size_t before = count_of(draw_to_image(map), {200, 30, 30});
  map.frame.emplace(geometry::Geodetic{35.0, -80.0, {200.0}});
  map.outlines = {{MapOutline::Kind::kProposedRegion, {{-50, -50}, {50, -50}, {50, 50}, {-50, 50}}},
                  {MapOutline::Kind::kMissingTile, {{60, 0}, {90, 0}, {90, 30}, {60, 30}}}};
  FlightOverlay flight;
  for (int i = 0; i <= 20; ++i) {
    flight.positions.emplace_back(-100 + 10 * i, 60, 30);
    flight.headings.emplace_back(0, 1);
  }
  flight.colliding_frames = {5};
  flight.views = {{"first", {-100, 60, 30}, {{-120, 40}, {-80, 40}, {-80, 80}, {-120, 80}}},
                  {"last", {100, 60, 30}, {}}};
  map.flight = flight;
  const imaging::RgbImage image = draw_to_image(map);
  EXPECT_LT(count_of(image, {200, 30, 30}), before - 1000);
  EXPECT_GT(count_of(image, {204, 23, 28}), 20U) << "the frame that goes through something";
}

TEST(PlaceMap, HeightsGetLighterAsTheyGetHigher) {
  double before = -1;
  for (int i = 0; i <= 100; ++i) {
    const Rgb8 c = height_color(i / 100.0);
    const double light = 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
    EXPECT_GT(light, before);
    before = light;
  }
  EXPECT_EQ(height_color(-1), height_color(0));
  EXPECT_EQ(height_color(7), height_color(1));
}

TEST(PlaceMap, ShadeIsThatOfThePlanesNormal) {
  const Vec3 towards_light = Vec3(-1, 1, std::sqrt(2.0)).normalized();
  for (const auto& [east, north] : {std::pair(0.0, 0.0), {0.3, 0.0}, {0.0, -0.4}, {-0.2, 0.5}, {2.0, -2.0}}) {
    imaging::FloatImage plane(9, 7);
    for (int y = 0; y < 7; ++y) {
      for (int x = 0; x < 9; ++x) plane(x, y) = static_cast<float>(0.5 * (east * x - north * y));
    }
    const double wanted = std::max(0.0, Vec3(-east, -north, 1).normalized().dot(towards_light)) / towards_light.z();
    const imaging::FloatImage shade = hill_shade(plane, 0.5);
    ASSERT_EQ(shade.pixels.size(), plane.pixels.size());
    for (const float value : shade.pixels) EXPECT_NEAR(value, wanted, 1e-4);
  }
  imaging::FloatImage holes(3, 3, std::nanf(""));
  holes(1, 1) = 2.0F;
  EXPECT_NEAR(hill_shade(holes, 1.0)(1, 1), 1.0, 1e-6);
  EXPECT_TRUE(std::isnan(hill_shade(holes, 1.0)(0, 0)));
}

TEST(PlaceMap, DegreesAreWhereTheyAre) {
  const GroundExtent extent{-400, 500, -300, 350};
  for (const auto& [lat, lon] :
       {std::pair(35.31, -80.74), {-0.24, -78.52}, {69.0, 18.9}, {10.0, 179.9999}, {-33.0, -179.9995}}) {
    const geometry::LocalFrame frame({lat, lon, {100.0}});
    const auto meridians = degree_ticks(extent, frame, true, 4), parallels = degree_ticks(extent, frame, false, 4);
    ASSERT_GE(meridians.size(), 3U);
    ASSERT_GE(parallels.size(), 3U);
    for (const DegreeTick& tick : meridians) {
      const auto place = frame.geodetic_from_local({extent.west + tick.along_m, extent.north, 0});
      EXPECT_NEAR(std::remainder(place.longitude_deg - tick.degrees, 360.0), 0.0, 1e-9);
    }
    for (const DegreeTick& tick : parallels) {
      const auto place = frame.geodetic_from_local({extent.east, extent.south + tick.along_m, 0});
      EXPECT_NEAR(place.latitude_deg, tick.degrees, 1e-9);
    }
  }
  degree_ticks(extent, geometry::LocalFrame({90.0, 0.0, {0.0}}), true, 4);  // a pole: whatever there is, it ends
}

}  // namespace
}  // namespace tileflight::drawing::place_map_test
