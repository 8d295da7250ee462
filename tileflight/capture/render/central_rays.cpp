#include "tileflight/capture/render/central_rays.h"

#include <algorithm>
#include <bit>
#include <limits>

#include "tileflight/core/base/simd.h"

namespace tileflight::render {
namespace {

/// Cosine of the angle between ray and normal, times their lengths; positive for a back face.
TILEFLIGHT_LANE_INLINE float slope_of(const scene::RayPacket8& packet, int lane) {
  return packet.normal_x[lane] * packet.direction_x[lane] + packet.normal_y[lane] * packet.direction_y[lane] +
         packet.normal_z[lane] * packet.direction_z[lane];
}

/// `lanes`: the lanes with central rays, one bit each.
TILEFLIGHT_LANE_INLINE void add_lanes(const scene::RayPacket8& packet, std::uint8_t lanes, ViewStatistics& view) {
  std::int32_t hits = 0, backs = 0;
  float nearest = std::numeric_limits<float>::infinity();
  for (int i = 0; i < scene::RayPacket8::kLanes; ++i) {
    const bool hit = (lanes >> i & 1) != 0 && packet.mesh[i] != scene::RayPacket8::kMiss;
    const float distance_m = hit ? packet.far[i] : std::numeric_limits<float>::infinity();
    hits += hit ? 1 : 0;
    backs += hit && slope_of(packet, i) > 0.0F ? 1 : 0;
    nearest = distance_m < nearest ? distance_m : nearest;
  }
  view.rays += std::popcount(lanes);
  view.surfaces += hits;
  view.back_faces += backs;
  view.nearest_m = std::min(view.nearest_m, static_cast<double>(nearest));
}

TILEFLIGHT_LANE_INLINE SurfacePoint surface_point(const RayBlock& rays, const scene::RayPacket8& packet, int lane) {
  SurfacePoint point;
  point.ray_camera = {rays.x[lane], rays.y[lane], rays.z[lane]};
  point.hit = packet.mesh[lane] != scene::RayPacket8::kMiss;
  if (!point.hit) return point;
  point.mesh = packet.mesh[lane];
  point.triangle = packet.triangle[lane];
  point.distance_m = packet.far[lane];
  point.normal_local = {packet.normal_x[lane], packet.normal_y[lane], packet.normal_z[lane]};
  return point;
}

TILEFLIGHT_LANE_INLINE void write_depth(const TracedBeam::Block& block, const RayBlock& rays,
                                        const scene::RayPacket8& packet, imaging::FloatImage& depth_m) {
  for_each_lane(block, [&](int i, int x, int y) {
    const bool hit = packet.mesh[i] != scene::RayPacket8::kMiss;
    depth_m(x, y) = hit ? packet.far[i] * rays.z[i] : std::numeric_limits<float>::infinity();
  });
}

}  // namespace

double ViewStatistics::surface_share() const { return static_cast<double>(surfaces) / static_cast<double>(rays); }

double ViewStatistics::back_face_share() const {
  return surfaces > 0 ? static_cast<double>(back_faces) / static_cast<double>(surfaces) : 0.0;
}

void ViewStatistics::add(const ViewStatistics& other) {
  nearest_m = std::min(nearest_m, other.nearest_m);
  rays += other.rays;
  surfaces += other.surfaces;
  back_faces += other.back_faces;
}

TILEFLIGHT_WIDE_VECTORS void note_central(const TracedBeam& beam, const RayTable& table, const CentralRays& wanted,
                                          ViewStatistics& view) {
  for (int k = 0; k < beam.size; ++k) {
    const TracedBeam::Block& block = beam.blocks[static_cast<std::size_t>(k)];
    const scene::RayPacket8& packet = beam.packets[static_cast<std::size_t>(k)];
    const RayBlock& rays = table.block(block.column, block.row);
    add_lanes(packet, block.valid, view);
    if (wanted.depth_m != nullptr) write_depth(block, rays, packet, *wanted.depth_m);
    if (wanted.visitor == nullptr) continue;
    const bool placed_alone = wanted.visitor->pixels == VisitedPixels::kPlaced;
    for_each_lane(block, [&](int i, int x, int y) {
      if (placed_alone && (packet.mesh[i] == scene::RayPacket8::kMiss || packet.mesh[i] < wanted.first_placed_mesh))
        return;
      SurfacePoint point = surface_point(rays, packet, i);
      point.x = x;
      point.y = y;
      wanted.visitor->visit(point);
    });
  }
}

}  // namespace tileflight::render
