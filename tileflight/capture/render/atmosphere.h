#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "tileflight/capture/render/block_tracer.h"
#include "tileflight/capture/render/linear_color.h"
#include "tileflight/capture/render/weather.h"
#include "tileflight/core/imaging/image.h"
#include "tileflight/world/scene/packets.h"

namespace tileflight::render {

class Daylight;  // daylight.h

/// Returns the share of the sun's direct light that reaches the ground: exp(-optical depth) along its rays through fog
/// and dust of a scale height; none through uniform fog and below the clouds of rain and snow. 1 in clear air.
double direct_sun_share(const WeatherOptions& weather, double sun_elevation_rad);

/// Computes the reflectance of a wet surface from that of the dry one: a / (n^2 (1 - a) + a), n = 1.33 of water. Light
/// that the surface scatters back is partly reflected down again by the water's surface, a fraction 1 - 1 / n^2 of it
/// (Angstrom 1925; Lekner and Dorf, "Why some things are darker when wet", Applied Optics 27, 1988).
float wet_reflectance(float dry);

/// The air of a WeatherOptions and its effect on light. Light L at a distance d becomes L T + A (1 - T), T = exp(-tau)
/// (Koschmieder 1924; Beer-Lambert), where tau is the integral of the extinction coefficient along the ray and A the
/// airlight, an average of those of the particles, weighted by their optical depths. No allocation, no virtual call.
class Atmosphere {
 public:
  /// `daylight`: may be null; then textures hold their light, and `background` is the sky's colour. `anchor_z_m`:
  /// height in the local frame of what rays' origins are relative to.
  Atmosphere(const WeatherOptions& weather, const std::shared_ptr<const Daylight>& daylight,
             const imaging::Rgb8& background, double anchor_z_m);

  /// Whether anything is in the air.
  bool has_air() const { return has_air_; }
  /// Returns the light of air that is full of white particles.
  const LinearRgb& white_airlight() const { return white_; }
  /// Returns the optical depth from a height, relative to the anchor, along a direction with this upward component (of
  /// a unit vector), up to a distance; distances beyond 1000 km count as that.
  float optical_depth(float height_m, float upward, float distance_m) const;
  /// Returns the colour of infinitely deep air in a direction.
  LinearRgb airlight(const std::array<float, 3>& direction, float height_m) const;
  /// Returns the light of something at a distance, as it arrives at a height.
  LinearRgb seen_through(const LinearRgb& light, const std::array<float, 3>& direction, float height_m,
                         float distance_m) const;

  /// Darkens the reflectance of the wet surfaces of a block that was cast and shaded.
  void wet_surfaces(std::uint8_t valid, const scene::RayPacket8& packet, SquaredColors8& squares) const;
  /// Replaces the light of a block's rays by what arrives through the air; those without a hit see the sky.
  void add_air(std::uint8_t valid, const scene::RayPacket8& packet, std::array<LinearRgb, 8>& light) const;

 private:
  struct Depths {
    float layered = 0.0F, uniform = 0.0F;
  };
  Depths depths(float height_m, float upward, float distance_m) const;
  LinearRgb airlight(const std::array<float, 3>& direction, const Depths& depths) const;

  bool has_air_;
  std::shared_ptr<const Daylight> daylight_;
  float sun_share_ = 0.0F;
  float wetness_;
  float layered_per_m_ = 0.0F, uniform_per_m_ = 0.0F;  ///< at the anchor's height
  float per_scale_height_ = 0.0F;                      ///< 1/m; 0: nothing is layered
  LinearRgb white_{};                                  ///< light that white particles scatter
  LinearRgb layered_color_{}, uniform_color_{};        ///< of the particles
};

}  // namespace tileflight::render
