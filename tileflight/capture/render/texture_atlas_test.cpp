#include "tileflight/capture/render/texture_atlas.h"

#include <gtest/gtest.h>

#include <random>

#include "tileflight/capture/render/camera_renderer.h"
#include "tileflight/capture/render/test_scenes.h"

namespace tileflight::render::texture_atlas_test {
namespace {

using geometry::Vec3;
using imaging::TexturedMesh;
using test_scenes::grey;
using test_scenes::texture;

/// A level square of ground whose texture coordinates fill `low`..`high`.
TexturedMesh piece(const Vec3& center, double size_m, const Eigen::Vector2f& low, const Eigen::Vector2f& high,
                   const std::shared_ptr<const imaging::RgbImage>& image) {
  TexturedMesh mesh = test_scenes::ground(center, size_m, image);
  for (Eigen::Vector2f& uv : mesh.uv) uv = low + uv.cwiseProduct(high - low);
  return mesh;
}

imaging::GrayImage coverage_of(const TexturedMesh& mesh) {
  const TexturedMesh* one = &mesh;
  return texture_coverage(std::span(&one, 1));
}

/// Whether the triangle intersects the cell [x, x + 1] x [y, y + 1], by sampling the triangle on a fine grid.
bool touches(const std::array<Eigen::Vector2f, 3>& p, int x, int y) {
  constexpr int kSteps = 60;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; i + j <= kSteps; ++j) {
      const Eigen::Vector2f q =
          p[0] + (p[1] - p[0]) * (static_cast<float>(i) / kSteps) + (p[2] - p[0]) * (static_cast<float>(j) / kSteps);
      if (q.x() >= static_cast<float>(x) && q.x() <= static_cast<float>(x + 1) && q.y() >= static_cast<float>(y) &&
          q.y() <= static_cast<float>(y + 1))
        return true;
    }
  }
  return false;
}

TEST(TextureAtlas, CoverageHoldsEveryTexelThatATriangleTouches) {
  std::mt19937 random(4);
  const auto coordinate = [&] { return static_cast<float>(random() % 10000) / 10000.0F; };
  for (int round = 0; round < 40; ++round) {
    TexturedMesh mesh;
    mesh.texture = texture(12, 9, [](int, int) { return grey(0); });
    mesh.mesh.vertices.assign(3, Vec3::Zero());
    mesh.mesh.triangles = {{0, 1, 2}};
    for (int i = 0; i < 3; ++i) mesh.uv.emplace_back(coordinate(), coordinate());
    const imaging::GrayImage coverage = coverage_of(mesh);
    const Eigen::Vector2f size(12, 9);
    const std::array<Eigen::Vector2f, 3> p{mesh.uv[0].cwiseProduct(size), mesh.uv[1].cwiseProduct(size),
                                           mesh.uv[2].cwiseProduct(size)};
    int marked = 0;
    int touched = 0;
    int missed = 0;
    for (int y = 0; y < 9; ++y) {
      for (int x = 0; x < 12; ++x) {
        const bool hit = touches(p, x, y);
        missed += hit && coverage(x, y) == 0;
        marked += coverage(x, y) != 0;
        touched += hit;
      }
    }
    EXPECT_LE(missed, 1);            // texels grazed at their rim do not count
    EXPECT_LE(marked, touched + 4);  // the grid of the check may miss slivers
  }
}

TEST(TextureAtlas, NothingToMaskWhereAllIsShownOrRepeats) {
  const auto image = texture(16, 16, [](int, int) { return grey(0); });
  EXPECT_TRUE(coverage_of(piece(Vec3::Zero(), 1.0, {0, 0}, {1, 1}, image)).empty());
  EXPECT_TRUE(coverage_of(piece(Vec3::Zero(), 1.0, {0, 0}, {3, 3}, image)).empty());
  EXPECT_FALSE(coverage_of(piece(Vec3::Zero(), 1.0, {0, 0}, {0.4F, 0.9F}, image)).empty());
}

TEST(TextureAtlas, LevelsFollowTheWidthOfTheChart) {
  const auto image = texture(256, 256, [](int, int) { return grey(0); });
  EXPECT_EQ(chart_max_mip_levels(piece(Vec3::Zero(), 1.0, {0, 0}, {1, 1}, image)), (std::vector<std::int32_t>{8, 8}));
  EXPECT_EQ(chart_max_mip_levels(piece(Vec3::Zero(), 1.0, {0, 0}, {0.5F, 0.0625F}, image)),
            (std::vector<std::int32_t>{4, 4}));
  // Triangles without common vertices form one chart if their texture coordinates meet.
  TexturedMesh apart = piece(Vec3::Zero(), 1.0, {0, 0}, {1, 1}, image);
  apart.mesh.vertices = {apart.mesh.vertices[0], apart.mesh.vertices[1], apart.mesh.vertices[2],
                         apart.mesh.vertices[0], apart.mesh.vertices[2], apart.mesh.vertices[3]};
  apart.uv = {apart.uv[0], apart.uv[1], apart.uv[2], apart.uv[0], apart.uv[2], apart.uv[3]};
  apart.mesh.triangles = {{0, 1, 2}, {3, 4, 5}};
  EXPECT_EQ(chart_max_mip_levels(apart), (std::vector<std::int32_t>{8, 8}));
}

TEST(TextureAtlas, ChartsKeepTheirColourFromAfar) {
  // Grey ground in one small chart of a texture that is otherwise magenta padding, and a black chart beside it.
  const auto image = texture(512, 512, [](int x, int y) {
    if (x < 64 && y < 64) return grey(128);
    if (x >= 80 && x < 144 && y < 64) return grey(10);
    return imaging::Rgb8{255, 0, 255};
  });
  const scene::Scene scene({piece(Vec3(0, 0, 0), 40.0, {0, 0}, {0.125F, 0.125F}, image),
                            piece(Vec3(40, 0, 0), 40.0, {0.15625F, 0}, {0.28125F, 0.125F}, image)});
  const CameraRenderer renderer(scene, imaging::make_pinhole(64, 64, 60.0), {.background = {128, 128, 128}});
  for (const double height_m : {60.0, 600.0, 3000.0}) {
    const RenderedFrame frame = renderer.render(test_scenes::looking_down(Vec3(-5, 0, height_m)));
    ASSERT_EQ(frame.rgb.pixels.size(), 64U * 64U);
    for (const imaging::Rgb8& pixel : frame.rgb.pixels) {
      EXPECT_LE(std::abs(pixel[0] - pixel[1]), 3);  // no magenta
      EXPECT_LE(pixel[0], 131);
    }
    const double pixel_m = 2.0 * height_m * std::tan(0.5236) / 64;
    if (pixel_m < 10.0) {
      const int ground_x = static_cast<int>(31.5 + 5.0 / pixel_m);
      EXPECT_NEAR(frame.rgb(ground_x, 32)[1], 128, 3) << height_m;
    }
  }
}

}  // namespace
}  // namespace tileflight::render::texture_atlas_test
