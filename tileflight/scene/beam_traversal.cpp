// Traversal of the tree by a beam.
//
// Notation: the beam's frame has its origin in the common origin o of all rays; its z axis is the rays' mean direction,
// its x axis is along the pixel rows. A ray has the direction (x, y, 1) in it, so it is a point (x, y) of the plane z =
// 1; a packet is the bounding rectangle of eight such points, and the beam that of all. With a, b, c the corners of a
// triangle in that frame and r a ray:
//
//   edge functions  r . (b x c), r . (c x a), r . (a x b): equal signs if r hits the triangle; proportional to the
//                   barycentric weights of the hit. Computing a x b as (a - b) x (a + b) / 2 keeps the precision of
//                   small distant triangles, and the neighbour across an edge computes exactly the opposite number:
//                   no ray slips between two triangles.
//   inverse depth   1 / z of the hit, which is r . n / (n . a) with the normal n = (b - a) x (c - a).
//
// A placed part has coordinates q of its own, p = M q + t. A beam goes through its tree in these: with the origin
// q_o = M^-1 (o - t), the axis vector e of the beam's frame becomes M^T e for corners, since e . (p - o) = M^T e . (q -
// q_o), and M^-1 e for normals, since M^-1 r is the ray in the part. So x, y and z of the beam's frame, and all that is
// computed from them, are the same as if the part's corners were in the scene.
//
// The nearest triangle has the largest inverse depth; ties are resolved by mesh and triangle number. So hits do not
// depend on the order of traversal.
#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "tileflight/base/simd.h"
#include "tileflight/scene/beam_tree.h"
#include "tileflight/scene/part_motion.h"

namespace tileflight::scene {
namespace {

using base::Float8;
using base::horizontal_min;
using base::Int8;
using base::sign_mask;

constexpr int kPackets = 8;
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

// This file is compiled with -Wno-psabi, so that these may return vectors: since they are always inlined, no calling
// convention is involved.
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

/// 2 a x b.
TILEFLIGHT_LANE_INLINE void edge_normal(const Vector3x8& a, const Vector3x8& b, Vector3x8& to) {
  Vector3x8 edge, sum;
  subtract(a, b, edge);
  sum.x = a.x + b.x;
  sum.y = a.y + b.y;
  sum.z = a.z + b.z;
  cross(edge, sum, to);
}

/// The rays and their nearest hits so far.
struct Beam {
  Vector3 origin, axis_x, axis_y, axis_z;  ///< of the beam's frame, in scene axes
  Vector3 normal_x, normal_y, normal_z;  ///< the same axes, for normals: others where space is scaled (traverse_placed)
  float time;
  Float8 ray_x[kPackets], ray_y[kPackets];
  Float8 direction_z[kPackets];         ///< z component of the ray's original direction
  Float8 low_x, high_x, low_y, high_y;  ///< rectangles, one packet per lane; low > high for unused lanes
  float min_x, max_x, min_y, max_y;     ///< bounding rectangle of all packets

  Float8 inverse_depth[kPackets];
  Float8 weight_a[kPackets], weight_b[kPackets], weight_c[kPackets];  ///< not normalised to sum 1
  Vector3x8 normal[kPackets];
  Int8 mesh[kPackets], triangle[kPackets];

