#include "tileflight/capture/render/appearance.h"

#include <gtest/gtest.h>

#include <cstring>
#include <random>
#include <span>

#include "tileflight/capture/render/camera_renderer.h"
#include "tileflight/capture/render/test_scenes.h"

namespace tileflight::render::appearance_test {
namespace {

using geometry::Vec3;
using imaging::TexturedMesh;

/// Textures with padding on the right, enough for a scene.
class SharedAppearance : public testing::Test {
 protected:
  static TexturedMesh tile(int seed, double east_m, std::shared_ptr<const imaging::RgbImage> image = nullptr) {
    if (!image) {
      image = test_scenes::texture(60, 33, [seed](int x, int y) {
        return imaging::Rgb8{static_cast<std::uint8_t>(test_scenes::noise(x, y, seed)),
                             static_cast<std::uint8_t>(7 * x), static_cast<std::uint8_t>(3 * y)};
      });
    }
    TexturedMesh mesh = test_scenes::hills(Vec3(east_m, 0, 0), 20.0, 12, std::move(image));
    for (Eigen::Vector2f& uv : mesh.uv) uv.x() *= 0.7F;
    return mesh;
  }
  static TexturedMesh bare(double east_m) {
    TexturedMesh mesh = tile(3, east_m);
    mesh.texture = nullptr;
    return mesh;
  }
  std::shared_ptr<const scene::ScenePart> part(std::vector<TexturedMesh> meshes) const {
    return std::make_shared<const scene::ScenePart>(std::move(meshes), frame_);
  }
  static const MipPyramid* pyramid(const Appearance& appearance, std::uint32_t mesh) {
    return appearance.material(mesh).texture.pyramid;
  }
  /// Compares all triangles and all texels.
  static void expect_same(const scene::Scene& scene, const Appearance& a, const Appearance& b) {
    for (std::uint32_t m = 0; m < scene.meshes().size(); ++m) {
      for (std::uint32_t t = 0; t < scene.meshes()[m].mesh.triangles.size(); ++t) {
        const TriangleShading& one = a.triangle_shading(a.material(m), t);
        const TriangleShading& other = b.triangle_shading(b.material(m), t);
        EXPECT_EQ(std::memcmp(&one, &other, offsetof(TriangleShading, max_level) + sizeof one.max_level), 0);
      }
      ASSERT_EQ(pyramid(a, m) == nullptr, pyramid(b, m) == nullptr);
      for (int i = 0; pyramid(a, m) != nullptr && i < pyramid(a, m)->levels(); ++i) {
        const MipLevel& one = pyramid(a, m)->level(i);
        const MipLevel& other = pyramid(b, m)->level(i);
        ASSERT_EQ(one.width * one.height, other.width * other.height);
        EXPECT_EQ(std::memcmp(one.texels, other.texels, 3UL * one.width * one.height), 0) << m << " level " << i;
      }
    }
    const imaging::Camera camera = imaging::make_pinhole(96, 64, 70.0);
    const auto shared = [](const Appearance& one) {
      return std::shared_ptr<const Appearance>(std::shared_ptr<void>(), &one);
    };
    for (const double height_m : {12.0, 150.0}) {
      const geometry::SE3 T = test_scenes::looking_down(Vec3(8, 1, height_m));
      EXPECT_EQ(CameraRenderer(scene, shared(a), camera, {}).render(T).rgb.pixels,
                CameraRenderer(scene, shared(b), camera, {}).render(T).rgb.pixels);
    }
  }

  scene::SceneFrame frame_{Vec3(Vec3::Zero())};
};

TEST_F(SharedAppearance, IsTheSameToTheLastBitAsMadeAnew) {
  const auto a = part({tile(1, 0)}), b = part({tile(2, 20), bare(40)}), c = part({tile(4, 60)});
  const scene::Scene first({a, b});
  const scene::Scene second({b, c});
  const auto of_b = std::make_shared<const PartAppearance>(b);
  const Appearance of_first({std::make_shared<const PartAppearance>(a), of_b});
  const Appearance of_second({of_b, std::make_shared<const PartAppearance>(c)});
  expect_same(first, of_first, Appearance(first));
  expect_same(second, of_second, Appearance(second));
  EXPECT_EQ(pyramid(of_first, 1), pyramid(of_second, 0)) << "shared, not made again";
}

TEST_F(SharedAppearance, OfPartsIsThatOfOneWhole) {
  const TexturedMesh a = tile(1, 0), b = tile(2, 20), none = bare(40);
  const scene::Scene parts({part({a}), part({}), part({b, none})});
  const scene::Scene whole({a, b, none}, Vec3(Vec3::Zero()));
  expect_same(whole, Appearance(parts), Appearance(whole));
}

TEST_F(SharedAppearance, OutlivesTheScene) {
  std::unique_ptr<Appearance> kept;
  {
    const scene::Scene gone({part({tile(2, 20)}), part({tile(4, 0)})});
    kept = std::make_unique<Appearance>(gone);
  }
  const scene::Scene again({part({tile(2, 20)}), part({tile(4, 0)})});
  expect_same(again, *kept, Appearance(again));
}

TEST_F(SharedAppearance, WhatAnotherPartShowsOfTheTextureIsPadding) {
  const auto image = tile(1, 0).texture;
  const TexturedMesh left = tile(1, 0, image);
  TexturedMesh right = tile(1, 20, image);
  for (Eigen::Vector2f& uv : right.uv) uv.x() += 0.3F;
  const scene::Scene both({part({left}), part({right})});
  const scene::Scene one({left}, Vec3(Vec3::Zero()));
  const Appearance of_both(both);
  const Appearance of_one(one);
  EXPECT_NE(pyramid(of_both, 0), pyramid(of_both, 1));
  expect_same(one, Appearance({std::make_shared<const PartAppearance>(both.parts()[0])}), of_one);
}

}  // namespace
}  // namespace tileflight::render::appearance_test

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
