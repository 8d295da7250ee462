#include "tileflight/capture/render/orthophoto.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>

#include "tests/refusal.h"
#include "tileflight/capture/render/camera_renderer.h"
#include "tileflight/capture/render/daylight.h"
#include "tileflight/capture/render/linear_color.h"
#include "tileflight/capture/render/test_scenes.h"

namespace tileflight::render::orthophoto_test {
namespace {

using geometry::Vec3;
using scene::Scene;
using test_scenes::grey;
using test_scenes::ground;
using test_scenes::hills;
using test_scenes::noise;
using test_scenes::texture;

const Vec3 kMiddle(4120.0, -980.0, 2880.0);  // far from the origin, as real places are

GroundGrid grid_about(const Vec3& middle, double pixel_m, int pixels) {
  return {middle.x() - pixel_m * pixels / 2, middle.y() + pixel_m * pixels / 2, pixel_m, pixels, pixels};
}

TEST(Orthophoto, GivesAMapsOwnPixelsBack) {
  const auto map = texture(32, 32, [](int x, int y) {
    return imaging::Rgb8{static_cast<std::uint8_t>(noise(x, y)), static_cast<std::uint8_t>(8 * x), 40};
  });
  const Scene scene({ground(kMiddle, 16.0, map)});
  const Orthophoto seen = render_orthophoto(scene, grid_about(kMiddle, 0.5, 32), {.samples_along_axis = 1});
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 32; ++x) {
      for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(seen.rgb(x, y)[c], (*map)(x, y)[c], 3) << x << " " << y;
      EXPECT_NEAR(seen.height_m(x, y), kMiddle.z(), 1e-3);
    }
  }
}

TEST(Orthophoto, MeansAreOfLinearLight) {
  const auto board = texture(64, 64, [](int x, int y) { return grey((x + y) % 2 == 0 ? 255 : 0); });
  const Scene scene({ground(kMiddle, 64.0, board)});
  const Orthophoto seen = render_orthophoto(scene, grid_about(kMiddle, 8.0, 8));
  for (int y = 1; y < 7; ++y) {
    for (int x = 1; x < 7; ++x) EXPECT_NEAR(seen.rgb(x, y)[1], srgb_encode(0.5), 4);
  }
}

TEST(Orthophoto, PartlyTransparentSurfacesShowWhatLiesBelow) {
  const Vec3 up = Vec3::UnitZ();
  const imaging::TexturedMesh high = test_scenes::pane(kMiddle + 4 * up, 16.0, {0.9F, 0.9F, 0.9F, 0.25F}),
                              low = test_scenes::pane(kMiddle + 2 * up, 16.0, {0.1F, 0.1F, 0.1F, 0.5F});
  const auto paint = texture(1, 1, [](int, int) { return grey(200); });
  const GroundGrid grid = grid_about(kMiddle, 1.0, 8);
  const auto middle = [&](std::vector<imaging::TexturedMesh> meshes) {
    const Orthophoto seen = render_orthophoto(Scene(std::move(meshes)), grid, {});
    EXPECT_NEAR(seen.height_m(4, 4), kMiddle.z() + 4, 1e-3);
    return srgb_decode(seen.rgb(4, 4)[1]);
  };
  const double above = middle({high});
  const double floor = srgb_decode(200);
  // Shaded panes: their own light is that of a pane alone, by its linear colour.
  EXPECT_NEAR(middle({high, low, ground(kMiddle, 16.0, paint)}), 0.25 * above + 0.75 * (0.5 * above / 9 + 0.5 * floor),
              0.01);
}

