#include "tileflight/core/geometry/prism.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace tileflight::geometry {
namespace {

using Eigen::AlignedBox2d;
using Eigen::Vector2d;

constexpr double kSlack_m = 1e-6;
constexpr std::size_t kMaxBands = 4096;

double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

double distance_to_segment(const Vector2d& point, const Vector2d& a, const Vector2d& b) {
  const Vector2d along = b - a;
  const double length2 = along.squaredNorm();
  const double t = length2 > 0 ? std::clamp((point - a).dot(along) / length2, 0.0, 1.0) : 0.0;
  return (point - a - t * along).norm();
}

/// Whether two segments intersect or come within the tolerance.
bool segments_meet(const Vector2d& a, const Vector2d& b, const Vector2d& c, const Vector2d& d) {
  const bool c_d_part = (cross(b - a, c - a) > 0) != (cross(b - a, d - a) > 0);
  const bool a_b_part = (cross(d - c, a - c) > 0) != (cross(d - c, b - c) > 0);
  if (c_d_part && a_b_part) return true;
  return std::min({distance_to_segment(a, c, d), distance_to_segment(b, c, d), distance_to_segment(c, a, b),
                   distance_to_segment(d, a, b)}) <= kSlack_m;
}

/// A point on the border counts as outside here; callers test the border separately.
bool inside_convex(std::span<const Vector2d> convex, const Vector2d& point) {
  if (convex.size() < 3) return false;
  bool left = true;
  bool right = true;
  for (std::size_t i = 0; i < convex.size(); ++i) {
    const Vector2d edge = convex[(i + 1) % convex.size()] - convex[i];
    if (edge.squaredNorm() == 0) continue;
    const double side = cross(edge, point - convex[i]);
    left = left && side > 0;
    right = right && side < 0;
  }
  return left != right;
}

/// Clips a convex polygon to `sign` * z <= `sign` * `limit` (Sutherland and Hodgman).
std::vector<Vec3> clip_half_space(const std::vector<Vec3>& polygon, double sign, double limit) {
  std::vector<Vec3> out;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vec3& a = polygon[i];
    const Vec3& b = polygon[(i + 1) % polygon.size()];
    const double room_a = sign * (limit - a.z());
    const double room_b = sign * (limit - b.z());
    if (room_a >= 0) out.push_back(a);
    if ((room_a > 0 && room_b < 0) || (room_a < 0 && room_b > 0)) {
      out.push_back(a + (b - a) * (room_a / (room_a - room_b)));
    }
  }
  return out;
}

}  // namespace

PolygonArea::PolygonArea(std::vector<Ring> rings) : rings_(std::move(rings)) {
  std::erase_if(rings_, [](const Ring& ring) { return ring.size() < 3; });
  for (const Ring& ring : rings_) {
    for (std::size_t i = 0; i < ring.size(); ++i) {
      bounds_.extend(ring[i]);
      edges_.push_back({ring[i], ring[(i + 1) % ring.size()]});
    }
  }
  bands_.resize(std::clamp<std::size_t>(edges_.size() / 2, 1, kMaxBands));
  for (std::uint32_t i = 0; i < edges_.size(); ++i) {
    const auto [low, high] = std::minmax(edges_[i].from.y(), edges_[i].to.y());
    for (std::size_t band = band_of(low); band <= band_of(high); ++band) bands_[band].push_back(i);
  }
}

std::size_t PolygonArea::band_of(double y) const {
  const double height = bounds_.max().y() - bounds_.min().y();
  if (!(height > 0)) return 0;
  const double place = (y - bounds_.min().y()) / height * static_cast<double>(bands_.size());
  return static_cast<std::size_t>(std::clamp(place, 0.0, static_cast<double>(bands_.size() - 1)));
}

template <class Visit>
void PolygonArea::visit_edges(double low, double high, const Visit& visit) const {
  for (std::size_t band = band_of(low); band <= band_of(high); ++band) {
    for (const std::uint32_t edge : bands_[band]) visit(edges_[edge]);
  }
}

bool PolygonArea::contains(const Vector2d& point) const {
  if (bounds_.isEmpty() || !bounds_.contains(point)) return false;
  bool inside = false;
  visit_edges(point.y(), point.y(), [&](const Edge& edge) {
    if ((edge.from.y() > point.y()) == (edge.to.y() > point.y())) return;
    const double share = (point.y() - edge.from.y()) / (edge.to.y() - edge.from.y());
    if (point.x() < edge.from.x() + share * (edge.to.x() - edge.from.x())) inside = !inside;
  });
  return inside;
}

bool PolygonArea::intersects(std::span<const Vector2d> convex) const {
  AlignedBox2d reach;
  for (const Vector2d& corner : convex) reach.extend(corner);
  reach.min().array() -= kSlack_m;
  reach.max().array() += kSlack_m;
  if (bounds_.isEmpty() || !reach.intersects(bounds_)) return false;
  for (const Vector2d& corner : convex) {
    if (contains(corner)) return true;
  }
  bool touches = false;
  visit_edges(reach.min().y(), reach.max().y(), [&](const Edge& edge) {
    if (touches || !reach.intersects(AlignedBox2d(edge.from.cwiseMin(edge.to), edge.from.cwiseMax(edge.to)))) return;
    touches = inside_convex(convex, edge.from);
    for (std::size_t i = 0; !touches && i < convex.size(); ++i) {
      touches = segments_meet(edge.from, edge.to, convex[i], convex[(i + 1) % convex.size()]);
    }
  });
  return touches;
}

double PolygonArea::distance_m(const Vector2d& point) const {
  if (contains(point)) return 0.0;
  double nearest = std::numeric_limits<double>::infinity();
  for (const Edge& edge : edges_) nearest = std::min(nearest, distance_to_segment(point, edge.from, edge.to));
  return nearest;
}

bool contains(const Prism& prism, const Vec3& point) {
  return point.z() >= prism.bottom_m && point.z() <= prism.top_m && prism.base.contains(point.head<2>());
}

Box3 bounds(const Prism& prism) {
  const AlignedBox2d& flat = prism.base.bounds();
  if (flat.isEmpty()) return {};
  return {Vec3(flat.min().x(), flat.min().y(), prism.bottom_m), Vec3(flat.max().x(), flat.max().y(), prism.top_m)};
}

bool intersects(const Prism& prism, const std::array<Vec3, 3>& triangle) {
  const std::vector<Vec3> between =
      clip_half_space(clip_half_space({triangle.begin(), triangle.end()}, 1, prism.top_m), -1, prism.bottom_m);
  std::vector<Vector2d> shadow(between.size());
  std::transform(between.begin(), between.end(), shadow.begin(), [](const Vec3& p) { return p.head<2>(); });
  return prism.base.intersects(shadow);
}

}  // namespace tileflight::geometry
