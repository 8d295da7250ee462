#pragma once

#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <vector>

#include "tileflight/core/imaging/textured_mesh.h"

// Small scenes with known answers, for the tests of this stage.
namespace tileflight::render::test_scenes {

using TexelColour = std::function<imaging::Rgb8(int x, int y)>;

inline std::shared_ptr<const imaging::RgbImage> texture(int width, int height, const TexelColour& colour) {
  auto image = std::make_shared<imaging::RgbImage>(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) (*image)(x, y) = colour(x, y);
  }
  return image;
}

inline imaging::Rgb8 grey(int value) {
  const auto v = static_cast<std::uint8_t>(value);
  return {v, v, v};
}

/// Hash of a texel to 0..255: noise without any structure.
inline int noise(int x, int y, int seed = 0) {
  auto h = static_cast<std::uint32_t>(x) * 73856093U ^ static_cast<std::uint32_t>(y) * 19349663U ^
           static_cast<std::uint32_t>(seed) * 83492791U;
  h = (h ^ (h >> 16U)) * 0x7feb352dU;
  h = (h ^ (h >> 15U)) * 0x846ca68bU;
  return static_cast<int>((h ^ (h >> 16U)) & 0xFFU);
}

/// Level square of `size_m` around `center`; texture coordinates run 0..repeats east (u) and south (v), so that an
/// image is oriented like a map.
inline imaging::TexturedMesh ground(const geometry::Vec3& center, double size_m,
                                    std::shared_ptr<const imaging::RgbImage> image, float repeats = 1.0F) {
  const double h = size_m / 2;
  imaging::TexturedMesh mesh;
  mesh.mesh.vertices = {center + geometry::Vec3(-h, -h, 0), center + geometry::Vec3(h, -h, 0),
                        center + geometry::Vec3(h, h, 0), center + geometry::Vec3(-h, h, 0)};
  mesh.mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  mesh.uv = {{0, repeats}, {repeats, repeats}, {repeats, 0}, {0, 0}};
  mesh.texture = std::move(image);
  return mesh;
}

/// Level square of one linear colour without texture.
inline imaging::TexturedMesh colored_ground(const geometry::Vec3& center, double size_m,
                                            const std::array<float, 4>& color) {
  imaging::TexturedMesh mesh = ground(center, size_m, nullptr);
  mesh.uv.clear();
  mesh.base_color = color;
  return mesh;
}

/// Level square that blends, with its opacity in `color`.
inline imaging::TexturedMesh pane(const geometry::Vec3& center, double size_m, const std::array<float, 4>& color) {
  imaging::TexturedMesh mesh = colored_ground(center, size_m, color);
  mesh.blends = true;
  return mesh;
}

/// Hills of (cells + 1)^2 vertices over `size_m`, with one texture.
inline imaging::TexturedMesh hills(const geometry::Vec3& center, double size_m, int cells,
                                   std::shared_ptr<const imaging::RgbImage> image, double height_m = 4.0) {
  imaging::TexturedMesh mesh;
  for (int j = 0; j <= cells; ++j) {
    for (int i = 0; i <= cells; ++i) {
      const double a = static_cast<double>(i) / cells;
      const double b = static_cast<double>(j) / cells;
      const double z =
          height_m * std::sin(9.0 * a) * std::cos(11.0 * b) + 0.1 * height_m * std::sin(61.0 * a + 53.0 * b);
      mesh.mesh.vertices.push_back(center + geometry::Vec3(size_m * (a - 0.5), size_m * (b - 0.5), z));
      mesh.uv.emplace_back(static_cast<float>(a), static_cast<float>(1.0 - b));
    }
  }
  const auto columns = static_cast<std::uint32_t>(cells + 1);
  for (std::uint32_t j = 0; j + 1 < columns; ++j) {
    for (std::uint32_t i = 0; i + 1 < columns; ++i) {
      const std::uint32_t a = j * columns + i;
      mesh.mesh.triangles.push_back({a, a + 1, a + columns});
      mesh.mesh.triangles.push_back({a + 1, a + columns + 1, a + columns});
    }
  }
  mesh.texture = std::move(image);
  return mesh;
}

/// Camera at `position` looking straight down, image top to the north.
inline geometry::SE3 looking_down(const geometry::Vec3& position) {
  geometry::Mat3 r;
  r << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  return {r, position};
}

/// Camera at `position` looking along `forward` with a level horizon.
inline geometry::SE3 looking_along(const geometry::Vec3& position, const geometry::Vec3& forward) {
  const geometry::Vec3 z = forward.normalized();
  const geometry::Vec3 x = z.cross(geometry::Vec3::UnitZ()).normalized();
  geometry::Mat3 r;
  r << x, z.cross(x), z;
  return {r, position};
}

}  // namespace tileflight::render::test_scenes
