#include "tileflight/core/geometry/surface_heights.h"

#include <algorithm>
#include <functional>
#include <optional>

namespace tileflight::geometry {
namespace {

constexpr double kSame_m = 1e-3;

/// Twice the signed area of (a, b, p) projected on the ground plane.
double shadow(const Vec3& a, const Vec3& b, double x, double y) {
  return (b.x() - a.x()) * (y - a.y()) - (b.y() - a.y()) * (x - a.x());
}

std::optional<double> height_over(const Vec3& a, const Vec3& b, const Vec3& c, double x, double y) {
  const double weight_a = shadow(b, c, x, y), weight_b = shadow(c, a, x, y), weight_c = shadow(a, b, x, y);
  const bool inside =
      (weight_a >= 0 && weight_b >= 0 && weight_c >= 0) || (weight_a <= 0 && weight_b <= 0 && weight_c <= 0);
  const double area = weight_a + weight_b + weight_c;
  if (!inside || area == 0) return std::nullopt;
  return (weight_a * a.z() + weight_b * b.z() + weight_c * c.z()) / area;
}

}  // namespace

std::vector<double> surface_heights_at(const TriangleMesh& mesh, double x, double y) {
  std::vector<double> heights;
  for (const Triangle& t : mesh.triangles) {
    const auto height = height_over(mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]], x, y);
    if (height) heights.push_back(*height);
  }
  std::sort(heights.begin(), heights.end(), std::greater<>());
  const auto same = [](double above, double below) { return above - below <= kSame_m; };
  heights.erase(std::unique(heights.begin(), heights.end(), same), heights.end());
  return heights;
}

}  // namespace tileflight::geometry