/// The light depends on the surface's direction alone: albedo (sky(n) + sun max(0, n . s)), as in frames.
TEST(Orthophoto, PlacesWithoutTexturesAreLitAsFramesAre) {
  const auto light = make_daylight(relief_light(), std::nullopt);
  const GroundGrid grid = grid_about(kMiddle, 1.0, 20);
  for (const double slope : {-0.8, 0.0, 0.8}) {
    imaging::TexturedMesh roof = test_scenes::colored_ground(kMiddle, 40.0, {0.8F, 0.8F, 0.8F, 1.0F});
    for (Vec3& v : roof.mesh.vertices) v.z() += slope * (v.x() - kMiddle.x());
    const Scene scene({roof});
    const imaging::Rgb8 seen = render_orthophoto(scene, grid, {.daylight = light}).rgb(10, 10);
    const CameraRenderer camera(scene, imaging::make_pinhole(9, 9, 1.0), {.daylight = light});
    const imaging::Rgb8 frame = camera.render(test_scenes::looking_down(kMiddle + 40 * Vec3::UnitZ())).rgb(4, 4);
    const Vec3 n = Vec3(-slope, 0, 1).normalized();
    const std::array<float, 3>& s = light->toward_sun();
    const LinearRgb sky = light->diffuse({static_cast<float>(n.x()), 0.0F, static_cast<float>(n.z())});
    for (std::size_t c = 0; c < 3; ++c) {
      const double sun = std::max(0.0, n.x() * s[0] + n.z() * s[2]) * light->sunlight()[c];
      EXPECT_NEAR(seen[c], srgb_encode(0.8 * (sky[c] + sun)), 1.0) << slope;
      EXPECT_NEAR(frame[c], seen[c], 1.0) << slope;
    }
  }
}

TEST(Orthophoto, HeightsAreTheHighestOfThePixelsRays) {
  const auto paint = texture(1, 1, [](int, int) { return grey(90); });
  imaging::TexturedMesh plane = ground(kMiddle, 40.0, paint);
  for (Vec3& v : plane.mesh.vertices) v.z() += 0.5 * (v.x() - kMiddle.x()) - 0.25 * (v.y() - kMiddle.y());
  const GroundGrid grid = grid_about(kMiddle, 1.0, 20);
  const Orthophoto seen = render_orthophoto(Scene({plane}), grid, {.samples_along_axis = 2});
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 20; ++x) {
      const double east = x - 10 + 0.75, north = 10 - (y + 0.75);  // of the pixel's ray that is highest
      EXPECT_NEAR(seen.height_m(x, y), kMiddle.z() + 0.5 * east - 0.25 * north, 1e-3);
    }
  }
}

TEST(Orthophoto, ThereIsNothingWhereThereIsNoSurface) {
  const auto paint = texture(1, 1, [](int, int) { return grey(90); });
  const Orthophoto seen = render_orthophoto(Scene({ground(kMiddle, 10.0, paint)}), grid_about(kMiddle, 1.0, 20));
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 20; ++x) {
      const bool is_there = x >= 5 && x < 15 && y >= 5 && y < 15;
      EXPECT_EQ(std::isfinite(seen.height_m(x, y)), is_there) << x << " " << y;
    }
  }
}

TEST(Orthophoto, WhatIsAboveTheTopIsLeftOut) {
  const auto paint = texture(1, 1, [](int, int) { return grey(90); });
  const Scene house({ground(kMiddle, 10.0, paint), ground(kMiddle + Vec3(0, 0, 3), 10.0, paint)});
  const GroundGrid grid = grid_about(kMiddle, 1.0, 4);
  EXPECT_NEAR(render_orthophoto(house, grid).height_m(2, 2), kMiddle.z() + 3, 1e-3);
  EXPECT_NEAR(render_orthophoto(house, grid, {.top_m = kMiddle.z() + 2}).height_m(2, 2), kMiddle.z(), 1e-3);
  const OrthophotoOptions between{.top_m = kMiddle.z() + 2, .bottom_m = kMiddle.z() + 1};
  EXPECT_TRUE(std::isnan(render_orthophoto(house, grid, between).height_m(2, 2)));
  EXPECT_TRUE(std::isnan(render_orthophoto(house, grid, {.top_m = kMiddle.z() - 9}).height_m(2, 2)));
}

