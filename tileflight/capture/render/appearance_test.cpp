#include "tileflight/capture/render/appearance.h"

#include <gtest/gtest.h>

#include <cstring>
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