  float min_inverse_depth[kPackets];                    ///< minimum over the packet's rays
  float max_depth = std::numeric_limits<float>::max();  ///< z beyond which no hit can be the nearest of any ray
  unsigned updated_packets = 0;                         ///< packets whose hits changed since `max_depth` was set
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

/// `reach_m`: of all coordinates.
TILEFLIGHT_LANE_INLINE BeamFrustum make_frustum(const Beam& beam, float reach_m) {
  const Vector3& o = beam.origin;
  const float slack = kBoxSlack * (reach_m + magnitude(o));
  const Vector3 &x = beam.axis_x, &y = beam.axis_y, &z = beam.axis_z;
  BeamFrustum pyramid;
  pyramid.sides[0] = side_of(minus(x, scaled(z, beam.min_x)), o, slack, false);
  pyramid.sides[1] = side_of(minus(scaled(z, beam.max_x), x), o, slack, false);
  pyramid.sides[2] = side_of(minus(y, scaled(z, beam.min_y)), o, slack, false);
  pyramid.sides[3] = side_of(minus(scaled(z, beam.max_y), y), o, slack, false);
  pyramid.depth = side_of(z, o, -slack, true);
  return pyramid;
}

/// Signed distances of the eight boxes' corners from the side; negative is outside.
TILEFLIGHT_LANE_INLINE void plane_distances(const BeamFrustum::Side& side, const BeamNode& node, Float8& inside) {
  const Float8 x = load(side.high[0] ? node.high[0] : node.low[0]);
  const Float8 y = load(side.high[1] ? node.high[1] : node.low[1]);
  const Float8 z = load(side.high[2] ? node.high[2] : node.low[2]);
  inside = side.x * x + side.y * y + side.z * z - side.offset;
}

/// A direction perpendicular to `z`.
TILEFLIGHT_LANE_INLINE Vector3 any_perpendicular(const Vector3& z) {
  const Vector3 other = std::abs(z.x) < 0.6F ? Vector3{1.0F, 0.0F, 0.0F} : Vector3{0.0F, 1.0F, 0.0F};
  return minus(other, scaled(z, dot(other, z)));
}

/// Builds the beam's frame; false if the rays have no mean direction.
TILEFLIGHT_LANE_INLINE bool build_frame(std::span<const RayPacket8> packets, Beam& beam) {
  Vector3x8 sums{};
  for (const RayPacket8& packet : packets) {
    sums.x += load(packet.direction_x);
    sums.y += load(packet.direction_y);
    sums.z += load(packet.direction_z);
  }
  Vector3 sum{0.0F, 0.0F, 0.0F};
  for (int i = 0; i < 8; ++i) sum = {sum.x + sums.x[i], sum.y + sums.y[i], sum.z + sums.z[i]};
  const float length = std::sqrt(dot(sum, sum));
  if (!(length > 0.0F && length < kFar)) return false;
  const Vector3 z = scaled(sum, 1.0F / length);
  const RayPacket8& first = packets.front();
  const Vector3 row{first.direction_x[3] - first.direction_x[0], first.direction_y[3] - first.direction_y[0],
                    first.direction_z[3] - first.direction_z[0]};
  Vector3 x = minus(row, scaled(z, dot(row, z)));
  if (!(dot(x, x) > 1e-20F)) x = any_perpendicular(z);
  beam.origin = {first.origin_x[0], first.origin_y[0], first.origin_z[0]};
  beam.axis_x = scaled(x, 1.0F / std::sqrt(dot(x, x)));
  beam.axis_y = cross(z, beam.axis_x);
  beam.axis_z = z;
  beam.normal_x = beam.axis_x;
  beam.normal_y = beam.axis_y;
  beam.normal_z = beam.axis_z;
  beam.time = first.time[0];
  return true;
}

TILEFLIGHT_LANE_INLINE void dot_axis(const Vector3x8& v, const Vector3& axis, Float8& to) {
  to = axis.x * v.x + axis.y * v.y + axis.z * v.z;
}

/// Transforms the rays to the beam's frame and computes their rectangles; false if a ray is too far from the axis.
TILEFLIGHT_LANE_INLINE bool transform_rays(std::span<const RayPacket8> packets, Beam& beam) {
  const Float8 none = Float8{} + kFar;
  beam.low_x = beam.low_y = none;
  beam.high_x = beam.high_y = -none;
  for (std::size_t p = 0; p < packets.size(); ++p) {
    const RayPacket8& packet = packets[p];
    const Vector3x8 ray{load(packet.direction_x), load(packet.direction_y), load(packet.direction_z)};
    Float8 x, y;
    dot_axis(ray, beam.axis_x, x);
    dot_axis(ray, beam.axis_y, y);
    dot_axis(ray, beam.axis_z, beam.direction_z[p]);
    beam.ray_x[p] = x / beam.direction_z[p];
    beam.ray_y[p] = y / beam.direction_z[p];
    if (!(horizontal_min(beam.direction_z[p]) > 0.0F)) return false;
    beam.low_x[p] = horizontal_min(beam.ray_x[p]);
    beam.low_y[p] = horizontal_min(beam.ray_y[p]);
    beam.high_x[p] = -horizontal_min(-beam.ray_x[p]);
    beam.high_y[p] = -horizontal_min(-beam.ray_y[p]);
  }
  beam.min_x = horizontal_min(beam.low_x);
  beam.min_y = horizontal_min(beam.low_y);
  beam.max_x = -horizontal_min(-beam.high_x);
  beam.max_y = -horizontal_min(-beam.high_y);
  return beam.min_x > -kMaxSlope && beam.max_x < kMaxSlope && beam.min_y > -kMaxSlope && beam.max_y < kMaxSlope;
}

/// Resets the hits; disabled lanes get an inverse depth above any hit.
TILEFLIGHT_LANE_INLINE void clear_hits(std::span<const RayPacket8> packets, Beam& beam) {
  for (std::size_t p = 0; p < packets.size(); ++p) {
    const Float8 off = Float8{} + std::numeric_limits<float>::max();
    const Float8 on = Float8{} + kNoHitInverseDepth;
    beam.inverse_depth[p] = load(packets[p].far) < 0.0F ? off : on;
    beam.min_inverse_depth[p] = horizontal_min(beam.inverse_depth[p]);
    beam.mesh[p] = Int8{} - 1;  // RayPacket8::kMiss
    beam.triangle[p] = Int8{};
    beam.weight_a[p] = beam.weight_b[p] = beam.weight_c[p] = Float8{};
    beam.normal[p] = Vector3x8{};
  }
}

/// Eight triangles, prepared for tests against the beam's rays.
struct alignas(32) TriangleSetup8 {
  Float8 edge_bc[3], edge_ca[3], edge_ab[3];  ///< edge functions, positive inside
  Float8 inverse_depth[3];
  Vector3x8 normal;                     ///< n, oriented by the winding, in scene axes
  Float8 low_x, high_x, low_y, high_y;  ///< bounding rectangle of the triangle on the plane z = 1
};

/// A corner of each triangle, relative to the beam's origin.
TILEFLIGHT_LANE_INLINE void from_origin(const Beam& beam, const float (&corner)[3][8], Vector3x8& to) {
  to.x = load(corner[0]) - beam.origin.x;
  to.y = load(corner[1]) - beam.origin.y;
  to.z = load(corner[2]) - beam.origin.z;
}

TILEFLIGHT_LANE_INLINE void to_beam(const Beam& beam, const Vector3x8& v, Vector3x8& to) {
  dot_axis(v, beam.axis_x, to.x);
  dot_axis(v, beam.axis_y, to.y);
  dot_axis(v, beam.axis_z, to.z);
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
TILEFLIGHT_LANE_INLINE unsigned set_up_planes(const Beam& beam, const Vector3x8& a, const Vector3x8& b,
                                              const Vector3x8& c, TriangleSetup8& facets, Int8& turn) {
  Vector3x8 ab, ac;
  subtract(b, a, ab);
  subtract(c, a, ac);
  cross(ab, ac, facets.normal);
  const Float8 volume = facets.normal.x * a.x + facets.normal.y * a.y + facets.normal.z * a.z;
  const Float8 per_volume = 1.0F / volume;
  Vector3x8 n;
  dot_axis(facets.normal, beam.normal_x, n.x);
  dot_axis(facets.normal, beam.normal_y, n.y);
  dot_axis(facets.normal, beam.normal_z, n.z);
  facets.inverse_depth[0] = n.x * per_volume;
  facets.inverse_depth[1] = n.y * per_volume;
  facets.inverse_depth[2] = n.z * per_volume;
  turn = (Int8)volume & std::numeric_limits<std::int32_t>::min();
  const Float8 xy = lane_max(lane_abs(facets.inverse_depth[0]), lane_abs(facets.inverse_depth[1]));
  return sign_mask(lane_max(xy, lane_abs(facets.inverse_depth[2])) < kFar);
}

/// Bits of the triangles that the beam may hit.
TILEFLIGHT_LANE_INLINE unsigned set_up_triangles(const Beam& beam, const BeamLeaf& leaf, TriangleSetup8& facets) {
  Vector3x8 corners[3], a, b, c;
  for (int which = 0; which < 3; ++which) from_origin(beam, leaf.corner[which], corners[which]);
  to_beam(beam, corners[0], a);
  to_beam(beam, corners[1], b);
  to_beam(beam, corners[2], c);
  bound(a, b, c, facets);
  const unsigned near = sign_mask((facets.low_x <= beam.max_x) & (facets.high_x >= beam.min_x) &
                                  (facets.low_y <= beam.max_y) & (facets.high_y >= beam.min_y));
  const unsigned places = near & ((1U << leaf.count) - 1U);
  if (places == 0) return 0;
  Int8 turn;
  const unsigned seen = set_up_planes(beam, corners[0], corners[1], corners[2], facets, turn);
  Vector3x8 edge;
  edge_normal(b, c, edge);
  flip_signs(edge, turn, facets.edge_bc);
  edge_normal(c, a, edge);
  flip_signs(edge, turn, facets.edge_ca);
  edge_normal(a, b, edge);
  flip_signs(edge, turn, facets.edge_ab);
  return places & seen;
}

TILEFLIGHT_LANE_INLINE void evaluate_plane(const Float8 (&coefficients)[3], int place, const Float8& x, const Float8& y,
                                           Float8& value) {
  value = coefficients[0][place] * x + coefficients[1][place] * y + coefficients[2][place];
}

/// Lanes where the triangle is nearer than the hit so far, or equally near and first by its numbers.
TILEFLIGHT_LANE_INLINE void break_ties(const Beam& beam, int p, const Float8& inverse_depth, const Int8& mesh,
                                       const Int8& triangle, Int8& hit) {
  const Int8 before = (mesh < beam.mesh[p]) | ((mesh == beam.mesh[p]) & (triangle < beam.triangle[p]));
  hit &= (inverse_depth > beam.inverse_depth[p]) | before;
}

/// Tests one triangle against one packet.
TILEFLIGHT_LANE_INLINE void test_triangle(Beam& beam, const BeamLeaf& leaf, std::uint32_t first_mesh,
                                          const TriangleSetup8& facets, int place, int p) {
  const Float8 x = beam.ray_x[p], y = beam.ray_y[p];
  Float8 a, b, c, inverse_depth;
  evaluate_plane(facets.edge_bc, place, x, y, a);
  evaluate_plane(facets.edge_ca, place, x, y, b);
  evaluate_plane(facets.edge_ab, place, x, y, c);
  evaluate_plane(facets.inverse_depth, place, x, y, inverse_depth);
  const Int8 outside = (Int8)a | (Int8)b | (Int8)c | (Int8)(inverse_depth - beam.inverse_depth[p]);
  if (sign_mask((Int8)outside) == 0xFFU) return;
  Int8 hit = ~outside >> 31;
  const Int8 mesh = Int8{} + static_cast<std::int32_t>(first_mesh + leaf.mesh[place]);
  const Int8 triangle = Int8{} + static_cast<std::int32_t>(leaf.triangle[place]);
  break_ties(beam, p, inverse_depth, mesh, triangle, hit);
  beam.inverse_depth[p] = hit ? inverse_depth : beam.inverse_depth[p];
  beam.weight_a[p] = hit ? a : beam.weight_a[p];
  beam.weight_b[p] = hit ? b : beam.weight_b[p];
  beam.weight_c[p] = hit ? c : beam.weight_c[p];
  beam.normal[p].x = hit ? Float8{} + facets.normal.x[place] : beam.normal[p].x;
  beam.normal[p].y = hit ? Float8{} + facets.normal.y[place] : beam.normal[p].y;
  beam.normal[p].z = hit ? Float8{} + facets.normal.z[place] : beam.normal[p].z;
  beam.mesh[p] = hit ? mesh : beam.mesh[p];
  beam.triangle[p] = hit ? triangle : beam.triangle[p];
  beam.updated_packets |= 1U << static_cast<unsigned>(p);
}

/// Bits of the packets whose rectangles overlap the triangle's.
TILEFLIGHT_LANE_INLINE unsigned overlapping_packets(const Beam& beam, const TriangleSetup8& facets, int place) {
  return sign_mask((beam.low_x <= facets.high_x[place]) & (beam.high_x >= facets.low_x[place]) &
                   (beam.low_y <= facets.high_y[place]) & (beam.high_y >= facets.low_y[place]));
}

/// Tests every triangle against every packet that may hit it.
TILEFLIGHT_LANE_INLINE void intersect_leaf(const BeamLeaf& leaf, std::uint32_t first_mesh, Beam& beam) {
  TriangleSetup8 facets;
  std::uint64_t pairs = 0;  // bit 8 * place + packet
  for (unsigned places = set_up_triangles(beam, leaf, facets); places != 0; places &= places - 1) {
    const int place = std::countr_zero(places);
    pairs |= static_cast<std::uint64_t>(overlapping_packets(beam, facets, place)) << (8 * place);
  }
  for (; pairs != 0; pairs &= pairs - 1) {
    const int pair = std::countr_zero(pairs);
    test_triangle(beam, leaf, first_mesh, facets, pair / 8, pair % 8);
  }
}

/// Sets `max_depth` from the farthest of the packets' hits.
TILEFLIGHT_LANE_INLINE void tighten_bound(std::size_t packets, Beam& beam) {
  for (unsigned touched = beam.updated_packets; touched != 0; touched &= touched - 1) {
    const int p = std::countr_zero(touched);
    beam.min_inverse_depth[p] = horizontal_min(beam.inverse_depth[p]);
  }
  beam.updated_packets = 0;
  float least = beam.min_inverse_depth[0];
  for (std::size_t p = 1; p < packets; ++p) least = std::min(least, beam.min_inverse_depth[p]);
  beam.max_depth = 1.0F / least;
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
    const float depth_m = depths[k];
    std::size_t at = size++;
    for (; at > bottom && stack[at - 1].depth_m < depth_m; --at) stack[at] = stack[at - 1];
    stack[at] = {depth_m, first_mesh, node.child[k]};
    if ((node.child[k] & 2U) == 0) prefetch(node.child[k]);
  }
  return size;
}

Vector3 vector3(const Eigen::Vector3f& v) { return {v.x(), v.y(), v.z()}; }
Eigen::Vector3f eigen(const Vector3& v) { return {v.x, v.y, v.z}; }

/// Expresses the beam's frame in a placed part's coordinates; returns the reach of all coordinates on the way there.
float enter_part(const BeamBranch& part, Beam& beam) {
  const PartTransform to = part.motion->transform(beam.time);
  const Eigen::Vector3f origin = eigen(beam.origin);
  beam.origin = vector3(to.point_to_part(origin));
  for (auto [axis, normal] : {std::pair(&Beam::axis_x, &Beam::normal_x), std::pair(&Beam::axis_y, &Beam::normal_y),
                              std::pair(&Beam::axis_z, &Beam::normal_z)}) {
    const Eigen::Vector3f e = eigen(beam.*axis);
    beam.*axis = vector3(to.scene_part.transpose() * e);
    beam.*normal = vector3(to.part_scene * e);
  }
  // Distances along an axis are in the scene's metres: so many of them is a metre of the part at most.
  const float scale = std::max(1.0F, to.scene_part.norm());
  return scale * (part.reach_m + magnitude(beam.origin)) + origin.cwiseAbs().sum() + to.origin.cwiseAbs().sum();
}

/// Casts the beam through a placed part's tree. Apart from traverse(), whose loop it would slow down.
__attribute__((noinline)) TILEFLIGHT_WIDE_VECTORS void traverse_placed(const BeamBranch& part, std::size_t packets,
                                                                       Beam& beam);

TILEFLIGHT_LANE_INLINE void traverse(BeamNode::Child root, std::span<const BeamBranch> branches,
                                     const BeamFrustum& pyramid, std::size_t packets, Beam& beam) {
  std::array<Entry, kStackSize> stack;
  std::size_t size = 0;
  stack[size++] = {-std::numeric_limits<float>::infinity(), 0, root};
  while (size > 0) {
    Entry entry = stack[--size];
    if (entry.depth_m > beam.max_depth) continue;
    if ((entry.child & 2U) != 0) {
      const BeamBranch& part = branches[entry.child >> 2U];
      if (part.motion != nullptr) {
        traverse_placed(part, packets, beam);
        continue;
      }
      entry = {entry.depth_m, part.first_mesh, part.root};
    }
    if ((entry.child & 1U) == 0) {
      const auto& node = *reinterpret_cast<const BeamNode*>(entry.child);
      size = push_children(node, entry.first_mesh, pyramid, beam.max_depth, stack.data(), size);
      continue;
    }
    intersect_leaf(*reinterpret_cast<const BeamLeaf*>(entry.child & ~BeamNode::Child{1}), entry.first_mesh, beam);
    if (beam.updated_packets != 0) tighten_bound(packets, beam);
  }
}

void traverse_placed(const BeamBranch& part, std::size_t packets, Beam& beam) {
  const Vector3 outside[7] = {beam.origin,   beam.axis_x,   beam.axis_y,  beam.axis_z,
                              beam.normal_x, beam.normal_y, beam.normal_z};
  const float reach_m = enter_part(part, beam);
  const BeamFrustum pyramid = make_frustum(beam, reach_m);
  std::array<Entry, kStackSize / 2 + 1> stack;
  std::size_t size = 0;
  stack[size++] = {-std::numeric_limits<float>::infinity(), part.first_mesh, part.root};
  while (size > 0) {
    const Entry entry = stack[--size];
    if (entry.depth_m > beam.max_depth) continue;
    if ((entry.child & 1U) == 0) {
      const auto& node = *reinterpret_cast<const BeamNode*>(entry.child);
      size = push_children(node, entry.first_mesh, pyramid, beam.max_depth, stack.data(), size);
      continue;
    }
    intersect_leaf(*reinterpret_cast<const BeamLeaf*>(entry.child & ~BeamNode::Child{1}), entry.first_mesh, beam);
    if (beam.updated_packets != 0) tighten_bound(packets, beam);
  }
  beam.origin = outside[0];
  beam.axis_x = outside[1];
  beam.axis_y = outside[2];
  beam.axis_z = outside[3];
  beam.normal_x = outside[4];
  beam.normal_y = outside[5];
  beam.normal_z = outside[6];
}

TILEFLIGHT_LANE_INLINE void write_hits(const Beam& beam, int p, RayPacket8& packet) {
  const Int8 hit = beam.mesh[p] != -1;
  const Float8 sum = beam.weight_a[p] + beam.weight_b[p] + beam.weight_c[p];
  const Float8 scale = 1.0F / (sum > 0.0F ? sum : Float8{} + 1.0F);
  base::store_float8(hit ? 1.0F / (beam.inverse_depth[p] * beam.direction_z[p]) : load(packet.far), packet.far);
  base::store_float8(beam.normal[p].x, packet.normal_x);
  base::store_float8(beam.normal[p].y, packet.normal_y);
  base::store_float8(beam.normal[p].z, packet.normal_z);
  base::store_float8(beam.weight_b[p] * scale, packet.u);
  base::store_float8(beam.weight_c[p] * scale, packet.v);
  std::memcpy(packet.mesh, &beam.mesh[p], sizeof(packet.mesh));
  std::memcpy(packet.triangle, &beam.triangle[p], sizeof(packet.triangle));
}

TILEFLIGHT_WIDE_VECTORS bool cast_beam(BeamNode::Child root, std::span<const BeamBranch> branches, float reach_m,
                                       std::span<RayPacket8> packets) {
  Beam beam;
  if (!build_frame(packets, beam) || !transform_rays(packets, beam)) return false;
  clear_hits(packets, beam);
  traverse(root, branches, make_frustum(beam, reach_m), packets.size(), beam);
  for (std::size_t p = 0; p < packets.size(); ++p) write_hits(beam, static_cast<int>(p), packets[p]);
  return true;
}

}  // namespace

bool intersect_beam(BeamNode::Child root, std::span<const BeamBranch> branches, float reach_m,
                    std::span<RayPacket8> beam) {
  assert(!beam.empty() && beam.size() <= kPackets);
  return cast_beam(root, branches, reach_m, beam);
}

bool BeamTree::intersect(std::span<RayPacket8> beam) const { return intersect_beam(root_, {}, reach_m_, beam); }

}  // namespace tileflight::scene
