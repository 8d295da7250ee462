// A beam's way through the tree.
//
// Notation: the beam's frame starts in the point o where all rays start; its z axis is the rays' mean direction and its
// x axis goes along the pixels' rows. A ray is (x, y, 1) there, so each is a point (x, y) of the plane z = 1, a packet
// is a rectangle around eight of them and the beam one around all. With a, b, c the corners of a triangle in that frame
// and r a ray:
//
//   edge functions  r . (b x c), r . (c x a), r . (a x b): all of one sign where r meets the triangle, and in the ratio
//                   of the hit's barycentric weights. With a x b as (a - b) x (a + b) / 2 small triangles far away keep
//                   their digits, and the neighbour across an edge computes exactly the opposite number: no ray slips
//                   between two triangles.
//   nearness        1 / z of the hit, which is r . n / (n . a) with the normal n = (b - a) x (c - a).
//
// The nearest triangle is the one of the greatest nearness; among equals the first by mesh and number. So what a ray
// meets does not depend on the order in which the tree is walked.
#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <limits>

#include "tileflight/scene/beam_tree.h"
#include "tileflight/scene/lanes.h"

namespace tileflight::scene {
namespace {

constexpr int kPackets = 8;
constexpr float kWidest = 1.7F;     // of |x| and |y| of a ray
constexpr float kNothing = 1e-30F;  // nearness where nothing was met
constexpr float kFar = 1e30F;       // farther than anything, and its product with 0 is 0

/// A level holds back at most seven children; Embree's builder makes at most 32 levels.
constexpr std::size_t kStack = 32 * 7 + 1;

/// By how much, relative to the farthest coordinate, rounding may move a box or a plane.
constexpr float kBoxSlack = 4e-6F;
/// The same for a corner's x and y on the plane z = 1, relative to 1.
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

/// Eight vectors.
struct Vectors {
  Float8 x, y, z;
};

TILEFLIGHT_LANE_INLINE void subtract(const Vectors& a, const Vectors& b, Vectors& to) {
  to.x = a.x - b.x;
  to.y = a.y - b.y;
  to.z = a.z - b.z;
}

TILEFLIGHT_LANE_INLINE void cross(const Vectors& a, const Vectors& b, Vectors& to) {
  to.x = a.y * b.z - a.z * b.y;
  to.y = a.z * b.x - a.x * b.z;
  to.z = a.x * b.y - a.y * b.x;
}

/// 2 a x b.
TILEFLIGHT_LANE_INLINE void edge_normal(const Vectors& a, const Vectors& b, Vectors& to) {
  Vectors edge, sum;
  subtract(a, b, edge);
  sum.x = a.x + b.x;
  sum.y = a.y + b.y;
  sum.z = a.z + b.z;
  cross(edge, sum, to);
}

/// The rays and what they have met so far.
struct Beam {
  Vector3 origin, axis_x, axis_y, axis_z;  ///< of the beam's frame, in the scene's
  Float8 ray_x[kPackets], ray_y[kPackets];
  Float8 along[kPackets];                  ///< z of the ray as it was given
  Float8 low_x, high_x, low_y, high_y;     ///< rectangles, a packet a lane; inside out where there is none
  float least_x, most_x, least_y, most_y;  ///< the rectangle around all

  Float8 nearness[kPackets];
  Float8 weight_a[kPackets], weight_b[kPackets], weight_c[kPackets];  ///< not of sum 1
  Vectors normal[kPackets];
  Int8 mesh[kPackets], triangle[kPackets];

