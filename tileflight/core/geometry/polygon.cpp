#include "tileflight/core/geometry/polygon.h"

#include <algorithm>
#include <numeric>

namespace tileflight::geometry {
namespace {

/// Polygons with more corners are triangulated as a fan: ear clipping takes at least quadratic time.
constexpr std::size_t kMaxEarClippingCorners = 1024;

/// Newell's normal: twice the vector area.
Vec3 vector_area(std::span<const Vec3> corners) {
  Vec3 sum = Vec3::Zero();
  for (std::size_t i = 0; i < corners.size(); ++i)
    sum += (corners[i] - corners[0]).cross(corners[(i + 1) % corners.size()] - corners[0]);
  return sum;
}

/// The corners projected on the coordinate plane of largest area, counter-clockwise.
std::vector<Vec2> flattened(std::span<const Vec3> corners) {
  const Vec3 normal = vector_area(corners);
  Eigen::Index drop = 2;
  normal.cwiseAbs().maxCoeff(&drop);
  const Eigen::Index x = (drop + 1) % 3, y = (drop + 2) % 3;
  const double turn = normal[drop] < 0 ? -1 : 1;
  std::vector<Vec2> out;
  for (const Vec3& corner : corners) out.emplace_back(turn * (corner[x] - corners[0][x]), corner[y] - corners[0][y]);
  return out;
}

bool triangle_contains(const Vec2& a, const Vec2& b, const Vec2& c, const Vec2& p) {
  return twice_area_xy(a, b, p) >= 0 && twice_area_xy(b, c, p) >= 0 && twice_area_xy(c, a, p) >= 0;
}

/// Whether the corner between its two neighbours in `ring` is an ear.
bool is_ear(const std::vector<Vec2>& places, const std::vector<std::size_t>& ring, std::size_t at) {
  const std::size_t n = ring.size(), before = (at + n - 1) % n, after = (at + 1) % n;
  const Vec2 &a = places[ring[before]], &b = places[ring[at]], &c = places[ring[after]];
  if (twice_area_xy(a, b, c) <= 0) return false;
  for (std::size_t k = 0; k < n; ++k) {
    if (k == before || k == at || k == after) continue;
    const Vec2& p = places[ring[k]];
    if (p != a && p != b && p != c && triangle_contains(a, b, c, p)) return false;
  }
  return true;
}

void add_fan(const std::vector<std::size_t>& ring, std::vector<std::array<std::size_t, 3>>& out) {
  for (std::size_t k = 1; k + 1 < ring.size(); ++k) out.push_back({ring[0], ring[k], ring[k + 1]});
}

}  // namespace

std::vector<std::array<std::size_t, 3>> triangulate(std::span<const Vec3> corners) {
  std::vector<std::array<std::size_t, 3>> out;
  std::vector<std::size_t> ring(corners.size());
  std::iota(ring.begin(), ring.end(), std::size_t{0});
  if (corners.size() > 3 && corners.size() <= kMaxEarClippingCorners) {
    const std::vector<Vec2> places = flattened(corners);
    std::size_t at = 1, tried = 0;
    while (ring.size() > 3 && tried < ring.size()) {
      at %= ring.size();
      if (!is_ear(places, ring, at)) {
        ++at, ++tried;
        continue;
      }
      const std::size_t n = ring.size();
      out.push_back({ring[(at + n - 1) % n], ring[at], ring[(at + 1) % n]});
      ring.erase(ring.begin() + static_cast<std::ptrdiff_t>(at));
      tried = 0;
    }
  }
  add_fan(ring, out);
  return out;
}

}  // namespace tileflight::geometry
