#include "tileflight/core/geometry/mesh.h"

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

/// Nearest point of the segment from a to b; the point a if they coincide.
Vec3 closest_point_on_segment(const Vec3& p, const Vec3& a, const Vec3& b) {
  const Vec3 ab = b - a;
  const double length2 = ab.squaredNorm();
  if (!(length2 > 0.0)) return a;
  return a + std::clamp((p - a).dot(ab) / length2, 0.0, 1.0) * ab;
}

/// For a degenerate triangle: the nearest point of its three sides.
Vec3 closest_point_on_sides(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  Vec3 best = closest_point_on_segment(p, a, b);
  for (const Vec3& candidate : {closest_point_on_segment(p, b, c), closest_point_on_segment(p, c, a)}) {
    if ((candidate - p).squaredNorm() < (best - p).squaredNorm()) best = candidate;
  }
  return best;
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

Box3 bounds(const TriangleMesh& mesh) {
  Box3 box;
  for (const Vec3& v : mesh.vertices) box.extend(v);
  return box;
}

double surface_area_m2(const TriangleMesh& mesh) {
  double area_m2 = 0.0;
  for (const Triangle& t : mesh.triangles) {
    const Vec3& a = mesh.vertices[t[0]];
    area_m2 += 0.5 * (mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a).norm();
  }
  return area_m2;
}

Vec3 closest_point_on_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  // Ericson's Voronoi regions: d1..d6 are projections of p on the sides, va, vb, vc the barycentric areas.
  const Vec3 ab = b - a;
  const Vec3 ac = c - a;
  const Vec3 ap = p - a;
  const double d1 = ab.dot(ap);
  const double d2 = ac.dot(ap);
  if (d1 <= 0.0 && d2 <= 0.0) return a;
  const Vec3 bp = p - b;
  const double d3 = ab.dot(bp);
  const double d4 = ac.dot(bp);
  if (d3 >= 0.0 && d4 <= d3) return b;
  const Vec3 cp = p - c;
  const double d5 = ab.dot(cp);
  const double d6 = ac.dot(cp);
  if (d6 >= 0.0 && d5 <= d6) return c;
  const double va = d3 * d6 - d5 * d4;
  const double vb = d5 * d2 - d1 * d6;
  const double vc = d1 * d4 - d3 * d2;
  const double area = va + vb + vc;  // |ab x ac|^2
  // For a (nearly) degenerate triangle rounding would decide the region, so its sides are used.
  if (!(area > 1e-12 * ab.squaredNorm() * ac.squaredNorm())) return closest_point_on_sides(p, a, b, c);
  if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) return a + d1 / (d1 - d3) * ab;
  if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) return a + d2 / (d2 - d6) * ac;
  if (va <= 0.0 && d4 >= d3 && d5 >= d6) return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
  return a + vb / area * ab + vc / area * ac;
}

}  // namespace tileflight::geometry
