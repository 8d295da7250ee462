#pragma once

// Tests of eight triangles against packets of rays: what beams of one origin (beam_traversal.cpp, whose notation holds
// here) and of many (moving_beam.cpp) share. To be included by these alone, as beam_steps.h.

#include <cstdint>
#include <cstring>
#include <limits>

#include "tileflight/core/base/simd.h"
#include "tileflight/world/scene/beam_steps.h"

namespace tileflight::scene::beam_steps {

/// The nearest hits so far of eight rays.
struct Hits8 {
  Float8 inverse_depth;
  Float8 weight_a, weight_b, weight_c;  ///< not normalised to sum 1
  Vector3x8 normal;
  Int8 mesh, triangle;
};

/// No hits; disabled lanes get an inverse depth above any hit.
TILEFLIGHT_LANE_INLINE void clear_hits(const RayPacket8& packet, Hits8& hits) {
  hits.inverse_depth =
      load(packet.far) < 0.0F ? Float8{} + std::numeric_limits<float>::max() : Float8{} + kNoHitInverseDepth;
  hits.mesh = Int8{} - 1;  // RayPacket8::kMiss
  hits.triangle = Int8{};
  hits.weight_a = hits.weight_b = hits.weight_c = Float8{};
  hits.normal = Vector3x8{};
}

/// `direction_z`: z components of the rays' original directions.
TILEFLIGHT_LANE_INLINE void write_hits(const Hits8& hits, const Float8& direction_z, RayPacket8& packet) {
  const Int8 hit = hits.mesh != -1;
  const Float8 sum = hits.weight_a + hits.weight_b + hits.weight_c;
  const Float8 scale = 1.0F / (sum > 0.0F ? sum : Float8{} + 1.0F);
  base::store_float8(hit ? 1.0F / (hits.inverse_depth * direction_z) : load(packet.far), packet.far);
  base::store_float8(hits.inverse_depth, packet.nearness);
  base::store_float8(hits.normal.x, packet.normal_x);
  base::store_float8(hits.normal.y, packet.normal_y);
  base::store_float8(hits.normal.z, packet.normal_z);
  base::store_float8(hits.weight_b * scale, packet.u);
  base::store_float8(hits.weight_c * scale, packet.v);
  std::memcpy(packet.mesh, &hits.mesh, sizeof(packet.mesh));
  std::memcpy(packet.triangle, &hits.triangle, sizeof(packet.triangle));
}

/// Bounding rectangles of up to eight packets on the plane z = 1, one a lane; low > high for unused lanes.
struct PacketRectangles {
  Float8 low_x, high_x, low_y, high_y;
};

TILEFLIGHT_LANE_INLINE void clear_rectangles(PacketRectangles& to) {
  const Float8 none = Float8{} + kFar;
  to.low_x = to.low_y = none;
  to.high_x = to.high_y = -none;
}

TILEFLIGHT_LANE_INLINE void set_rectangle(const Float8& x, const Float8& y, std::size_t packet, PacketRectangles& to) {
  to.low_x[packet] = horizontal_min(x);
  to.low_y[packet] = horizontal_min(y);
  to.high_x[packet] = -horizontal_min(-x);
  to.high_y[packet] = -horizontal_min(-y);
}

/// Eight triangles, prepared for tests against the beam's rays.
struct alignas(32) TriangleSetup8 {
  Float8 edge_bc[3], edge_ca[3], edge_ab[3];  ///< edge functions, positive inside
  Float8 inverse_depth[3];
  Vector3x8 normal;                     ///< n, oriented by the winding, in scene axes
  Float8 low_x, high_x, low_y, high_y;  ///< bounding rectangle of the triangle on the plane z = 1
};

/// A corner of each triangle, relative to the beam's origin.
TILEFLIGHT_LANE_INLINE void from_origin(const BeamFrame& frame, const float (&corner)[3][8], Vector3x8& to) {
  to.x = load(corner[0]) - frame.origin.x;
  to.y = load(corner[1]) - frame.origin.y;
  to.z = load(corner[2]) - frame.origin.z;
}

TILEFLIGHT_LANE_INLINE void to_beam(const BeamFrame& frame, const Vector3x8& v, Vector3x8& to) {
  dot_axis(v, frame.axis_x, to.x);
  dot_axis(v, frame.axis_y, to.y);
  dot_axis(v, frame.axis_z, to.z);
}

/// Corners of eight triangles relative to a beam's origin, in the scene's and in the beam's axes.
struct LeafCorners {
  Vector3x8 scene[3], beam[3];
};

TILEFLIGHT_LANE_INLINE void load_corners(const BeamFrame& frame, const BeamLeaf& leaf, LeafCorners& to) {
  for (int which = 0; which < 3; ++which) {
    from_origin(frame, leaf.corner[which], to.scene[which]);
    to_beam(frame, to.scene[which], to.beam[which]);
  }
}

/// Bits of a leaf's triangles whose rectangles overlap the beam's.
TILEFLIGHT_LANE_INLINE unsigned overlapping_triangles(const BeamBounds& beam, const BeamLeaf& leaf,
                                                      const TriangleSetup8& facets) {
  const unsigned near = sign_mask((facets.low_x <= beam.max_x) & (facets.high_x >= beam.min_x) &
                                  (facets.low_y <= beam.max_y) & (facets.high_y >= beam.min_y));
  return near & ((1U << leaf.count) - 1U);
}

/// Bits of the packets whose rectangles overlap a triangle's.
TILEFLIGHT_LANE_INLINE unsigned overlapping_packets(const PacketRectangles& packets, const TriangleSetup8& facets,
                                                    int place) {
  return sign_mask((packets.low_x <= facets.high_x[place]) & (packets.high_x >= facets.low_x[place]) &
                   (packets.low_y <= facets.high_y[place]) & (packets.high_y >= facets.low_y[place]));
}

/// Bounding rectangle of the projected corners; the whole plane unless all corners are in front.
TILEFLIGHT_LANE_INLINE void bound(const Vector3x8& a, const Vector3x8& b, const Vector3x8& c, TriangleSetup8& facets) {
  const Float8 nearest = lane_min(lane_min(a.z, b.z), c.z);
  const Float8 a_1 = 1.0F / a.z, b_1 = 1.0F / b.z, c_1 = 1.0F / c.z;
  const Float8 xs[3] = {a.x * a_1, b.x * b_1, c.x * c_1};
  const Float8 ys[3] = {a.y * a_1, b.y * b_1, c.y * c_1};
  const Float8 all = Float8{} + kFar;
  const Int8 in_front = nearest > kNoHitInverseDepth;
  facets.low_x = in_front ? lane_min(lane_min(xs[0], xs[1]), xs[2]) - kPlaneSlack : -all;
  facets.low_y = in_front ? lane_min(lane_min(ys[0], ys[1]), ys[2]) - kPlaneSlack : -all;
  facets.high_x = in_front ? lane_max(lane_max(xs[0], xs[1]), xs[2]) + kPlaneSlack : all;
  facets.high_y = in_front ? lane_max(lane_max(ys[0], ys[1]), ys[2]) + kPlaneSlack : all;
}

/// `turn`: the sign bit of n . a in each lane.
TILEFLIGHT_LANE_INLINE void flip_signs(const Vector3x8& normal, const Int8& turn, Float8 (&to)[3]) {
  to[0] = (Float8)((Int8)normal.x ^ turn);
  to[1] = (Float8)((Int8)normal.y ^ turn);
  to[2] = (Float8)((Int8)normal.z ^ turn);
}

/// Planes of the triangles, from their corners relative to the origin but in scene axes, which keeps the precision of
/// large level surfaces. `turn`: the sign bit of n . a in each lane; returns the bits of the triangles that are not
/// seen edge-on.
TILEFLIGHT_LANE_INLINE unsigned set_up_planes(const BeamFrame& frame, const Vector3x8 (&corners)[3],
                                              TriangleSetup8& facets, Int8& turn, Float8& per_volume) {
  const auto& [a, b, c] = corners;
  Vector3x8 ab, ac;
  subtract(b, a, ab);
  subtract(c, a, ac);
  cross(ab, ac, facets.normal);
  const Float8 volume = facets.normal.x * a.x + facets.normal.y * a.y + facets.normal.z * a.z;
  per_volume = 1.0F / volume;
  Vector3x8 n;
  dot_axis(facets.normal, frame.normal_x, n.x);
  dot_axis(facets.normal, frame.normal_y, n.y);
  dot_axis(facets.normal, frame.normal_z, n.z);
  facets.inverse_depth[0] = n.x * per_volume;
  facets.inverse_depth[1] = n.y * per_volume;
  facets.inverse_depth[2] = n.z * per_volume;
  turn = (Int8)volume & std::numeric_limits<std::int32_t>::min();
  const Float8 xy = lane_max(lane_abs(facets.inverse_depth[0]), lane_abs(facets.inverse_depth[1]));
  return sign_mask(lane_max(xy, lane_abs(facets.inverse_depth[2])) < kFar);
}

TILEFLIGHT_LANE_INLINE void evaluate_plane(const Float8 (&coefficients)[3], int place, const Float8& x, const Float8& y,
                                           Float8& value) {
  value = coefficients[0][place] * x + coefficients[1][place] * y + coefficients[2][place];
}

/// Numbers of a leaf's triangle in all lanes.
struct TriangleNumbers8 {
  Int8 mesh, triangle;
};

TILEFLIGHT_LANE_INLINE TriangleNumbers8 numbers_of(const BeamLeaf& leaf, std::uint32_t first_mesh, int place) {
  return {Int8{} + static_cast<std::int32_t>(first_mesh + leaf.mesh[place]),
          Int8{} + static_cast<std::int32_t>(leaf.triangle[place])};
}

/// Lanes where a triangle at that inverse depth is nearer than the hit so far, or equally near and first by its
/// numbers.
TILEFLIGHT_LANE_INLINE Int8 nearer_lanes(const Hits8& hits, const Float8& inverse_depth,
                                         const TriangleNumbers8& numbers) {
  const Int8 before = (numbers.mesh < hits.mesh) | ((numbers.mesh == hits.mesh) & (numbers.triangle < hits.triangle));
  return (inverse_depth > hits.inverse_depth) | ((inverse_depth == hits.inverse_depth) & before);
}

/// Takes over a triangle's hits in the lanes of `hit`. `a`, `b`, `c`: its edge functions there.
TILEFLIGHT_LANE_INLINE void take_hits(const Int8& hit, const Float8& inverse_depth, const Float8& a, const Float8& b,
                                      const Float8& c, const TriangleSetup8& facets, int place,
                                      const TriangleNumbers8& numbers, Hits8& hits) {
  hits.inverse_depth = hit ? inverse_depth : hits.inverse_depth;
  hits.weight_a = hit ? a : hits.weight_a;
  hits.weight_b = hit ? b : hits.weight_b;
  hits.weight_c = hit ? c : hits.weight_c;
  hits.normal.x = hit ? Float8{} + facets.normal.x[place] : hits.normal.x;
  hits.normal.y = hit ? Float8{} + facets.normal.y[place] : hits.normal.y;
  hits.normal.z = hit ? Float8{} + facets.normal.z[place] : hits.normal.z;
  hits.mesh = hit ? numbers.mesh : hits.mesh;
  hits.triangle = hit ? numbers.triangle : hits.triangle;
}

}  // namespace tileflight::scene::beam_steps
