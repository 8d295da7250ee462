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
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <limits>
#include <utility>

#include "tileflight/core/base/simd.h"
#include "tileflight/world/scene/beam_steps.h"
#include "tileflight/world/scene/beam_tree.h"
#include "tileflight/world/scene/part_motion.h"

namespace tileflight::scene {
namespace {

using namespace beam_steps;

constexpr int kPackets = 8;

/// The rays and their nearest hits so far.
struct Beam : BeamFrame, BeamBounds, PacketRectangles {
  float time;
  Float8 ray_x[kPackets], ray_y[kPackets];
  Float8 direction_z[kPackets];  ///< z component of the ray's original direction
  Hits8 hits[kPackets];

  float min_inverse_depth[kPackets];                    ///< minimum over the packet's rays
  float max_depth = std::numeric_limits<float>::max();  ///< z beyond which no hit can be the nearest of any ray
  unsigned updated_packets = 0;                         ///< packets whose hits changed since `max_depth` was set
};

/// Builds the beam's frame; false if the rays have no mean direction.
TILEFLIGHT_LANE_INLINE bool build_frame(std::span<const RayPacket8> packets, Beam& beam) {
  Vector3x8 sums{};
  add_directions(packets, sums);
  const RayPacket8& first = packets.front();
  if (!build_axes(sums, first, beam)) return false;
  beam.origin = {first.origin_x[0], first.origin_y[0], first.origin_z[0]};
  beam.time = first.time[0];
  return true;
}

/// Transforms the rays to the beam's frame and computes their rectangles; false if a ray is too far from the axis.
TILEFLIGHT_LANE_INLINE bool transform_rays(std::span<const RayPacket8> packets, Beam& beam) {
  clear_rectangles(beam);
  for (std::size_t p = 0; p < packets.size(); ++p) {
    to_plane(beam, packets[p], beam.ray_x[p], beam.ray_y[p], beam.direction_z[p]);
    if (!(horizontal_min(beam.direction_z[p]) > 0.0F)) return false;
    set_rectangle(beam.ray_x[p], beam.ray_y[p], p, beam);
  }
  beam.min_x = horizontal_min(beam.low_x);
  beam.min_y = horizontal_min(beam.low_y);
  beam.max_x = -horizontal_min(-beam.high_x);
  beam.max_y = -horizontal_min(-beam.high_y);
  return is_narrow(beam);
}

TILEFLIGHT_LANE_INLINE void clear_beam(std::span<const RayPacket8> packets, Beam& beam) {
  for (std::size_t p = 0; p < packets.size(); ++p) {
    clear_hits(packets[p], beam.hits[p]);
    beam.min_inverse_depth[p] = horizontal_min(beam.hits[p].inverse_depth);
  }
}

/// Bits of the triangles that the beam may hit.
TILEFLIGHT_LANE_INLINE unsigned set_up_triangles(const Beam& beam, const BeamLeaf& leaf, TriangleSetup8& facets) {
  LeafCorners corners;
  load_corners(beam, leaf, corners);
  const auto& [a, b, c] = corners.beam;
  bound(a, b, c, facets);
  const unsigned places = overlapping_triangles(beam, leaf, facets);
  if (places == 0) return 0;
  Int8 turn;
  Float8 per_volume;
  const unsigned seen = set_up_planes(beam, corners.scene, facets, turn, per_volume);
  Vector3x8 edge;
  edge_normal(b, c, edge);
  flip_signs(edge, turn, facets.edge_bc);
  edge_normal(c, a, edge);
  flip_signs(edge, turn, facets.edge_ca);
  edge_normal(a, b, edge);
  flip_signs(edge, turn, facets.edge_ab);
  return places & seen;
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
  Hits8& hits = beam.hits[p];
  const Int8 outside = (Int8)a | (Int8)b | (Int8)c | (Int8)(inverse_depth - hits.inverse_depth);
  if (sign_mask((Int8)outside) == 0xFFU) return;
  const TriangleNumbers8 numbers = numbers_of(leaf, first_mesh, place);
  const Int8 nearer = nearer_lanes(hits, inverse_depth, numbers);
  take_hits((~outside >> 31) & nearer, inverse_depth, a, b, c, facets, place, numbers, hits);
  beam.updated_packets |= 1U << static_cast<unsigned>(p);
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
    beam.min_inverse_depth[p] = horizontal_min(beam.hits[p].inverse_depth);
  }
  beam.updated_packets = 0;
  float least = beam.min_inverse_depth[0];
  for (std::size_t p = 1; p < packets; ++p) least = std::min(least, beam.min_inverse_depth[p]);
  beam.max_depth = 1.0F / least;
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
  const BeamFrustum pyramid = make_frustum(beam, beam, reach_m);
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

TILEFLIGHT_WIDE_VECTORS bool cast_beam(BeamNode::Child root, std::span<const BeamBranch> branches, float reach_m,
                                       std::span<RayPacket8> packets) {
  Beam beam;
  if (!build_frame(packets, beam) || !transform_rays(packets, beam)) return false;
  clear_beam(packets, beam);
  traverse(root, branches, make_frustum(beam, beam, reach_m), packets.size(), beam);
  for (std::size_t p = 0; p < packets.size(); ++p) write_hits(beam.hits[p], beam.direction_z[p], packets[p]);
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
