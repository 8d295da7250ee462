#pragma once

#include <cstdint>

#include "tileflight/core/geometry/mesh.h"

namespace tileflight::tests {

/// Terrain over the square from (corner_m, corner_m), `size_m` wide, in cells x cells squares of two triangles each,
/// row after row from the south; `height_m(x, y)` says how high it is.
template <typename Height>
geometry::TriangleMesh height_field(std::uint32_t cells, double corner_m, double size_m, const Height& height_m) {
  geometry::TriangleMesh mesh;
  for (std::uint32_t j = 0; j <= cells; ++j) {
    for (std::uint32_t i = 0; i <= cells; ++i) {
      const double x = corner_m + size_m * i / cells, y = corner_m + size_m * j / cells;
      mesh.vertices.emplace_back(x, y, height_m(x, y));
    }
  }
  for (std::uint32_t j = 0; j < cells; ++j) {
    for (std::uint32_t i = 0; i < cells; ++i) {
      const std::uint32_t a = j * (cells + 1) + i, b = a + 1, c = a + cells + 1;
      mesh.triangles.push_back({a, b, c});
      mesh.triangles.push_back({b, c + 1, c});
    }
  }
  return mesh;
}

}  // namespace tileflight::tests
