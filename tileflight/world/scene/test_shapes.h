#pragma once

#include <cmath>
#include <cstdint>
#include <random>

#include "tests/height_field.h"
#include "tileflight/core/imaging/textured_mesh.h"

namespace tileflight::scene::test_shapes {

inline double uniform(std::mt19937_64& random, double low, double high) {
  return low + (high - low) * static_cast<double>(random() >> 11) * 0x1p-53;
}

inline geometry::Vec3 uniform_vector(std::mt19937_64& random, double half) {
  const double x = uniform(random, -half, half);
  const double y = uniform(random, -half, half);
  const double z = uniform(random, -half, half);
  return {x, y, z};
}

/// Triangles around `center` whose sizes go from `half_m` down to a thousandth of it.
inline imaging::TexturedMesh soup(std::mt19937_64& random, int count, const geometry::Vec3& center, double half_m) {
  imaging::TexturedMesh mesh;
  for (int i = 0; i < count; ++i) {
    const geometry::Vec3 base = center + uniform_vector(random, half_m);
    const double size = half_m * std::pow(10.0, uniform(random, -3.0, 0.0));
    const auto first = static_cast<std::uint32_t>(mesh.mesh.vertices.size());
    for (int corner = 0; corner < 3; ++corner) mesh.mesh.vertices.push_back(base + uniform_vector(random, size));
    mesh.mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

/// Terrain of (cells + 1)^2 shared vertices, a square of side `size_m` around `center`; `height_m(x, y)` is added to
/// its height.
template <typename Height>
imaging::TexturedMesh height_field(int cells, double size_m, const geometry::Vec3& center, const Height& height_m) {
  imaging::TexturedMesh field;
  field.mesh = tests::height_field(static_cast<std::uint32_t>(cells), -0.5 * size_m, size_m, height_m);
  for (geometry::Vec3& vertex : field.mesh.vertices) vertex += center;
  return field;
}

}  // namespace tileflight::scene::test_shapes
