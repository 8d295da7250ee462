#include "tileflight/capture/render/daylight_shader.h"

#include <algorithm>
#include <cmath>

#include "tileflight/world/scene/packets.h"

namespace tileflight::render {
namespace {

using scene::RayPacket8;

/// Visible sides of eight surfaces.
struct ShadingNormals8 {
  std::array<std::array<float, 3>, RayPacket8::kLanes> normal{};  ///< unit, towards the camera
  std::array<float, RayPacket8::kLanes> sun_cosine{};             ///< 0 or less: the sun is behind it
};

std::array<float, 3> ray_direction(const RayPacket8& packet, int i) {
  return {packet.direction_x[i], packet.direction_y[i], packet.direction_z[i]};
}

ShadingNormals8 compute_shading_normals(const RayPacket8& packet, const std::array<float, 3>& toward_sun) {
  ShadingNormals8 facets;
  for (std::size_t i = 0; i < facets.normal.size(); ++i) {
    const float x = packet.normal_x[i], y = packet.normal_y[i], z = packet.normal_z[i];
    const float slope = x * packet.direction_x[i] + y * packet.direction_y[i] + z * packet.direction_z[i];
    const float length = std::sqrt(x * x + y * y + z * z);
    const float scale = (slope > 0.0F ? -1.0F : 1.0F) / std::max(length, 1e-30F);
    facets.normal[i] = {x * scale, y * scale, z * scale};
    facets.sun_cosine[i] = (x * toward_sun[0] + y * toward_sun[1] + z * toward_sun[2]) * scale;
  }
  return facets;
}

/// Offset of a shadow ray's origin from the surface: more than the error of the hit, which is a few float steps of the
/// ray's length and of the distance from the anchor.
float shadow_offset_m(const RayPacket8& packet, int i) {
  constexpr float kLeast_m = 1e-3F, kSteps = 16.0F * 1.2e-7F;
  const float far_m = std::abs(packet.origin_x[i]) + std::abs(packet.origin_y[i]) + std::abs(packet.origin_z[i]);
  return kLeast_m + kSteps * (far_m + 2.0F * packet.far[i]);
}

/// Bits of the lanes whose surfaces face the sun.
std::uint8_t sun_facing_lanes(std::uint8_t hits, const ShadingNormals8& facets) {
  for (unsigned i = 0; i < facets.sun_cosine.size(); ++i) {
    if (!(facets.sun_cosine[i] > 0.0F)) hits = static_cast<std::uint8_t>(hits & ~(1U << i));
  }
  return hits;
}

/// Bits of the lanes whose surfaces are sunlit.
std::uint8_t sunlit_lanes(const scene::Scene& scene, std::uint8_t hits, const RayPacket8& packet,
                          const ShadingNormals8& facets, const std::array<float, 3>& toward_sun) {
  RayPacket8 shadow;
  shadow.reset();
  std::uint8_t asked = 0;
  for (int i = 0; i < RayPacket8::kLanes; ++i) {
    const auto lane = static_cast<std::size_t>(i);
    const bool faces = (hits >> i & 1) != 0 && facets.sun_cosine[lane] > 0.0F;
    const float t = faces ? packet.far[i] : 0.0F;
    const float off = faces ? shadow_offset_m(packet, i) : 0.0F;
    const std::array<float, 3>& n = facets.normal[lane];
    shadow.origin_x[i] = packet.origin_x[i] + t * packet.direction_x[i] + off * n[0];
    shadow.origin_y[i] = packet.origin_y[i] + t * packet.direction_y[i] + off * n[1];
    shadow.origin_z[i] = packet.origin_z[i] + t * packet.direction_z[i] + off * n[2];
    shadow.time[i] = packet.time[i];
    shadow.direction_x[i] = toward_sun[0];
    shadow.direction_y[i] = toward_sun[1];
    shadow.direction_z[i] = toward_sun[2];
    if (faces) asked = static_cast<std::uint8_t>(asked | 1U << static_cast<unsigned>(i));
    if (!faces) shadow.disable_lane(i);
  }
  if (asked == 0) return 0;
  scene.test_occlusion(shadow);
  std::uint8_t lit = 0;
  for (int i = 0; i < RayPacket8::kLanes; ++i) {
    if ((asked >> i & 1) != 0 && shadow.far[i] > 0.0F)
      lit = static_cast<std::uint8_t>(lit | 1U << static_cast<unsigned>(i));
  }
  return lit;
}

std::uint8_t hit_lanes(std::uint8_t valid, const RayPacket8& packet) {
  std::uint8_t hits = 0;
  for (int i = 0; i < RayPacket8::kLanes; ++i) {
    if ((valid >> i & 1) != 0 && packet.mesh[i] != RayPacket8::kMiss)
      hits = static_cast<std::uint8_t>(hits | 1U << static_cast<unsigned>(i));
  }
  return hits;
}

}  // namespace

std::array<LinearRgb, 8> DaylightShader::shade(std::uint8_t valid, const scene::RayPacket8& packet,
                                               const SquaredColors8& squares) const {
  const SrgbTables& srgb = SrgbTables::get();
  const ShadingNormals8 facets = compute_shading_normals(packet, daylight_->toward_sun());
  const std::uint8_t hits = hit_lanes(valid, packet);
  std::uint8_t lit = 0;
  if (direct_share_ > 0.0F) {
    lit = daylight_->casts_shadows() ? sunlit_lanes(scene_, hits, packet, facets, daylight_->toward_sun())
                                     : sun_facing_lanes(hits, facets);
  }
  const float scattered = (1.0F - direct_share_) * std::max(0.0F, daylight_->toward_sun()[2]);
  std::array<LinearRgb, 8> result{};
  for (std::size_t i = 0; i < result.size(); ++i) {
    if ((valid >> i & 1U) == 0) continue;
    const std::array<float, 3> direction = ray_direction(packet, static_cast<int>(i));
    if ((hits >> i & 1U) == 0) {
      result[i] = daylight_->sky(direction);
      continue;
    }
    LinearRgb light = daylight_->diffuse(facets.normal[i]);
    const float direct = (lit >> i & 1U) != 0 ? direct_share_ * facets.sun_cosine[i] : 0.0F;
    const float sun = direct + scattered * 0.5F * (1.0F + facets.normal[i][2]);
    for (int c = 0; c < 3; ++c) {
      const auto channel = static_cast<std::size_t>(c);
      const float albedo = srgb.decode(std::sqrt(squares[i][c]));
      light[channel] = albedo * (light[channel] + sun * daylight_->sunlight()[channel]);
    }
    result[i] = haze_.extinction_per_m > 0.0 ? apply_haze(light, direction, packet.far[i]) : light;
  }
  return result;
}

/// Koschmieder's law.
LinearRgb DaylightShader::apply_haze(const LinearRgb& light, const std::array<float, 3>& direction,
                                     float distance_m) const {
  const float clear = std::exp(-static_cast<float>(haze_.extinction_per_m) * distance_m);
  const LinearRgb air = haze_.color ? *haze_.color : daylight_->horizon(direction);
  LinearRgb result;
  for (std::size_t c = 0; c < 3; ++c) result[c] = clear * light[c] + (1.0F - clear) * air[c];
  return result;
}

}  // namespace tileflight::render
