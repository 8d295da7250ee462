#include "tileflight/world/scene/model_builder.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <utility>

#include "tileflight/core/base/srgb.h"

namespace tileflight::scene {
namespace {

using geometry::Vec2;
using geometry::Vec3;
using imaging::Rgb8;

/// Light of an even sky and a ground of half its brightness on a face: half of the sphere that it sees is sky for a
/// wall, all for a roof.
double even_light(const Vec3& normal) { return 0.75 + 0.25 * normal.z(); }

std::array<std::uint8_t, 4> stored(const Rgb8& colour, double light) {
  std::array<std::uint8_t, 4> linear{0, 0, 0, 255};
  for (std::size_t c = 0; c < 3; ++c) {
    const double value = light * base::linear_from_srgb(colour[c] / 255.0);
    linear[c] = static_cast<std::uint8_t>(std::lround(255.0 * std::clamp(value, 0.0, 1.0)));
  }
  return linear;
}

Ring circle(const Vec3& center, const Vec3& x, const Vec3& y, double radius, int sides) {
  Ring ring;
  for (int i = 0; i < sides; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / sides;
    ring.push_back(center + radius * (std::cos(angle) * x + std::sin(angle) * y));
  }
  return ring;
}

Ring rectangle(const Vec3& center, const Vec2& half) {
  return {center + Vec3(-half.x(), -half.y(), 0), center + Vec3(half.x(), -half.y(), 0),
          center + Vec3(half.x(), half.y(), 0), center + Vec3(-half.x(), half.y(), 0)};
}

Ring reversed(Ring ring) {
  std::ranges::reverse(ring);
  return ring;
}

}  // namespace

void ModelBuilder::triangle(const Vec3& a, const Vec3& b, const Vec3& c, const Rgb8& colour) {
  const Vec3 normal = (b - a).cross(c - a);
  if (normal.norm() < 1e-12) return;  // the tip of a cone
  const auto first = static_cast<std::uint32_t>(mesh_.mesh.vertices.size());
  const auto linear = stored(colour, even_light(normal.normalized()));
  for (const Vec3& corner : {a, b, c}) {
    mesh_.mesh.vertices.push_back(corner);
    mesh_.colors.push_back(linear);
  }
  mesh_.mesh.triangles.push_back({first, first + 1, first + 2});
}

void ModelBuilder::quad(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d, const Rgb8& colour) {
  triangle(a, b, c, colour);
  triangle(a, c, d, colour);
}

void ModelBuilder::loft(const Ring& from, const Ring& to, const Rgb8& colour) {
  for (std::size_t i = 0; i < from.size(); ++i) {
    const std::size_t next = (i + 1) % from.size();
    quad(from[i], from[next], to[next], to[i], colour);
  }
}

void ModelBuilder::face(const Ring& ring, const Rgb8& colour) {
  for (std::size_t i = 1; i + 1 < ring.size(); ++i) triangle(ring[0], ring[i], ring[i + 1], colour);
}

void ModelBuilder::frustum(const Vec3& bottom, const Vec2& bottom_half, const Vec3& top, const Vec2& top_half,
                           const Rgb8& colour) {
  const Ring low = rectangle(bottom, bottom_half), high = rectangle(top, top_half);
  loft(low, high, colour);
  face(high, colour);
  face(reversed(low), colour);
}

void ModelBuilder::cone(const Vec3& from, double from_radius, const Vec3& to, double to_radius, int sides,
                        const Rgb8& colour) {
  const Vec3 axis = (to - from).normalized(), x = axis.unitOrthogonal(), y = axis.cross(x);
  const Ring start = circle(from, x, y, from_radius, sides), end = circle(to, x, y, to_radius, sides);
  loft(start, end, colour);
  face(end, colour);
  face(reversed(start), colour);
}

void ModelBuilder::ellipsoid(const Vec3& center, const Vec3& radii, int segments, const Rgb8& colour) {
  const auto ring_at = [&](int k) {
    const double polar = std::numbers::pi * (1.0 - static_cast<double>(k) / segments);
    Ring ring = circle(Vec3(0, 0, std::cos(polar)), Vec3::UnitX(), Vec3::UnitY(), std::sin(polar), 2 * segments);
    for (Vec3& point : ring) point = center + radii.cwiseProduct(point);
    return ring;
  };
  for (int k = 0; k < segments; ++k) loft(ring_at(k), ring_at(k + 1), colour);
}

imaging::TexturedMesh ModelBuilder::take() { return std::exchange(mesh_, {}); }

}  // namespace tileflight::scene
