#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "tileflight/core/geometry/mesh.h"

namespace tileflight::geometry {

/// Up to four triangles that are queried in parallel (SIMD). Unused places repeat the last triangle.
class TrianglePack {
 public:
  static constexpr std::size_t kSize = 4;

  TrianglePack() = default;
  /// `chosen`: indices of one to four triangles of the mesh.
  TrianglePack(const TriangleMesh& mesh, std::span<const std::uint32_t> chosen);

  /// The nearest point over the triangles; bit-identical to closest_point_on_triangle().
  struct Nearest {
    double distance2 = 0.0;  ///< square metres
    std::uint32_t triangle = 0;
    Vec3 position = Vec3::Zero();
  };
  /// Finds the nearest point; on equal distances the lowest triangle index wins.
  Nearest nearest(const Vec3& query) const;

  Vec3 corner(std::size_t which, std::size_t place) const;

 private:
  using Row = std::array<double, kSize>;
  using Corner = std::array<Row, 3>;  ///< [axis][place], metres

  Corner a_{}, b_{}, c_{};
  std::array<std::uint32_t, kSize> triangle_{};
};

}  // namespace tileflight::geometry
