#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>

#include "tileflight/scene/scene.h"
#include "tileflight/sensors/block_tracer.h"
#include "tileflight/sensors/daylight.h"

namespace tileflight::sensors {

/// Air between the camera and what it sees.
struct Haze {
  double per_m = 0.0;          ///< exp(-per_m distance) of a surface's light is left
  std::optional<Light> color;  ///< linear; none: that of the sky at the horizon, by azimuth
};

/// Lights what a BlockTracer has found: textures and colours are taken for the share of light that a matt surface gives
/// back. The sun casts shadows with hard edges; sky and ground light every surface as if nothing stood around it. No
/// allocation, no virtual call.
class DaylightShader {
 public:
  /// The scene must outlive it.
  DaylightShader(const scene::Scene& scene, std::shared_ptr<const Daylight> light, const Haze& haze)
      : scene_(scene), daylight_(std::move(light)), haze_(haze) {}

  /// Linear light of the valid lanes of a block that was cast and shaded without haze; it may exceed 1.
  std::array<Light, 8> light_of(std::uint8_t valid, const scene::RayPacket8& packet, const BlockSquares& squares) const;

 private:
  Light in_air(const Light& light, const std::array<float, 3>& direction, float distance_m) const;

  const scene::Scene& scene_;
  std::shared_ptr<const Daylight> daylight_;
  Haze haze_;
};

}  // namespace tileflight::sensors
