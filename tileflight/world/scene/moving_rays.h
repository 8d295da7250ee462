#pragma once

// Rays whose origins differ a little, in their common frame: the set-up of moving_beam.cpp, whose notation holds here.
// To be included by it alone, as beam_steps.h.

#include <algorithm>
#include <array>
#include <limits>
#include <span>

#include "tileflight/core/base/simd.h"
#include "tileflight/world/scene/beam_triangles.h"

namespace tileflight::scene::beam_steps {

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

}  // namespace tileflight::scene::beam_steps
