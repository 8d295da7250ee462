#pragma once

#include <cmath>
#include <cstdint>
#include <random>

#include "tests/height_field.h"
#include "tileflight/imaging/textured_mesh.h"

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