  float least_near[kPackets];                          ///< of the packet's rays
  float farthest = std::numeric_limits<float>::max();  ///< z beyond which nothing can be the nearest of any ray
  unsigned touched = 0;                                ///< packets whose hits changed since `farthest` was set
};

/// The four sides of the pyramid around the beam and its axis, so arranged that eight boxes are compared at once: of
/// each axis, the faces of the boxes that matter.
struct Pyramid {
  struct Side {
    float x, y, z;
    float least;   ///< a box is outside whose farthest corner inwards is below
    bool high[3];  ///< that corner is on the upper face of the axis
  };
  Side sides[4];
  Side depth;  ///< the nearest corner along the axis
};

TILEFLIGHT_LANE_INLINE Pyramid::Side side_of(const Vector3& normal, const Vector3& origin, float slack, bool nearest) {
  Pyramid::Side side{normal.x, normal.y, normal.z, dot(normal, origin) - slack, {}};
  side.high[0] = (normal.x > 0.0F) != nearest;
  side.high[1] = (normal.y > 0.0F) != nearest;
  side.high[2] = (normal.z > 0.0F) != nearest;
  return side;
}

TILEFLIGHT_LANE_INLINE Pyramid pyramid_of(const Beam& beam, float reach_m) {
  const Vector3& o = beam.origin;
  const float slack = kBoxSlack * (reach_m + std::abs(o.x) + std::abs(o.y) + std::abs(o.z));
  const Vector3 &x = beam.axis_x, &y = beam.axis_y, &z = beam.axis_z;
  Pyramid pyramid;
  pyramid.sides[0] = side_of(minus(x, scaled(z, beam.least_x)), o, slack, false);
  pyramid.sides[1] = side_of(minus(scaled(z, beam.most_x), x), o, slack, false);
  pyramid.sides[2] = side_of(minus(y, scaled(z, beam.least_y)), o, slack, false);
  pyramid.sides[3] = side_of(minus(scaled(z, beam.most_y), y), o, slack, false);
  pyramid.depth = side_of(z, o, -slack, true);
  return pyramid;
}

/// Signed distances of the eight boxes' corners from the side, where negative is outside.
TILEFLIGHT_LANE_INLINE void corners_inside(const Pyramid::Side& side, const BeamNode& node, Float8& inside) {
  const Float8 x = load(side.high[0] ? node.high[0] : node.low[0]);
  const Float8 y = load(side.high[1] ? node.high[1] : node.low[1]);
  const Float8 z = load(side.high[2] ? node.high[2] : node.low[2]);
  inside = side.x * x + side.y * y + side.z * z - side.least;
}

/// A direction across `z`.
TILEFLIGHT_LANE_INLINE Vector3 any_across(const Vector3& z) {
  const Vector3 other = std::abs(z.x) < 0.6F ? Vector3{1.0F, 0.0F, 0.0F} : Vector3{0.0F, 1.0F, 0.0F};
  return minus(other, scaled(z, dot(other, z)));
}

/// The beam's frame; false where the rays have no mean direction.
TILEFLIGHT_LANE_INLINE bool aim(std::span<const RayPacket8> packets, Beam& beam) {
  Vectors sums{};
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
  if (!(dot(x, x) > 1e-20F)) x = any_across(z);
  beam.origin = {first.origin_x[0], first.origin_y[0], first.origin_z[0]};
  beam.axis_x = scaled(x, 1.0F / std::sqrt(dot(x, x)));
  beam.axis_y = cross(z, beam.axis_x);
  beam.axis_z = z;
  return true;
}

TILEFLIGHT_LANE_INLINE void along_axis(const Vectors& v, const Vector3& axis, Float8& to) {
  to = axis.x * v.x + axis.y * v.y + axis.z * v.z;
}

/// The rays in the beam's frame, and their rectangles; false where a ray is too far from the axis.
TILEFLIGHT_LANE_INLINE bool place_rays(std::span<const RayPacket8> packets, Beam& beam) {
  const Float8 none = Float8{} + kFar;
  beam.low_x = beam.low_y = none;
  beam.high_x = beam.high_y = -none;
  for (std::size_t p = 0; p < packets.size(); ++p) {
    const RayPacket8& packet = packets[p];
    const Vectors ray{load(packet.direction_x), load(packet.direction_y), load(packet.direction_z)};
    Float8 x, y;
    along_axis(ray, beam.axis_x, x);
    along_axis(ray, beam.axis_y, y);
    along_axis(ray, beam.axis_z, beam.along[p]);
    beam.ray_x[p] = x / beam.along[p];
    beam.ray_y[p] = y / beam.along[p];
    if (!(smallest(beam.along[p]) > 0.0F)) return false;
    beam.low_x[p] = smallest(beam.ray_x[p]);
    beam.low_y[p] = smallest(beam.ray_y[p]);
    beam.high_x[p] = -smallest(-beam.ray_x[p]);
    beam.high_y[p] = -smallest(-beam.ray_y[p]);
  }
  beam.least_x = smallest(beam.low_x);
  beam.least_y = smallest(beam.low_y);
  beam.most_x = -smallest(-beam.high_x);
  beam.most_y = -smallest(-beam.high_y);
  return beam.least_x > -kWidest && beam.most_x < kWidest && beam.least_y > -kWidest && beam.most_y < kWidest;
}

/// Nothing met; lanes that are off are nearer than anything.
TILEFLIGHT_LANE_INLINE void clear_hits(std::span<const RayPacket8> packets, Beam& beam) {
  for (std::size_t p = 0; p < packets.size(); ++p) {
    const Float8 off = Float8{} + std::numeric_limits<float>::max();
    const Float8 on = Float8{} + kNothing;
    beam.nearness[p] = load(packets[p].far) < 0.0F ? off : on;
    beam.least_near[p] = smallest(beam.nearness[p]);
    beam.mesh[p] = Int8{} - 1;  // RayPacket8::kMiss
    beam.triangle[p] = Int8{};
    beam.weight_a[p] = beam.weight_b[p] = beam.weight_c[p] = Float8{};
    beam.normal[p] = Vectors{};
  }
}

/// Eight triangles as the beam's rays are tested against them.
struct alignas(32) Facets {
  Float8 edge_bc[3], edge_ca[3], edge_ab[3];  ///< edge functions, positive within
  Float8 nearness[3];
  Vectors normal;                       ///< n, by the winding, along the scene's axes
  Float8 low_x, high_x, low_y, high_y;  ///< rectangle around the triangle on the plane z = 1
};

/// A corner of each triangle, seen from where the rays start.
TILEFLIGHT_LANE_INLINE void from_origin(const Beam& beam, const float (&corner)[3][8], Vectors& to) {
  to.x = load(corner[0]) - beam.origin.x;
  to.y = load(corner[1]) - beam.origin.y;
  to.z = load(corner[2]) - beam.origin.z;
}

TILEFLIGHT_LANE_INLINE void to_beam(const Beam& beam, const Vectors& v, Vectors& to) {
  along_axis(v, beam.axis_x, to.x);
  along_axis(v, beam.axis_y, to.y);
  along_axis(v, beam.axis_z, to.z);
}

/// Rectangle around the corners' images; the whole plane unless all are in front.
TILEFLIGHT_LANE_INLINE void bound(const Vectors& a, const Vectors& b, const Vectors& c, Facets& facets) {
  const Float8 nearest = smaller(smaller(a.z, b.z), c.z);
  const Float8 a_1 = 1.0F / a.z, b_1 = 1.0F / b.z, c_1 = 1.0F / c.z;
  const Float8 xs[3] = {a.x * a_1, b.x * b_1, c.x * c_1};
  const Float8 ys[3] = {a.y * a_1, b.y * b_1, c.y * c_1};
  const Float8 all = Float8{} + kFar;
  const Int8 in_front = nearest > kNothing;
  facets.low_x = in_front ? smaller(smaller(xs[0], xs[1]), xs[2]) - kPlaneSlack : -all;
  facets.low_y = in_front ? smaller(smaller(ys[0], ys[1]), ys[2]) - kPlaneSlack : -all;
  facets.high_x = in_front ? larger(larger(xs[0], xs[1]), xs[2]) + kPlaneSlack : all;
  facets.high_y = in_front ? larger(larger(ys[0], ys[1]), ys[2]) + kPlaneSlack : all;
}

/// `turn`: the sign bit of n . a in each lane.
TILEFLIGHT_LANE_INLINE void turned(const Vectors& normal, const Int8& turn, Float8 (&to)[3]) {
  to[0] = (Float8)((Int8)normal.x ^ turn);
  to[1] = (Float8)((Int8)normal.y ^ turn);
  to[2] = (Float8)((Int8)normal.z ^ turn);
}

/// The planes that the triangles lie in, from their corners as seen from the origin but along the scene's axes, where
/// large level surfaces keep their digits. `turn`: the sign bit of n . a in each lane; returns the bit of each place
/// whose plane is not seen edge-on.
TILEFLIGHT_LANE_INLINE unsigned set_up_planes(const Beam& beam, const Vectors& a, const Vectors& b, const Vectors& c,
                                              Facets& facets, Int8& turn) {
  Vectors ab, ac;
  subtract(b, a, ab);
  subtract(c, a, ac);
  cross(ab, ac, facets.normal);
  const Float8 volume = facets.normal.x * a.x + facets.normal.y * a.y + facets.normal.z * a.z;
  const Float8 per_volume = 1.0F / volume;
  Vectors n;
  to_beam(beam, facets.normal, n);
  facets.nearness[0] = n.x * per_volume;
  facets.nearness[1] = n.y * per_volume;
  facets.nearness[2] = n.z * per_volume;
  turn = (Int8)volume & std::numeric_limits<std::int32_t>::min();
  const Float8 xy = larger(magnitude(facets.nearness[0]), magnitude(facets.nearness[1]));
  return sign_bits(larger(xy, magnitude(facets.nearness[2])) < kFar);
}

/// Bit of each place whose triangle the beam may meet.
TILEFLIGHT_LANE_INLINE unsigned set_up(const Beam& beam, const BeamLeaf& leaf, Facets& facets) {
  Vectors corners[3], a, b, c;
  for (int which = 0; which < 3; ++which) from_origin(beam, leaf.corner[which], corners[which]);
  to_beam(beam, corners[0], a);
  to_beam(beam, corners[1], b);
  to_beam(beam, corners[2], c);
  bound(a, b, c, facets);
  const unsigned near = sign_bits((facets.low_x <= beam.most_x) & (facets.high_x >= beam.least_x) &
                                  (facets.low_y <= beam.most_y) & (facets.high_y >= beam.least_y));
  const unsigned places = near & ((1U << leaf.count) - 1U);
  if (places == 0) return 0;
  Int8 turn;
  const unsigned seen = set_up_planes(beam, corners[0], corners[1], corners[2], facets, turn);
  Vectors edge;
  edge_normal(b, c, edge);
  turned(edge, turn, facets.edge_bc);
  edge_normal(c, a, edge);
  turned(edge, turn, facets.edge_ca);
  edge_normal(a, b, edge);
  turned(edge, turn, facets.edge_ab);
  return places & seen;
}

TILEFLIGHT_LANE_INLINE void plane(const Float8 (&coefficients)[3], int place, const Float8& x, const Float8& y,
                                  Float8& value) {
  value = coefficients[0][place] * x + coefficients[1][place] * y + coefficients[2][place];
}

/// Lanes where the triangle is nearer than what was met before, or as near and first by its numbers.
TILEFLIGHT_LANE_INLINE void first_of_equals(const Beam& beam, int p, const Float8& nearness, const Int8& mesh,
                                            const Int8& triangle, Int8& hit) {
  const Int8 before = (mesh < beam.mesh[p]) | ((mesh == beam.mesh[p]) & (triangle < beam.triangle[p]));
  hit &= (nearness > beam.nearness[p]) | before;
}

/// Tests one triangle against one packet.
TILEFLIGHT_LANE_INLINE void test(Beam& beam, const BeamLeaf& leaf, const Facets& facets, int place, int p) {
  const Float8 x = beam.ray_x[p], y = beam.ray_y[p];
  Float8 a, b, c, nearness;
  plane(facets.edge_bc, place, x, y, a);
  plane(facets.edge_ca, place, x, y, b);
  plane(facets.edge_ab, place, x, y, c);
  plane(facets.nearness, place, x, y, nearness);
  const Int8 outside = (Int8)a | (Int8)b | (Int8)c | (Int8)(nearness - beam.nearness[p]);
  if (sign_bits(outside) == 0xFFU) return;
  Int8 hit = ~outside >> 31;
  const Int8 mesh = Int8{} + static_cast<std::int32_t>(leaf.mesh[place]);
  const Int8 triangle = Int8{} + static_cast<std::int32_t>(leaf.triangle[place]);
  first_of_equals(beam, p, nearness, mesh, triangle, hit);
  beam.nearness[p] = hit ? nearness : beam.nearness[p];
  beam.weight_a[p] = hit ? a : beam.weight_a[p];
  beam.weight_b[p] = hit ? b : beam.weight_b[p];
  beam.weight_c[p] = hit ? c : beam.weight_c[p];
  beam.normal[p].x = hit ? Float8{} + facets.normal.x[place] : beam.normal[p].x;
  beam.normal[p].y = hit ? Float8{} + facets.normal.y[place] : beam.normal[p].y;
  beam.normal[p].z = hit ? Float8{} + facets.normal.z[place] : beam.normal[p].z;
  beam.mesh[p] = hit ? mesh : beam.mesh[p];
  beam.triangle[p] = hit ? triangle : beam.triangle[p];
  beam.touched |= 1U << static_cast<unsigned>(p);
}

/// Bit of each packet whose rectangle the triangle's overlaps.
TILEFLIGHT_LANE_INLINE unsigned packets_under(const Beam& beam, const Facets& facets, int place) {
  return sign_bits((beam.low_x <= facets.high_x[place]) & (beam.high_x >= facets.low_x[place]) &
                   (beam.low_y <= facets.high_y[place]) & (beam.high_y >= facets.low_y[place]));
}

/// Tests every triangle against every packet that may meet it.
TILEFLIGHT_LANE_INLINE void meet_leaf(const BeamLeaf& leaf, Beam& beam) {
  Facets facets;
  std::uint64_t pairs = 0;  // bit 8 place + packet
  for (unsigned places = set_up(beam, leaf, facets); places != 0; places &= places - 1) {
    const int place = std::countr_zero(places);
    pairs |= static_cast<std::uint64_t>(packets_under(beam, facets, place)) << (8 * place);
  }
  for (; pairs != 0; pairs &= pairs - 1) {
    const int pair = std::countr_zero(pairs);
    test(beam, leaf, facets, pair / 8, pair % 8);
  }
}

/// Sets `farthest` by the least near of the hits.
TILEFLIGHT_LANE_INLINE void draw_in(std::size_t packets, Beam& beam) {
  for (unsigned touched = beam.touched; touched != 0; touched &= touched - 1) {
    const int p = std::countr_zero(touched);
    beam.least_near[p] = smallest(beam.nearness[p]);
  }
  beam.touched = 0;
  float least = beam.least_near[0];
  for (std::size_t p = 1; p < packets; ++p) least = std::min(least, beam.least_near[p]);
  beam.farthest = 1.0F / least;
}

struct Entry {
  float depth_m;
  BeamNode::Child child;
};

/// Asks for a child's memory while others are looked at.
TILEFLIGHT_LANE_INLINE void fetch(BeamNode::Child child) {
  const auto* bytes = reinterpret_cast<const char*>(child & ~BeamNode::Child{1});
  for (std::size_t line = 0; line < sizeof(BeamLeaf); line += 64) __builtin_prefetch(bytes + line);
}

/// Puts the children that the pyramid touches on the stack, the nearest on top.
TILEFLIGHT_LANE_INLINE std::size_t push_children(const BeamNode& node, const Pyramid& pyramid, float farthest,
                                                 Entry* stack, std::size_t size) {
  Float8 inside[4], depths;
  for (int side = 0; side < 4; ++side) corners_inside(pyramid.sides[side], node, inside[side]);
  corners_inside(pyramid.depth, node, depths);
  const Int8 outside =
      (Int8)inside[0] | (Int8)inside[1] | (Int8)inside[2] | (Int8)inside[3] | (Int8)(farthest - depths);
  const std::size_t bottom = size;
  for (unsigned children = ~sign_bits(outside) & 0xFFU; children != 0; children &= children - 1) {
    const int k = std::countr_zero(children);
    const float depth_m = depths[k];
    std::size_t at = size++;
    for (; at > bottom && stack[at - 1].depth_m < depth_m; --at) stack[at] = stack[at - 1];
    stack[at] = {depth_m, node.child[k]};
    fetch(node.child[k]);
  }
  return size;
}

TILEFLIGHT_LANE_INLINE void walk(BeamNode::Child root, const Pyramid& pyramid, std::size_t packets, Beam& beam) {
  std::array<Entry, kStack> stack;
  std::size_t size = 0;
  stack[size++] = {-std::numeric_limits<float>::infinity(), root};
  while (size > 0) {
    const Entry entry = stack[--size];
    if (entry.depth_m > beam.farthest) continue;
    if ((entry.child & 1U) == 0) {
      const auto& node = *reinterpret_cast<const BeamNode*>(entry.child);
      size = push_children(node, pyramid, beam.farthest, stack.data(), size);
      continue;
    }
    meet_leaf(*reinterpret_cast<const BeamLeaf*>(entry.child & ~BeamNode::Child{1}), beam);
    if (beam.touched != 0) draw_in(packets, beam);
  }
}

TILEFLIGHT_LANE_INLINE void write_hits(const Beam& beam, int p, RayPacket8& packet) {
  const Int8 hit = beam.mesh[p] != -1;
  const Float8 sum = beam.weight_a[p] + beam.weight_b[p] + beam.weight_c[p];
  const Float8 scale = 1.0F / (sum > 0.0F ? sum : Float8{} + 1.0F);
  store(hit ? 1.0F / (beam.nearness[p] * beam.along[p]) : load(packet.far), packet.far);
  store(beam.normal[p].x, packet.normal_x);
  store(beam.normal[p].y, packet.normal_y);
  store(beam.normal[p].z, packet.normal_z);
  store(beam.weight_b[p] * scale, packet.u);
  store(beam.weight_c[p] * scale, packet.v);
  store(beam.mesh[p], packet.mesh);
  store(beam.triangle[p], packet.triangle);
}

TILEFLIGHT_WIDE_VECTORS bool intersect_beam(BeamNode::Child root, float reach_m, std::span<RayPacket8> packets) {
  Beam beam;
  if (!aim(packets, beam) || !place_rays(packets, beam)) return false;
  clear_hits(packets, beam);
  walk(root, pyramid_of(beam, reach_m), packets.size(), beam);
  for (std::size_t p = 0; p < packets.size(); ++p) write_hits(beam, static_cast<int>(p), packets[p]);
  return true;
}

}  // namespace

bool BeamTree::intersect(std::span<RayPacket8> beam) const {
  assert(!beam.empty() && beam.size() <= kPackets);
  return intersect_beam(root_, reach_m_, beam);
}

}  // namespace tileflight::scene
