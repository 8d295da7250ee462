// Traversal of the tree by rays whose origins differ a little, such as those of a camera that moves while its rows are
// read out.
//
// Notation: as in beam_traversal.cpp. The frame's origin o is the middle of all origins, which are o + d. A ray's
// corners are a - d, b - d, c - d, so that
//
//   edge functions  r . ((a - b) x (a + b - 2 d)) = r . ((a - b) x (a + b)) + (a - b) . 2 (r x d)
//   inverse depth   r . n / (n . (a - d)) = (r . n / n . a) / (1 - (n / n . a) . d)
//
// The second terms are what a ray adds to the set-up of a triangle, which all rays share: 2 (r x d) is its moment
// (Pluecker's coordinates), computed once. The neighbour across an edge still computes exactly the opposite number, and
// with d = 0 all results are those of beam_traversal.cpp, to the last bit.
//
// Bounds: with a plane's normal m, m . (o + d + t r) >= m . o + min m . d on the inner side, so the pyramid's planes
// move outwards by what the rays' offsets need. A corner (x, y, z) seen from o + d instead of o moves on the plane z =
// 1 by (x d_z / z - d_x, y d_z / z - d_y) / (z - d_z).
#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <limits>
#include <span>

#include "tileflight/core/base/simd.h"
#include "tileflight/world/scene/beam_steps.h"
#include "tileflight/world/scene/beam_tree.h"

