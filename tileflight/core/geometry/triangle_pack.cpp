#include "tileflight/core/geometry/triangle_pack.h"

#include <algorithm>
#include <cstring>

#include "tileflight/core/base/simd.h"

namespace tileflight::geometry {
namespace {

using base::Double4;
using base::Mask4;

struct Vec3x4 {
  Double4 x, y, z;
};

// Results are written through references: returning a vector has no calling convention common to all processors.

TILEFLIGHT_LANE_INLINE void load(const std::array<std::array<double, 4>, 3>& from, Vec3x4& to) {
  std::memcpy(&to.x, from[0].data(), sizeof(Double4));
  std::memcpy(&to.y, from[1].data(), sizeof(Double4));
  std::memcpy(&to.z, from[2].data(), sizeof(Double4));
}

TILEFLIGHT_LANE_INLINE void subtract(const Vec3x4& a, const Vec3x4& b, Vec3x4& result) {
  result = {a.x - b.x, a.y - b.y, a.z - b.z};
}

/// Sums in the same order as Eigen.
TILEFLIGHT_LANE_INLINE void dot(const Vec3x4& a, const Vec3x4& b, Double4& result) {
  result = (a.x * b.x + a.y * b.y) + a.z * b.z;
}

TILEFLIGHT_LANE_INLINE void blend(const Mask4& yes, const Vec3x4& v, Vec3x4& result) {
  result.x = yes ? v.x : result.x;
  result.y = yes ? v.y : result.y;
  result.z = yes ? v.z : result.z;
}

struct NearestPoints4 {
  std::array<double, 4> x, y, z, distance2;
  std::array<long long, 4> thin;  ///< nonzero: (nearly) degenerate, the result must not be used
};

/// Products of a triangle's edges with the differences from its corners to a point; their names are those of
/// closest_point_on_triangle (mesh.h).
struct EdgeProducts4 {
  Double4 d1, d2, d3, d4, d5, d6, ab2, ac2;
};

TILEFLIGHT_LANE_INLINE void edge_products(const Vec3x4& ab, const Vec3x4& ac, const Vec3x4& ap, const Vec3x4& bp,
                                          const Vec3x4& cp, EdgeProducts4& out) {
  dot(ab, ap, out.d1);
  dot(ac, ap, out.d2);
  dot(ab, bp, out.d3);
  dot(ac, bp, out.d4);
  dot(ab, cp, out.d5);
  dot(ac, cp, out.d6);
  dot(ab, ab, out.ab2);
  dot(ac, ac, out.ac2);
}

/// Writes the points and their squared distances from `p`.
TILEFLIGHT_LANE_INLINE void write_nearest(const Vec3x4& nearest, const Vec3x4& p, const Mask4& thin,
                                          NearestPoints4& out) {
  Vec3x4 away;
  subtract(nearest, p, away);
  Double4 distance2;
  dot(away, away, distance2);
  std::memcpy(out.x.data(), &nearest.x, sizeof(Double4));
  std::memcpy(out.y.data(), &nearest.y, sizeof(Double4));
  std::memcpy(out.z.data(), &nearest.z, sizeof(Double4));
  std::memcpy(out.distance2.data(), &distance2, sizeof(Double4));
  std::memcpy(out.thin.data(), &thin, sizeof(Mask4));
}

/// closest_point_on_triangle (mesh.h) for four triangles: all regions are evaluated, and the first whose condition
/// holds is selected.
TILEFLIGHT_WIDE_VECTORS void nearest_of_four(const std::array<std::array<double, 4>, 3>& corner_a,
                                             const std::array<std::array<double, 4>, 3>& corner_b,
                                             const std::array<std::array<double, 4>, 3>& corner_c, const double* query,
                                             NearestPoints4& out) {
  Vec3x4 a, b, c, ab, ac, bc, ap, bp, cp;
  load(corner_a, a);
  load(corner_b, b);
  load(corner_c, c);
  const Double4 zero{};
  const Vec3x4 p{zero + query[0], zero + query[1], zero + query[2]};
  subtract(b, a, ab);
  subtract(c, a, ac);
  subtract(c, b, bc);
  subtract(p, a, ap);
  subtract(p, b, bp);
  subtract(p, c, cp);
  EdgeProducts4 products;
  edge_products(ab, ac, ap, bp, cp, products);
  const auto& [d1, d2, d3, d4, d5, d6, ab2, ac2] = products;
  const Double4 va = d3 * d6 - d5 * d4;
  const Double4 vb = d5 * d2 - d1 * d6;
  const Double4 vc = d1 * d4 - d3 * d2;
  const Double4 area = va + vb + vc;

  // base + share * side + share_c * ac, from the last region to the first, so that the first that applies is kept.
  Vec3x4 base = a, side = ab;
  Double4 numerator = vb, denominator = area;
  const Mask4 on_bc = (va <= zero) & (d4 >= d3) & (d5 >= d6);
  blend(on_bc, b, base);
  blend(on_bc, bc, side);
  numerator = on_bc ? d4 - d3 : numerator;
  denominator = on_bc ? (d4 - d3) + (d5 - d6) : denominator;
  const Mask4 on_ac = (vb <= zero) & (d2 >= zero) & (d6 <= zero);
  blend(on_ac, a, base);
  blend(on_ac, ac, side);
  numerator = on_ac ? d2 : numerator;
  denominator = on_ac ? d2 - d6 : denominator;
  const Mask4 on_ab = (vc <= zero) & (d1 >= zero) & (d3 <= zero);
  blend(on_ab, a, base);
  blend(on_ab, ab, side);
  numerator = on_ab ? d1 : numerator;
  denominator = on_ab ? d1 - d3 : denominator;
  const Double4 share = numerator / denominator;
  const Double4 share_c = (on_bc | on_ac | on_ab) ? zero : vc / area;
  Vec3x4 nearest{base.x + share * side.x + share_c * ac.x, base.y + share * side.y + share_c * ac.y,
                 base.z + share * side.z + share_c * ac.z};
  Mask4 thin = (area > 1e-12 * ab2 * ac2) ? Mask4{} : Mask4{} - 1;
  const Mask4 at_c = (d6 >= zero) & (d5 <= d6);
  const Mask4 at_b = (d3 >= zero) & (d4 <= d3);
  const Mask4 at_a = (d1 <= zero) & (d2 <= zero);
  blend(at_c, c, nearest);
  blend(at_b, b, nearest);
  blend(at_a, a, nearest);
  thin &= ~(at_a | at_b | at_c);
  write_nearest(nearest, p, thin, out);
}

}  // namespace

TrianglePack::TrianglePack(const TriangleMesh& mesh, std::span<const std::uint32_t> chosen) {
  for (std::size_t place = 0; place < kSize; ++place) {
    triangle_[place] = chosen[std::min(place, chosen.size() - 1)];
    const Triangle& t = mesh.triangles[triangle_[place]];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto k = static_cast<Eigen::Index>(axis);
      a_[axis][place] = mesh.vertices[t[0]][k];
      b_[axis][place] = mesh.vertices[t[1]][k];
      c_[axis][place] = mesh.vertices[t[2]][k];
    }
  }
}

Vec3 TrianglePack::corner(std::size_t which, std::size_t place) const {
  const Corner& corner = which == 0 ? a_ : which == 1 ? b_ : c_;
  return {corner[0][place], corner[1][place], corner[2][place]};
}

TrianglePack::Nearest TrianglePack::nearest(const Vec3& query) const {
  NearestPoints4 four;
  nearest_of_four(a_, b_, c_, query.data(), four);
  Nearest best;
  for (std::size_t i = 0; i < kSize; ++i) {
    Vec3 position(four.x[i], four.y[i], four.z[i]);
    double distance2 = four.distance2[i];
    if (four.thin[i] != 0) {
      position = closest_point_on_triangle(query, corner(0, i), corner(1, i), corner(2, i));
      distance2 = (position - query).squaredNorm();
    }
    if (i == 0 || distance2 < best.distance2 || (distance2 == best.distance2 && triangle_[i] < best.triangle))
      best = {distance2, triangle_[i], position};
  }
  return best;
}

}  // namespace tileflight::geometry
