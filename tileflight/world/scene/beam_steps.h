#pragma once

// Steps that beams of one origin (beam_traversal.cpp, whose notation holds here) and of many (moving_beam.cpp) share.
// To be included by these two alone, which are compiled with -Wno-psabi, so that functions may return vectors: since
// they are always inlined, no calling convention is involved.

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>

#include "tileflight/core/base/simd.h"
#include "tileflight/world/scene/beam_tree.h"

namespace tileflight::scene::beam_steps {

using base::Float8;
using base::horizontal_min;
using base::Int8;
using base::sign_mask;

constexpr float kMaxSlope = 1.7F;             // maximum |x| and |y| of a ray
constexpr float kNoHitInverseDepth = 1e-30F;  // inverse depth if nothing was hit
constexpr float kFar = 1e30F;                 // beyond all coordinates; finite, so that its product with 0 is 0

/// At most seven children are deferred per level; Embree's builder makes at most 32 levels, and a tree of parts stands
/// above the parts' trees.
constexpr std::size_t kStackSize = 2 * 32 * 7 + 1;

/// Bound on the rounding error of a box or a plane, relative to the largest coordinate.
constexpr float kBoxSlack = 4e-6F;
/// Bound on the rounding error of a corner's x and y on the plane z = 1, relative to 1.
constexpr float kPlaneSlack = 4e-6F;

struct Vector3 {
  float x, y, z;
};

TILEFLIGHT_LANE_INLINE float dot(const Vector3& a, const Vector3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
TILEFLIGHT_LANE_INLINE Vector3 cross(const Vector3& a, const Vector3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
TILEFLIGHT_LANE_INLINE Vector3 scaled(const Vector3& a, float by) { return {a.x * by, a.y * by, a.z * by}; }
TILEFLIGHT_LANE_INLINE Vector3 minus(const Vector3& a, const Vector3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }

TILEFLIGHT_LANE_INLINE Float8 lane_min(const Float8& a, const Float8& b) { return a < b ? a : b; }
TILEFLIGHT_LANE_INLINE Float8 lane_max(const Float8& a, const Float8& b) { return a > b ? a : b; }
TILEFLIGHT_LANE_INLINE Float8 lane_abs(const Float8& a) { return (Float8)((Int8)a & 0x7FFFFFFF); }

TILEFLIGHT_LANE_INLINE Float8 load(const float (&from)[8]) {
  Float8 lanes;
  base::load_float8(from, lanes);
  return lanes;
}

/// Eight vectors.
struct Vector3x8 {
  Float8 x, y, z;
};

TILEFLIGHT_LANE_INLINE void subtract(const Vector3x8& a, const Vector3x8& b, Vector3x8& to) {
  to.x = a.x - b.x;
  to.y = a.y - b.y;
  to.z = a.z - b.z;
}

TILEFLIGHT_LANE_INLINE void cross(const Vector3x8& a, const Vector3x8& b, Vector3x8& to) {
  to.x = a.y * b.z - a.z * b.y;
  to.y = a.z * b.x - a.x * b.z;
  to.z = a.x * b.y - a.y * b.x;
}

/// Returns 2 a x b.
TILEFLIGHT_LANE_INLINE void edge_normal(const Vector3x8& a, const Vector3x8& b, Vector3x8& to) {
  Vector3x8 edge, sum;
  subtract(a, b, edge);
  sum.x = a.x + b.x;
  sum.y = a.y + b.y;
  sum.z = a.z + b.z;
  cross(edge, sum, to);
}

/// The frame of a beam's rays.
struct BeamFrame {
  Vector3 origin, axis_x, axis_y, axis_z;  ///< in scene axes
  Vector3 normal_x, normal_y, normal_z;    ///< the same axes, for normals: others where space is scaled
};

/// A rectangle of the plane z = 1 in a beam's frame.
struct BeamBounds {
  float min_x, max_x, min_y, max_y;
};

/// The four sides of the pyramid around the beam, and its axis, arranged for testing eight boxes at once: for each
/// axis, the relevant faces of the boxes.
struct BeamFrustum {
  struct Side {
    float x, y, z;
    float offset;  ///< a box is outside if its innermost corner is below
    bool high[3];  ///< that corner is on the upper face of the axis
  };
  Side sides[4];
  Side depth;  ///< for the nearest corner along the axis
};

TILEFLIGHT_LANE_INLINE BeamFrustum::Side side_of(const Vector3& normal, const Vector3& origin, float slack,
                                                 bool nearest) {
  BeamFrustum::Side side{normal.x, normal.y, normal.z, dot(normal, origin) - slack, {}};
  side.high[0] = (normal.x > 0.0F) != nearest;
  side.high[1] = (normal.y > 0.0F) != nearest;
  side.high[2] = (normal.z > 0.0F) != nearest;
  return side;
}

TILEFLIGHT_LANE_INLINE float magnitude(const Vector3& v) { return std::abs(v.x) + std::abs(v.y) + std::abs(v.z); }

/// Makes the pyramid around all rays from the frame's origin within the bounds. `reach_m`: largest absolute coordinate
/// of a corner.
TILEFLIGHT_LANE_INLINE BeamFrustum make_frustum(const BeamFrame& frame, const BeamBounds& bounds, float reach_m) {
  const Vector3& o = frame.origin;
  const float slack = kBoxSlack * (reach_m + magnitude(o));
  const Vector3 &x = frame.axis_x, &y = frame.axis_y, &z = frame.axis_z;
  BeamFrustum pyramid;
  pyramid.sides[0] = side_of(minus(x, scaled(z, bounds.min_x)), o, slack, false);
  pyramid.sides[1] = side_of(minus(scaled(z, bounds.max_x), x), o, slack, false);
  pyramid.sides[2] = side_of(minus(y, scaled(z, bounds.min_y)), o, slack, false);
  pyramid.sides[3] = side_of(minus(scaled(z, bounds.max_y), y), o, slack, false);
  pyramid.depth = side_of(z, o, -slack, true);
  return pyramid;
}

/// Returns the signed distances of the eight boxes' corners from the side; negative is outside.
TILEFLIGHT_LANE_INLINE void plane_distances(const BeamFrustum::Side& side, const BeamNode& node, Float8& inside) {
  const Float8 x = load(side.high[0] ? node.high[0] : node.low[0]);
  const Float8 y = load(side.high[1] ? node.high[1] : node.low[1]);
  const Float8 z = load(side.high[2] ? node.high[2] : node.low[2]);
  inside = side.x * x + side.y * y + side.z * z - side.offset;
}

/// Returns a direction perpendicular to `z`.
TILEFLIGHT_LANE_INLINE Vector3 any_perpendicular(const Vector3& z) {
  const Vector3 other = std::abs(z.x) < 0.6F ? Vector3{1.0F, 0.0F, 0.0F} : Vector3{0.0F, 1.0F, 0.0F};
  return minus(other, scaled(z, dot(other, z)));
}

/// Adds up the packets' directions.
TILEFLIGHT_LANE_INLINE void add_directions(std::span<const RayPacket8> packets, Vector3x8& sums) {
  for (const RayPacket8& packet : packets) {
    sums.x += load(packet.direction_x);
    sums.y += load(packet.direction_y);
    sums.z += load(packet.direction_z);
  }
}

/// Builds the frame, but for its origin: along the sum of all directions, and along the rows of the first packet; false
/// if the rays have no mean direction.
TILEFLIGHT_LANE_INLINE bool build_axes(const Vector3x8& sums, const RayPacket8& first, BeamFrame& frame) {
  Vector3 sum{0.0F, 0.0F, 0.0F};
  for (int i = 0; i < 8; ++i) sum = {sum.x + sums.x[i], sum.y + sums.y[i], sum.z + sums.z[i]};
  const float length = std::sqrt(dot(sum, sum));
  if (!(length > 0.0F && length < kFar)) return false;
  const Vector3 z = scaled(sum, 1.0F / length);
  const Vector3 row{first.direction_x[3] - first.direction_x[0], first.direction_y[3] - first.direction_y[0],
                    first.direction_z[3] - first.direction_z[0]};
  Vector3 x = minus(row, scaled(z, dot(row, z)));
  if (!(dot(x, x) > 1e-20F)) x = any_perpendicular(z);
  frame.axis_x = scaled(x, 1.0F / std::sqrt(dot(x, x)));
  frame.axis_y = cross(z, frame.axis_x);
  frame.axis_z = z;
  frame.normal_x = frame.axis_x;
  frame.normal_y = frame.axis_y;
  frame.normal_z = frame.axis_z;
  return true;
}

TILEFLIGHT_LANE_INLINE void dot_axis(const Vector3x8& v, const Vector3& axis, Float8& to) {
  to = axis.x * v.x + axis.y * v.y + axis.z * v.z;
}

/// Projects a packet's rays to points of the plane z = 1; also returns the z components of their directions.
TILEFLIGHT_LANE_INLINE void to_plane(const BeamFrame& frame, const RayPacket8& packet, Float8& x, Float8& y,
                                     Float8& direction_z) {
  const Vector3x8 ray{load(packet.direction_x), load(packet.direction_y), load(packet.direction_z)};
  Float8 along_x, along_y;
  dot_axis(ray, frame.axis_x, along_x);
  dot_axis(ray, frame.axis_y, along_y);
  dot_axis(ray, frame.axis_z, direction_z);
  x = along_x / direction_z;
  y = along_y / direction_z;
}

TILEFLIGHT_LANE_INLINE bool is_narrow(const BeamBounds& bounds) {
  return bounds.min_x > -kMaxSlope && bounds.max_x < kMaxSlope && bounds.min_y > -kMaxSlope && bounds.max_y < kMaxSlope;
}

struct Entry {
  float depth_m;
  std::uint32_t first_mesh;  ///< of the part that the child belongs to
  BeamNode::Child child;
};

/// Prefetches a child while others are processed.
TILEFLIGHT_LANE_INLINE void prefetch(BeamNode::Child child) {
  const auto* bytes = reinterpret_cast<const char*>(child & ~BeamNode::Child{1});
  for (std::size_t line = 0; line < sizeof(BeamLeaf); line += 64) __builtin_prefetch(bytes + line);
}

/// Pushes the children that intersect the pyramid, the nearest on top.
TILEFLIGHT_LANE_INLINE std::size_t push_children(const BeamNode& node, std::uint32_t first_mesh,
                                                 const BeamFrustum& pyramid, float farthest, Entry* stack,
                                                 std::size_t size) {
  Float8 inside[4], depths;
  for (int side = 0; side < 4; ++side) plane_distances(pyramid.sides[side], node, inside[side]);
  plane_distances(pyramid.depth, node, depths);
  const Int8 outside =
      (Int8)inside[0] | (Int8)inside[1] | (Int8)inside[2] | (Int8)inside[3] | (Int8)(farthest - depths);
  const std::size_t bottom = size;
  for (unsigned children = ~sign_mask((Int8)outside) & 0xFFU; children != 0; children &= children - 1) {
    const int k = std::countr_zero(children);
    if (node.child[k] == 0) continue;  // its empty box is within the rounding errors of coordinates beyond all measure
    const float depth_m = depths[k];
    std::size_t at = size++;
    for (; at > bottom && stack[at - 1].depth_m < depth_m; --at) stack[at] = stack[at - 1];
    stack[at] = {depth_m, first_mesh, node.child[k]};
    if ((node.child[k] & 2U) == 0) prefetch(node.child[k]);
  }
  return size;
}

/// The nearest hits so far of eight rays.
struct Hits8 {
  Float8 inverse_depth;
  Float8 weight_a, weight_b, weight_c;  ///< not normalised to sum 1
  Vector3x8 normal;
  Int8 mesh, triangle;
};

/// Removes all hits; disabled lanes get an inverse depth above any hit.
TILEFLIGHT_LANE_INLINE void clear_hits(const RayPacket8& packet, Hits8& hits) {
  hits.inverse_depth =
      load(packet.far) < 0.0F ? Float8{} + std::numeric_limits<float>::max() : Float8{} + kNoHitInverseDepth;
  hits.mesh = Int8{} - 1;  // RayPacket8::kMiss
  hits.triangle = Int8{};
  hits.weight_a = hits.weight_b = hits.weight_c = Float8{};
  hits.normal = Vector3x8{};
}

/// Stores the hits in a packet. `direction_z`: z components of the rays' original directions.
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

/// Returns the bits of a leaf's triangles whose rectangles overlap the beam's.
TILEFLIGHT_LANE_INLINE unsigned overlapping_triangles(const BeamBounds& beam, const BeamLeaf& leaf,
                                                      const TriangleSetup8& facets) {
  const unsigned near = sign_mask((facets.low_x <= beam.max_x) & (facets.high_x >= beam.min_x) &
                                  (facets.low_y <= beam.max_y) & (facets.high_y >= beam.min_y));
  return near & ((1U << leaf.count) - 1U);
}

/// Returns the bits of the packets whose rectangles overlap a triangle's.
TILEFLIGHT_LANE_INLINE unsigned overlapping_packets(const PacketRectangles& packets, const TriangleSetup8& facets,
                                                    int place) {
  return sign_mask((packets.low_x <= facets.high_x[place]) & (packets.high_x >= facets.low_x[place]) &
                   (packets.low_y <= facets.high_y[place]) & (packets.high_y >= facets.low_y[place]));
}

/// Computes the bounding rectangle of the projected corners; the whole plane unless all corners are in front.
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

/// Flips the signs of the normals' components where n . a is negative. `turn`: the sign bit of n . a in each lane.
TILEFLIGHT_LANE_INLINE void flip_signs(const Vector3x8& normal, const Int8& turn, Float8 (&to)[3]) {
  to[0] = (Float8)((Int8)normal.x ^ turn);
  to[1] = (Float8)((Int8)normal.y ^ turn);
  to[2] = (Float8)((Int8)normal.z ^ turn);
}

/// Computes the planes of the triangles from their corners relative to the origin but in scene axes, which keeps the
/// precision of large level surfaces. `turn`: the sign bit of n . a in each lane. Returns the bits of the triangles
/// that are not seen edge-on.
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

/// Returns the numbers of a leaf's triangle in all lanes.
struct TriangleNumbers8 {
  Int8 mesh, triangle;
};

TILEFLIGHT_LANE_INLINE TriangleNumbers8 numbers_of(const BeamLeaf& leaf, std::uint32_t first_mesh, int place) {
  return {Int8{} + static_cast<std::int32_t>(first_mesh + leaf.mesh[place]),
          Int8{} + static_cast<std::int32_t>(leaf.triangle[place])};
}

/// Returns the lanes where a triangle at that inverse depth is nearer than the hit so far, or equally near and first by
/// its numbers.
TILEFLIGHT_LANE_INLINE Int8 nearer_lanes(const Hits8& hits, const Float8& inverse_depth,
                                         const TriangleNumbers8& numbers) {
  const Int8 before = (numbers.mesh < hits.mesh) | ((numbers.mesh == hits.mesh) & (numbers.triangle < hits.triangle));
  return (inverse_depth > hits.inverse_depth) | ((inverse_depth == hits.inverse_depth) & before);
}

/// Stores a triangle's hits in the lanes of `hit`. `a`, `b`, `c`: its edge functions there.
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
