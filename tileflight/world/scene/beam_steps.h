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

/// 2 a x b.
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

/// Around rays from the frame's origin within the bounds. `reach_m`: of all coordinates.
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

/// A packet's rays as points of the plane z = 1, and the z components of their directions.
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

}  // namespace tileflight::scene::beam_steps
