#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>

#include "tileflight/capture/render/block_tracer.h"
#include "tileflight/capture/render/daylight.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::render {

/// Air between the camera and surfaces.
struct Haze {
  double extinction_per_m = 0.0;   ///< a surface's light is attenuated by exp(-extinction_per_m distance)
  std::optional<LinearRgb> color;  ///< linear; default: that of the sky at the horizon, by azimuth
};

/// Applies daylight to the hits of a BlockTracer: textures and colours are the reflectance of matt surfaces. The sun
/// casts hard shadows; sky and ground light is not occluded. No allocation, no virtual call.
class DaylightShader {
 public:
  /// The scene must outlive it. `direct_share`: of the sun's light that comes straight; the rest comes evenly from
  /// above, as much of it on level ground, and casts no shadows.
  DaylightShader(const scene::Scene& scene, std::shared_ptr<const Daylight> light, const Haze& haze,
                 double direct_share = 1.0)
      : scene_(scene), daylight_(std::move(light)), haze_(haze), direct_share_(static_cast<float>(direct_share)) {}

  /// Returns the linear light of the valid lanes of a block that was cast and shaded without haze; may exceed 1.
  std::array<LinearRgb, 8> shade(std::uint8_t valid, const scene::RayPacket8& packet,
                                 const SquaredColors8& squares) const;

 private:
  LinearRgb apply_haze(const LinearRgb& light, const std::array<float, 3>& direction, float distance_m) const;

  const scene::Scene& scene_;
  std::shared_ptr<const Daylight> daylight_;
  Haze haze_;
  float direct_share_;
};

}  // namespace tileflight::render