TEST(Orthophoto, BareSurfacesAreLitFromTheNorthWest) {
  const auto lit = [](double east, double north, bool turned) {
    imaging::TexturedMesh slope = ground(kMiddle, 20.0, nullptr);
    slope.uv.clear();
    for (Vec3& v : slope.mesh.vertices) v.z() += east * (v.x() - kMiddle.x()) + north * (v.y() - kMiddle.y());
    if (turned) std::swap(slope.mesh.triangles[0][1], slope.mesh.triangles[0][2]);
    return int{render_orthophoto(Scene({slope}), grid_about(kMiddle, 1.0, 2)).rgb(1, 1)[0]};
  };
  EXPECT_GT(lit(0.5, -0.5, false), lit(0, 0, false) + 10);  // falls to the north-west
  EXPECT_LT(lit(-0.5, 0.5, false), lit(0, 0, false) - 10);
  EXPECT_EQ(lit(0.3, 0.1, true), lit(0.3, 0.1, false)) << "whatever the winding";
}

TEST(Orthophoto, PartsAreThoseOfTheWholeWhateverTheThreads) {
  const auto noisy = texture(128, 128, [](int x, int y) { return grey(noise(x, y)); });
  const Scene scene({hills(kMiddle, 60.0, 40, noisy)});
  const GroundGrid grid = grid_about(kMiddle, 0.75, 96);
  const Orthophoto whole = render_orthophoto(scene, grid);
  {
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    EXPECT_EQ(render_orthophoto(scene, grid).rgb.pixels, whole.rgb.pixels);
  }
  const Orthophoto part = render_orthophoto(scene, grid.crop(31, 17, 20, 40));
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 20; ++x) EXPECT_NEAR(part.rgb(x, y)[0], whole.rgb(x + 31, y + 17)[0], 1);
  }
}

TEST(Orthophoto, PointsLieWhereTheyAreAndTheHighestIsSeen) {
  Orthophoto image(20, 20);
  const GroundGrid grid = grid_about(kMiddle, 1.0, 20);
  geometry::PointCloud cloud;
  cloud.positions = {kMiddle + Vec3(2.5, 3.5, 0), kMiddle + Vec3(2.6, 3.4, 5), kMiddle + Vec3(2.4, 3.6, 1),
                     kMiddle + Vec3(500, 0, 0), kMiddle + Vec3(2.5, 3.5, 50)};
  cloud.colors = {{1, 1, 1}, {2, 2, 2}, {3, 3, 3}, {4, 4, 4}, {5, 5, 5}};
  splat_points(cloud, grid, {.top_m = kMiddle.z() + 20}, image);
  EXPECT_EQ(image.rgb(12, 6), (imaging::Rgb8{2, 2, 2}));
  EXPECT_NEAR(image.height_m(12, 6), kMiddle.z() + 5, 1e-3);
}

TEST(Orthophoto, EvenPointsLeaveNoGaps) {
  geometry::PointCloud cloud;
  for (int j = 0; j < 10; ++j) {
    for (int i = 0; i < 10; ++i) cloud.positions.emplace_back(kMiddle + Vec3(3.0 * i - 13.5, 3.0 * j - 13.5, 0));
  }
  Orthophoto image(26, 26);
  splat_points(cloud, grid_about(kMiddle, 1.0, 26), {}, image);
  for (const float height_m : image.height_m.pixels) EXPECT_TRUE(std::isfinite(height_m));
}

TEST(Orthophoto, AGridWithoutPixelsIsRefused) {
  const auto paint = texture(1, 1, [](int, int) { return grey(90); });
  const Scene scene({ground(kMiddle, 10.0, paint)});
  EXPECT_THAT(tests::refusal_of([&] { render_orthophoto(scene, {}); }), testing::HasSubstr("at least one pixel"));
}

}  // namespace
}  // namespace tileflight::render::orthophoto_test
