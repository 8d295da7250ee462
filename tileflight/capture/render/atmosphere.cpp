#include "tileflight/capture/render/atmosphere.h"

#include <algorithm>
#include <cmath>

#include "tileflight/capture/render/daylight.h"
#include "tileflight/core/base/simd.h"

namespace tileflight::render {
namespace {

using scene::RayPacket8;

constexpr float kFarthest_m = 1e6F;
constexpr double kGroundAlbedo = 0.2;

/// Colour of light scattered many times by desert dust, red, green, blue, relative to white particles: the spherical
/// albedo of a thick layer, (1 - s) (1 - 0.139 s) / (1 + 1.17 s), s = sqrt((1 - w) / (1 - w g)) (van de Hulst,
/// "Multiple light scattering", 1980, section 15.1), with single-scattering albedos w and asymmetries g of desert dust
/// at 670, 550 (interpolated) and 440 nm (Dubovik et al., J. Atmospheric Sciences 59, 2002, table 1, Solar Village).
LinearRgb dust_color() {
  const auto layer = [](double albedo, double asymmetry) {
    const double s = std::sqrt((1.0 - albedo) / (1.0 - albedo * asymmetry));
    return static_cast<float>((1.0 - s) * (1.0 - 0.139 * s) / (1.0 + 1.17 * s));
  };
  return {layer(0.96, 0.66), layer(0.94, 0.67), layer(0.92, 0.69)};
}

/// e^-x for x >= 0, relative error below 3e-6: 2^k times a polynomial. Plain arithmetic, so that loops over it become
/// vector instructions, and the same on each machine.
TILEFLIGHT_LANE_INLINE float exp_of_minus(float x) {
  const float y = std::clamp(x, 0.0F, 80.0F) * -1.44269504F;
  const auto whole = static_cast<std::int32_t>(y - 0.5F);  // y <= 0: rounds to the nearest
  const float f = (y - static_cast<float>(whole)) * 0.693147181F;
  const float p =
      1.0F +
      f * (1.0F + f * (0.5F + f * (0.166666667F + f * (0.0416666667F + f * (0.00833333333F + f * 0.00138888F)))));
  const std::int32_t bits = (whole + 127) << 23;
  float power;
  std::memcpy(&power, &bits, sizeof power);
  return p * power;
}

/// (1 - e^-x) / x; near 0 its series. Large negative x, far below the base height, are cut off.
float mean_of_decay(float x) {
  constexpr float kMost = 60.0F, kSmall = 1e-2F;
  if (std::abs(x) < kSmall) return 1.0F - x * (0.5F - x * (1.0F / 6.0F));
  return -std::expm1(-std::max(x, -kMost)) / x;
}

LinearRgb mix(const LinearRgb& a, const LinearRgb& b, float share_of_b) {
  LinearRgb result;
  for (std::size_t c = 0; c < 3; ++c) result[c] = a[c] + share_of_b * (b[c] - a[c]);
  return result;
}

double rate_extinction_per_m(const WeatherOptions& w) {
  return rain_extinction_per_m(w.rain_mm_per_h) + snow_extinction_per_m(w.snow_mm_per_h);
}

double luminance_of(const LinearRgb& light) { return 0.2126 * light[0] + 0.7152 * light[1] + 0.0722 * light[2]; }

}  // namespace

double direct_sun_share(const WeatherOptions& w, double sun_elevation_rad) {
  if (w.has_precipitation()) return 0.0;
  const double per_m = extinction_at_visibility(w.fog_visibility_m) + extinction_at_visibility(w.dust_visibility_m);
  if (per_m == 0.0) return 1.0;
  if (w.scale_height_m == 0.0 || sun_elevation_rad <= 0.0) return 0.0;
  return std::exp(-per_m * w.scale_height_m / std::sin(sun_elevation_rad));
}

float wet_reflectance(float dry) {
  constexpr float kSquaredIndex = 1.33F * 1.33F;
  const float a = std::clamp(dry, 0.0F, 1.0F);
  return a / (kSquaredIndex * (1.0F - a) + a);
}

/// White airlight: of daylight, the mean of what comes from above and of what the ground (albedo 0.2) sends up, as deep
/// inside a layer that absorbs nothing; of textures with their own light, the background's luminance, without colour.
Atmosphere::Atmosphere(const WeatherOptions& w, const std::shared_ptr<const Daylight>& daylight,
                       const imaging::Rgb8& background, double anchor_z_m)
    : has_air_(w.has_air()), daylight_(daylight), wetness_(static_cast<float>(w.wetness)) {
  if (daylight_) {
    sun_share_ = static_cast<float>(direct_sun_share(w, daylight_->sun().elevation_rad));
    const LinearRgb sky = daylight_->diffuse({0.0F, 0.0F, 1.0F});
    for (std::size_t c = 0; c < 3; ++c) {
      const float level = sky[c] + std::max(0.0F, daylight_->toward_sun()[2]) * daylight_->sunlight()[c];
      white_[c] = static_cast<float>(0.5 * (1.0 + kGroundAlbedo)) * level;
    }
  } else {
    LinearRgb sky;
    for (std::size_t c = 0; c < 3; ++c) sky[c] = SrgbTables::get().decode(background[c]);
    white_.fill(static_cast<float>(luminance_of(sky)));
  }
  const double fog = extinction_at_visibility(w.fog_visibility_m), dust = extinction_at_visibility(w.dust_visibility_m);
  const double falling = rate_extinction_per_m(w), particles = fog + dust;
  const LinearRgb white{1.0F, 1.0F, 1.0F};
  const auto color = [&](double all) {
    return mix(white, dust_color(), all > 0.0 ? static_cast<float>(dust / all) : 0.0F);
  };
  if (w.scale_height_m > 0.0) {
    per_scale_height_ = static_cast<float>(1.0 / w.scale_height_m);
    layered_per_m_ = static_cast<float>(particles * std::exp((w.base_height_m - anchor_z_m) / w.scale_height_m));
    uniform_per_m_ = static_cast<float>(falling);
    layered_color_ = color(particles);
    uniform_color_ = white;
  } else {
    uniform_per_m_ = static_cast<float>(particles + falling);
    uniform_color_ = color(particles + falling);
  }
}

/// The layer: integral of b exp(-(h + u s) / H) over s from 0 to d, which is b exp(-h / H) d (1 - e^-x) / x, x = u d /
/// H.
Atmosphere::Depths Atmosphere::depths(float height_m, float upward, float distance_m) const {
  const float d = std::min(distance_m, kFarthest_m);
  Depths depths{0.0F, uniform_per_m_ * d};
  if (per_scale_height_ > 0.0F) {
    const float here_per_m = layered_per_m_ * std::exp(std::min(60.0F, -height_m * per_scale_height_));
    depths.layered = here_per_m * d * mean_of_decay(upward * d * per_scale_height_);
  }
  return depths;
}

float Atmosphere::optical_depth(float height_m, float upward, float distance_m) const {
  const Depths of = depths(height_m, upward, distance_m);
  return of.layered + of.uniform;
}

/// Direct sunlight makes the air as bright as the clear sky's horizon in that direction; without it, light has no
/// direction any more.
LinearRgb Atmosphere::airlight(const std::array<float, 3>& direction, const Depths& depths) const {
  const float all = depths.layered + depths.uniform;
  const LinearRgb color = per_scale_height_ > 0.0F && all > 0.0F
                              ? mix(uniform_color_, layered_color_, depths.layered / all)
                              : uniform_color_;
  const LinearRgb light =
      sun_share_ > 0.0F && daylight_ ? mix(white_, daylight_->horizon(direction), sun_share_) : white_;
  return {color[0] * light[0], color[1] * light[1], color[2] * light[2]};
}

LinearRgb Atmosphere::airlight(const std::array<float, 3>& direction, float height_m) const {
  return airlight(direction, depths(height_m, direction[2], kFarthest_m));
}

LinearRgb Atmosphere::seen_through(const LinearRgb& light, const std::array<float, 3>& direction, float height_m,
                                   float distance_m) const {
  const Depths of = depths(height_m, direction[2], distance_m);
  return mix(airlight(direction, of), light, exp_of_minus(of.layered + of.uniform));
}

/// Surfaces are wet as far as they face upwards: rain runs off others.
void Atmosphere::wet_surfaces(std::uint8_t valid, const RayPacket8& packet, SquaredColors8& squares) const {
  if (wetness_ == 0.0F) return;
  const SrgbTables& srgb = SrgbTables::get();
  for (std::size_t i = 0; i < squares.size(); ++i) {
    if ((valid >> i & 1U) == 0 || packet.mesh[i] == RayPacket8::kMiss) continue;
    const float x = packet.normal_x[i], y = packet.normal_y[i], z = packet.normal_z[i];
    const float slope = x * packet.direction_x[i] + y * packet.direction_y[i] + z * packet.direction_z[i];
    const float upward = (slope > 0.0F ? -z : z) / std::max(std::sqrt(x * x + y * y + z * z), 1e-30F);
    const float share = wetness_ * std::max(0.0F, upward);
    for (int c = 0; c < 3; ++c) {
      const float dry = srgb.decode(std::sqrt(squares[i][c]));
      const float value = srgb.encode(dry + share * (wet_reflectance(dry) - dry));
      squares[i][c] = value * value;
    }
  }
}

TILEFLIGHT_WIDE_VECTORS void Atmosphere::add_air(std::uint8_t valid, const RayPacket8& packet,
                                                 std::array<LinearRgb, 8>& light) const {
  if (!has_air_) return;
  const bool is_plain = per_scale_height_ == 0.0F && !(sun_share_ > 0.0F && daylight_);
  if (!is_plain) {
    for (std::size_t i = 0; i < light.size(); ++i) {
      if ((valid >> i & 1U) == 0) continue;
      const float distance_m = packet.mesh[i] == RayPacket8::kMiss ? kFarthest_m : packet.far[i];
      light[i] = seen_through(light[i], {packet.direction_x[i], packet.direction_y[i], packet.direction_z[i]},
                              packet.origin_z[i], distance_m);
    }
    return;
  }
  const LinearRgb air = airlight({}, Depths{});
  std::array<float, RayPacket8::kLanes> clear;
  for (std::size_t i = 0; i < clear.size(); ++i) {
    const float distance_m = packet.mesh[i] == RayPacket8::kMiss ? kFarthest_m : packet.far[i];
    clear[i] = exp_of_minus(uniform_per_m_ * std::min(distance_m, kFarthest_m));
  }
  for (std::size_t i = 0; i < clear.size(); ++i) light[i] = mix(air, light[i], clear[i]);
}

}  // namespace tileflight::render
