#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "tileflight/geometry/mesh.h"

namespace tileflight::geometry {

/// Up to four triangles whose nearest points are found abreast. Places that are left hold the last triangle again.
class TrianglePack {
 public:
  static constexpr std::size_t kSize = 4;

  TrianglePack() = default;
  /// `chosen`: one to four indices of triangles of the mesh.
  TrianglePack(const TriangleMesh& mesh, std::span<const std::uint32_t> chosen);

  /// The point of the nearest triangle that is nearest to the query, to the bit what closest_point_on_triangle gives.
  struct Nearest {
    double distance2 = 0.0;  ///< square metres
    std::uint32_t triangle = 0;
    Vec3 position = Vec3::Zero();
  };
  /// Equal distances: the lowest triangle wins.
  Nearest nearest(const Vec3& query) const;

  Vec3 corner(std::size_t which, std::size_t place) const;

 private:
  using Row = std::array<double, kSize>;
  using Corner = std::array<Row, 3>;  ///< [axis][place], metres

  Corner a_{}, b_{}, c_{};
  std::array<std::uint32_t, kSize> triangle_{};
};

}  // namespace tileflight::geometry
