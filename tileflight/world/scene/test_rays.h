#pragma once

#include <array>
#include <cstddef>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/world/scene/packets.h"

namespace tileflight::scene::test_rays {

/// 8 x 8 directions around one, with `step` (radians, about) between neighbours.
inline std::array<geometry::Vec3, 64> directions_around(const geometry::Vec3& forward, double step) {
  const geometry::Vec3 z = forward.normalized(), x = z.unitOrthogonal(), y = z.cross(x);
  std::array<geometry::Vec3, 64> directions;
  for (std::size_t i = 0; i < 64; ++i) {
    const double column = static_cast<double>(i % 8) - 3.5, row = static_cast<double>(i / 8) - 3.5;
    directions[i] = (z + step * column * x + step * row * y).normalized();
  }
  return directions;
}

/// The rays of a beam from one point, in the float coordinates of a scene with this anchor, all at one time.
inline std::array<RayPacket8, 8> beam_of(const geometry::Vec3& origin, const std::array<geometry::Vec3, 64>& directions,
                                         const geometry::Vec3& anchor, double time = 0.0) {
  std::array<RayPacket8, 8> packets;
  for (std::size_t ray = 0; ray < 64; ++ray) {
    RayPacket8& packet = packets[ray / 8];
    const std::size_t lane = ray % 8;
    if (lane == 0) packet.reset();
    const Eigen::Vector3f o = (origin - anchor).cast<float>(), d = directions[ray].cast<float>();
    packet.origin_x[lane] = o.x();
    packet.origin_y[lane] = o.y();
    packet.origin_z[lane] = o.z();
    packet.direction_x[lane] = d.x();
    packet.direction_y[lane] = d.y();
    packet.direction_z[lane] = d.z();
    packet.time[lane] = static_cast<float>(time);
  }
  return packets;
}

}  // namespace tileflight::scene::test_rays