namespace tileflight::scene {
namespace {

using namespace beam_steps;

using Beams = std::span<const std::span<RayPacket8>>;

constexpr std::size_t kGroupPackets = 8;

/// Eight rays, and their nearest hits so far.
struct MovingRays : Hits8 {
  Float8 x, y;
  Float8 direction_z;  ///< z component of the ray's original direction
  Vector3x8 offset;    ///< d, scene axes
  Vector3x8 in_frame;  ///< d, the frame's axes
  Vector3x8 moment;    ///< 2 (r x d), the frame's axes
};

/// The packets of one of the given beams.
struct RayGroup : PacketRectangles {
  Float8 min_inverse_depth;   ///< minimum over each packet's rays
  float least_inverse_depth;  ///< minimum of these
  std::size_t size;
  std::array<MovingRays, kGroupPackets> rays;
};

struct MovingBeam : BeamFrame, BeamBounds {
  std::size_t size;  ///< groups
  std::array<RayGroup, kMostMovingBeams> groups;
  Vector3 reach;                                        ///< largest absolute offsets, the frame's axes
  float far_offset;                                     ///< largest offset along z
  float max_depth = std::numeric_limits<float>::max();  ///< from o; z beyond which no hit can be the nearest of any ray
};

TILEFLIGHT_LANE_INLINE void load_origins(const RayPacket8& packet, Vector3x8& to) {
  to.x = load(packet.origin_x);
  to.y = load(packet.origin_y);
  to.z = load(packet.origin_z);
}

/// The middle of the box around all origins.
TILEFLIGHT_LANE_INLINE Vector3 middle_origin(Beams beams) {
  const Float8 none = Float8{} + std::numeric_limits<float>::max();
  Vector3x8 low{none, none, none}, high{-none, -none, -none};
  for (const std::span<RayPacket8> packets : beams) {
    for (const RayPacket8& packet : packets) {
      Vector3x8 origin;
      load_origins(packet, origin);
      low = {lane_min(low.x, origin.x), lane_min(low.y, origin.y), lane_min(low.z, origin.z)};
      high = {lane_max(high.x, origin.x), lane_max(high.y, origin.y), lane_max(high.z, origin.z)};
    }
  }
  const auto middle = [](const Float8& from, const Float8& to) {
    const float start = horizontal_min(from), end = -horizontal_min(-to);
    return start + 0.5F * (end - start);
  };
  return {middle(low.x, high.x), middle(low.y, high.y), middle(low.z, high.z)};
}

TILEFLIGHT_LANE_INLINE bool build_moving_frame(Beams beams, MovingBeam& beam) {
  Vector3x8 sums{};
  for (const std::span<RayPacket8> packets : beams) add_directions(packets, sums);
  if (!build_axes(sums, beams.front().front(), beam)) return false;
  beam.origin = middle_origin(beams);
  return true;
}

/// A packet's rays in the frame, without hits; disabled lanes get an inverse depth above any hit.
TILEFLIGHT_LANE_INLINE void set_up_rays(const BeamFrame& frame, const RayPacket8& packet, MovingRays& rays) {
  to_plane(frame, packet, rays.x, rays.y, rays.direction_z);
  load_origins(packet, rays.offset);
  rays.offset.x -= frame.origin.x;
  rays.offset.y -= frame.origin.y;
  rays.offset.z -= frame.origin.z;
  to_beam(frame, rays.offset, rays.in_frame);
  const Vector3x8& d = rays.in_frame;
  rays.moment.x = 2.0F * (rays.y * d.z - d.y);
  rays.moment.y = 2.0F * (d.x - rays.x * d.z);
  rays.moment.z = 2.0F * (rays.x * d.y - rays.y * d.x);
  clear_hits(packet, rays);
}

/// Transforms the packets and computes their rectangles; false if a ray is too far from the axis.
TILEFLIGHT_LANE_INLINE bool set_up_group(const BeamFrame& frame, std::span<const RayPacket8> packets, RayGroup& group) {
  clear_rectangles(group);
  group.min_inverse_depth = Float8{} + kFar;
  group.size = packets.size();
  for (std::size_t p = 0; p < packets.size(); ++p) {
    MovingRays& rays = group.rays[p];
    set_up_rays(frame, packets[p], rays);
    if (!(horizontal_min(rays.direction_z) > 0.0F)) return false;
    set_rectangle(rays.x, rays.y, p, group);
    group.min_inverse_depth[p] = horizontal_min(rays.inverse_depth);
  }
  group.least_inverse_depth = horizontal_min(group.min_inverse_depth);
  return true;
}

TILEFLIGHT_LANE_INLINE bool set_up_groups(Beams beams, MovingBeam& beam) {
  beam.size = beams.size();
  beam.min_x = beam.min_y = kFar;
  beam.max_x = beam.max_y = -kFar;
  for (std::size_t g = 0; g < beam.size; ++g) {
    RayGroup& group = beam.groups[g];
    if (!set_up_group(beam, beams[g], group)) return false;
    beam.min_x = std::min(beam.min_x, horizontal_min(group.low_x));
    beam.min_y = std::min(beam.min_y, horizontal_min(group.low_y));
    beam.max_x = std::max(beam.max_x, -horizontal_min(-group.high_x));
    beam.max_y = std::max(beam.max_y, -horizontal_min(-group.high_y));
  }
  return is_narrow(beam);
}

/// The pyramid of the rays' directions from the frame's origin, its sides moved outwards by the rays' offsets.
TILEFLIGHT_LANE_INLINE BeamFrustum make_moving_frustum(MovingBeam& beam, float reach_m) {
  Float8 inside[4] = {}, nearest{}, farthest{};
  Vector3x8 widest{};
  for (std::size_t g = 0; g < beam.size; ++g) {
    const RayGroup& group = beam.groups[g];
    for (std::size_t p = 0; p < group.size; ++p) {
      const Vector3x8& d = group.rays[p].in_frame;
      inside[0] = lane_min(inside[0], d.x - beam.min_x * d.z);
      inside[1] = lane_min(inside[1], beam.max_x * d.z - d.x);
      inside[2] = lane_min(inside[2], d.y - beam.min_y * d.z);
      inside[3] = lane_min(inside[3], beam.max_y * d.z - d.y);
      nearest = lane_min(nearest, d.z);
      farthest = lane_max(farthest, d.z);
      widest.x = lane_max(widest.x, lane_abs(d.x));
      widest.y = lane_max(widest.y, lane_abs(d.y));
    }
  }
  beam.far_offset = -horizontal_min(-farthest);
  beam.reach = {-horizontal_min(-widest.x), -horizontal_min(-widest.y),
                std::max(beam.far_offset, -horizontal_min(nearest))};
  BeamFrustum pyramid = make_frustum(beam, beam, reach_m);
  for (int side = 0; side < 4; ++side) pyramid.sides[side].offset += horizontal_min(inside[side]);
  return pyramid;
}

/// Eight triangles, prepared for tests against rays from nearby.
struct alignas(32) MovingSetup8 : TriangleSetup8 {
  Float8 along_bc[3], along_ca[3], along_ab[3];  ///< edges, the frame's axes, with the edge functions' signs
  Vector3x8 plane;                               ///< n / (n . a), scene axes
};

/// Widens the rectangles to what rays from nearby may see of the triangles. `a`, `b`, `c`: corners.
TILEFLIGHT_LANE_INLINE void widen(const Vector3& reach, const Vector3x8& a, const Vector3x8& b, const Vector3x8& c,
                                  TriangleSetup8& facets) {
  const Float8 nearest = lane_min(lane_min(a.z, b.z), c.z) - reach.z;
  const Float8 all = Float8{} + kFar;
  const Int8 in_front = nearest > kNoHitInverseDepth;
  const Float8 scale = 1.0F / nearest;
  const Float8 x = (reach.x + reach.z * lane_max(lane_abs(facets.low_x), lane_abs(facets.high_x))) * scale;
  const Float8 y = (reach.y + reach.z * lane_max(lane_abs(facets.low_y), lane_abs(facets.high_y))) * scale;
  facets.low_x = in_front ? facets.low_x - x : -all;
  facets.low_y = in_front ? facets.low_y - y : -all;
  facets.high_x = in_front ? facets.high_x + x : all;
  facets.high_y = in_front ? facets.high_y + y : all;
}

TILEFLIGHT_LANE_INLINE void set_up_edge(const Vector3x8& a, const Vector3x8& b, const Int8& turn, Float8 (&edge)[3],
                                        Float8 (&along)[3]) {
  Vector3x8 value;
  edge_normal(a, b, value);
  flip_signs(value, turn, edge);
  subtract(a, b, value);
  flip_signs(value, turn, along);
}

/// Bits of the triangles that the beam may hit.
TILEFLIGHT_LANE_INLINE unsigned set_up_triangles(const MovingBeam& beam, const BeamLeaf& leaf, MovingSetup8& facets) {
  LeafCorners corners;
  load_corners(beam, leaf, corners);
  const auto& [a, b, c] = corners.beam;
  bound(a, b, c, facets);
  widen(beam.reach, a, b, c, facets);
  const unsigned places = overlapping_triangles(beam, leaf, facets);
  if (places == 0) return 0;
  Int8 turn;
  Float8 per_volume;
  const unsigned seen = set_up_planes(beam, corners.scene, facets, turn, per_volume);
  facets.plane = {facets.normal.x * per_volume, facets.normal.y * per_volume, facets.normal.z * per_volume};
  set_up_edge(b, c, turn, facets.edge_bc, facets.along_bc);
  set_up_edge(c, a, turn, facets.edge_ca, facets.along_ca);
  set_up_edge(a, b, turn, facets.edge_ab, facets.along_ab);
  return places & seen;
}

TILEFLIGHT_LANE_INLINE void evaluate_edge(const Float8 (&edge)[3], const Float8 (&along)[3], int place,
                                          const MovingRays& rays, Float8& value) {
  evaluate_plane(edge, place, rays.x, rays.y, value);
  value += along[0][place] * rays.moment.x + along[1][place] * rays.moment.y + along[2][place] * rays.moment.z;
}

/// Tests one triangle against one packet; whether a hit changed.
TILEFLIGHT_LANE_INLINE bool test_triangle(const BeamLeaf& leaf, std::uint32_t first_mesh, const MovingSetup8& facets,
                                          int place, MovingRays& rays) {
  const Float8 share = 1.0F - (facets.plane.x[place] * rays.offset.x + facets.plane.y[place] * rays.offset.y +
                               facets.plane.z[place] * rays.offset.z);
  const Int8 turn = (Int8)share & std::numeric_limits<std::int32_t>::min();
  Float8 a, b, c, inverse_depth;
  evaluate_edge(facets.edge_bc, facets.along_bc, place, rays, a);
  evaluate_edge(facets.edge_ca, facets.along_ca, place, rays, b);
  evaluate_edge(facets.edge_ab, facets.along_ab, place, rays, c);
  a = (Float8)((Int8)a ^ turn);
  b = (Float8)((Int8)b ^ turn);
  c = (Float8)((Int8)c ^ turn);
  const Int8 outside = (Int8)a | (Int8)b | (Int8)c;
  if (sign_mask(outside) == 0xFFU) return false;
  evaluate_plane(facets.inverse_depth, place, rays.x, rays.y, inverse_depth);
  inverse_depth /= share;
  const TriangleNumbers8 numbers = numbers_of(leaf, first_mesh, place);
  const Int8 nearer = nearer_lanes(rays, inverse_depth, numbers);
  const Int8 hit = (~outside >> 31) & nearer & (inverse_depth < kFar);  // not seen edge-on
  if (sign_mask(hit) == 0) return false;
  take_hits(hit, inverse_depth, a, b, c, facets, place, numbers, rays);
  return true;
}

/// Tests the leaf's triangles against every packet of a group that may hit them; whether a hit changed.
TILEFLIGHT_LANE_INLINE bool intersect_group(const BeamLeaf& leaf, std::uint32_t first_mesh, const MovingSetup8& facets,
                                            unsigned places, RayGroup& group) {
  unsigned updated = 0;
  for (; places != 0; places &= places - 1) {
    const int place = std::countr_zero(places);
    unsigned packets = overlapping_packets(group, facets, place);
    for (; packets != 0; packets &= packets - 1) {
      const int p = std::countr_zero(packets);
      if (test_triangle(leaf, first_mesh, facets, place, group.rays[static_cast<std::size_t>(p)])) updated |= 1U << p;
    }
  }
  if (updated == 0) return false;
  for (; updated != 0; updated &= updated - 1) {
    const int p = std::countr_zero(updated);
    group.min_inverse_depth[p] = horizontal_min(group.rays[static_cast<std::size_t>(p)].inverse_depth);
  }
  group.least_inverse_depth = horizontal_min(group.min_inverse_depth);
  return true;
}

/// Sets `max_depth` from the farthest of the packets' hits.
TILEFLIGHT_LANE_INLINE void tighten_bound(MovingBeam& beam) {
  float least = beam.groups[0].least_inverse_depth;
  for (std::size_t g = 1; g < beam.size; ++g) least = std::min(least, beam.groups[g].least_inverse_depth);
  beam.max_depth = 1.0F / least + beam.far_offset;
}

TILEFLIGHT_LANE_INLINE void intersect_leaf(const BeamLeaf& leaf, std::uint32_t first_mesh, MovingBeam& beam) {
  MovingSetup8 facets;
  const unsigned places = set_up_triangles(beam, leaf, facets);
  if (places == 0) return;
  bool is_updated = false;
  for (std::size_t g = 0; g < beam.size; ++g)
    is_updated = intersect_group(leaf, first_mesh, facets, places, beam.groups[g]) || is_updated;
  if (is_updated) tighten_bound(beam);
}

/// Data of the whole query that a placed part's query needs.
struct PartQuery {
  std::span<const BeamBranch> branches;
  float reach_m;
  Beams beams;
};

bool is_same_ray_start(const RayPacket8& a, int i, const RayPacket8& b, int j) {
  return a.origin_x[i] == b.origin_x[j] && a.origin_y[i] == b.origin_y[j] && a.origin_z[i] == b.origin_z[j] &&
         a.time[i] == b.time[j];
}

/// Takes over a lane's hit on a placed part, if it is the nearest.
void take_hit(const RayPacket8& found, int i, MovingRays& rays) {
  const float inverse_depth = 1.0F / (found.far[i] * rays.direction_z[i]);
  const auto mesh = static_cast<std::int32_t>(found.mesh[i]), triangle = static_cast<std::int32_t>(found.triangle[i]);
  const bool before = mesh < rays.mesh[i] || (mesh == rays.mesh[i] && triangle < rays.triangle[i]);
  if (inverse_depth < rays.inverse_depth[i] || (inverse_depth == rays.inverse_depth[i] && !before)) return;
  rays.inverse_depth[i] = inverse_depth;
  rays.weight_a[i] = 1.0F - found.u[i] - found.v[i];
  rays.weight_b[i] = found.u[i];
  rays.weight_c[i] = found.v[i];
  rays.normal.x[i] = found.normal_x[i];
  rays.normal.y[i] = found.normal_y[i];
  rays.normal.z[i] = found.normal_z[i];
  rays.mesh[i] = mesh;
  rays.triangle[i] = triangle;
}

/// The lanes of a group that start as lane `i` of packet `p` does, cast as a beam through a placed part. `pending`: one
/// byte a packet, of lanes that were not cast. False if they diverge too much.
bool cast_equal_starts(const PartQuery& query, BeamNode::Child part, std::span<const RayPacket8> packets, std::size_t p,
                       int i, std::array<std::uint8_t, kGroupPackets>& pending, RayGroup& group) {
  std::array<RayPacket8, kGroupPackets> beam;
  std::array<std::size_t, kGroupPackets> of{};
  std::size_t size = 0;
  for (std::size_t k = p; k < packets.size(); ++k) {
    unsigned lanes = 0;
    for (int lane = 0; lane < RayPacket8::kLanes; ++lane) {
      if (is_same_ray_start(packets[p], i, packets[k], lane)) lanes |= 1U << static_cast<unsigned>(lane);
    }
    lanes &= pending[k];
    if (lanes == 0) continue;
    pending[k] = static_cast<std::uint8_t>(pending[k] & ~lanes);
    beam[size] = packets[k];
    for (int lane = 0; lane < RayPacket8::kLanes; ++lane) {
      if ((lanes >> static_cast<unsigned>(lane) & 1U) == 0) beam[size].disable_lane(lane);
    }
    of[size++] = k;
  }
  // The first packet's first lane stands for all of them.
  beam[0].origin_x[0] = packets[p].origin_x[i];
  beam[0].origin_y[0] = packets[p].origin_y[i];
  beam[0].origin_z[0] = packets[p].origin_z[i];
  beam[0].time[0] = packets[p].time[i];
  if (!intersect_beam(part, query.branches, query.reach_m, std::span(beam).first(size))) return false;
  for (std::size_t k = 0; k < size; ++k) {
    for (int lane = 0; lane < RayPacket8::kLanes; ++lane) {
      if (beam[k].mesh[lane] != RayPacket8::kMiss) take_hit(beam[k], lane, group.rays[of[k]]);
    }
  }
  return true;
}

/// Casts the rays through a placed part: those with a common origin and time at once. False if they diverge too much.
__attribute__((noinline)) bool traverse_placed(const PartQuery& query, BeamNode::Child part, MovingBeam& beam) {
  for (std::size_t g = 0; g < beam.size; ++g) {
    RayGroup& group = beam.groups[g];
    std::array<std::uint8_t, kGroupPackets> pending{};
    for (std::size_t p = 0; p < group.size; ++p) {
      for (int i = 0; i < RayPacket8::kLanes; ++i) {
        if (!(query.beams[g][p].far[i] < 0.0F)) pending[p] = static_cast<std::uint8_t>(pending[p] | 1U << i);
      }
    }
    for (std::size_t p = 0; p < group.size; ++p) {
      while (pending[p] != 0) {
        const int i = std::countr_zero(pending[p]);
        if (!cast_equal_starts(query, part, query.beams[g], p, i, pending, group)) return false;
      }
      group.min_inverse_depth[p] = horizontal_min(group.rays[p].inverse_depth);
    }
    group.least_inverse_depth = horizontal_min(group.min_inverse_depth);
  }
  tighten_bound(beam);
  return true;
}

TILEFLIGHT_LANE_INLINE bool traverse(BeamNode::Child root, const PartQuery& query, const BeamFrustum& pyramid,
                                     MovingBeam& beam) {
  std::array<Entry, kStackSize> stack;
  std::size_t size = 0;
  stack[size++] = {-std::numeric_limits<float>::infinity(), 0, root};
  while (size > 0) {
    Entry entry = stack[--size];
    if (entry.depth_m > beam.max_depth) continue;
    if ((entry.child & 2U) != 0) {
      const BeamBranch& part = query.branches[entry.child >> 2U];
      if (part.motion != nullptr) {
        if (!traverse_placed(query, entry.child, beam)) return false;
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
  }
  return true;
}

TILEFLIGHT_WIDE_VECTORS bool cast_moving(BeamNode::Child root, const PartQuery& query) {
  MovingBeam beam;
  if (!build_moving_frame(query.beams, beam) || !set_up_groups(query.beams, beam)) return false;
  const BeamFrustum pyramid = make_moving_frustum(beam, query.reach_m);
  if (!traverse(root, query, pyramid, beam)) return false;
  for (std::size_t g = 0; g < beam.size; ++g) {
    for (std::size_t p = 0; p < beam.groups[g].size; ++p) {
      const MovingRays& rays = beam.groups[g].rays[p];
      write_hits(rays, rays.direction_z, query.beams[g][p]);
    }
  }
  return true;
}

}  // namespace

bool intersect_moving_beams(BeamNode::Child root, std::span<const BeamBranch> branches, float reach_m, Beams beams) {
  assert(!beams.empty() && beams.size() <= kMostMovingBeams);
  assert(std::ranges::all_of(beams, [](const auto& one) { return !one.empty() && one.size() <= kGroupPackets; }));
  return cast_moving(root, {branches, reach_m, beams});
}

bool BeamTree::intersect_moving(Beams beams) const { return intersect_moving_beams(root_, {}, reach_m_, beams); }

}  // namespace tileflight::scene
