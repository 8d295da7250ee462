#pragma once

#include <array>
#include <cstdint>

#include "tileflight/scene/packets.h"
#include "tileflight/scene/scene.h"
#include "tileflight/sensors/appearance.h"
#include "tileflight/sensors/ray_table.h"

namespace tileflight::sensors {

/// A camera pose in floats, relative to the scene's anchor.
struct TracerPose {
  std::array<float, 9> rotation{};  ///< row-major, camera to local
  std::array<float, 3> origin{};    ///< metres

  TracerPose() = default;
  TracerPose(const geometry::SE3& T_local_camera, const geometry::Vec3& anchor);
};

/// What the eight samples of a block see.
struct TracedBlock {
  scene::RayPacket8 packet;       ///< `mesh` is kMiss where nothing is hit or the lane is not valid
  std::array<Float4, 8> squares;  ///< squared sRGB values, 0..255 squared; of valid lanes only
};

/// Casts and shades blocks of samples. The hot loop of rendering: no allocation, no virtual call.
class BlockTracer {
 public:
  /// `haze_per_m`, `haze_color`: see RenderOptions.
  BlockTracer(const scene::Scene& scene, const Appearance& appearance, const imaging::Rgb8& background,
              double haze_per_m, const imaging::Rgb8& haze_color);

  /// Geometry only: `upper` and `lower` are the poses of the block's two rows of samples.
  void cast(const RayBlock& rays, std::uint8_t valid, const TracerPose& upper, const TracerPose& lower,
            scene::RayPacket8& packet) const;
  /// Fills `block.squares` from `block.packet`.
  void shade(std::uint8_t valid, TracedBlock& block) const;

 private:
  Float4 tinted(const Material& material, const scene::RayPacket8& packet, int lane, const Float4& squares) const;

  Float4 hazy(const Float4& squares, float distance_m) const;

  const scene::Scene& scene_;
  const Appearance& appearance_;
  Float4 background_squares_;
  Light haze_;  ///< linear
  float haze_per_m_;
};

}  // namespace tileflight::sensors
