#include "tileflight/render/appearance.h"

#include <gtest/gtest.h>

#include <cstring>
#include <span>

#include "tileflight/render/camera_renderer.h"
#include "tileflight/render/test_scenes.h"

namespace tileflight::render::appearance_test {
namespace {

using geometry::Vec3;
using imaging::TexturedMesh;

/// Textures with padding on the right, enough for a scene.
class AppearanceTakenOver : public testing::Test {
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
};

TEST_F(AppearanceTakenOver, IsTheSameToTheLastBitAsMadeAnew) {
  const TexturedMesh a = tile(1, 0);
  const TexturedMesh b = tile(2, 20);
  TexturedMesh bare = tile(3, 40);
  bare.texture = nullptr;
  const scene::Scene first({a, b, bare}, Vec3(Vec3::Zero()));
  const scene::Scene second({bare, b, tile(4, 0)}, Vec3(Vec3::Zero()));
  const Appearance of_first(first);
  const Appearance taken_over(second, &of_first);
  expect_same(second, taken_over, Appearance(second));
  EXPECT_EQ(pyramid(taken_over, 1), pyramid(of_first, 1)) << "shared, not made again";
  EXPECT_NE(pyramid(taken_over, 2), pyramid(of_first, 0));
}

TEST_F(AppearanceTakenOver, OutlivesTheOne) {
  const TexturedMesh b = tile(2, 20);
  const scene::Scene second({b, tile(4, 0)}, Vec3(Vec3::Zero()));
  std::unique_ptr<Appearance> taken_over;
  {
    const scene::Scene first({tile(1, 0), b}, Vec3(Vec3::Zero()));
    const Appearance of_first(first);
    taken_over = std::make_unique<Appearance>(second, &of_first);
  }
  expect_same(second, *taken_over, Appearance(second));
}

TEST_F(AppearanceTakenOver, NotWhereTheTextureLiesOnOtherTriangles) {
  const auto image = tile(1, 0).texture;
  const TexturedMesh left = tile(1, 0, image);
  TexturedMesh right = tile(1, 20, image);
  for (Eigen::Vector2f& uv : right.uv) uv.x() += 0.3F;
  const scene::Scene both({left, right}, Vec3(Vec3::Zero()));
  const scene::Scene one({left}, Vec3(Vec3::Zero()));
  const scene::Scene other({right}, Vec3(Vec3::Zero()));
  const Appearance of_both(both);
  const Appearance of_one(one, &of_both);
  expect_same(one, of_one, Appearance(one));
  EXPECT_NE(pyramid(of_one, 0), pyramid(of_both, 0)) << "what the right one shows is padding now";
  expect_same(other, Appearance(other, &of_one), Appearance(other));
  expect_same(both, Appearance(both, &of_one), of_both);
}

}  // namespace
}  // namespace tileflight::render::appearance_test
