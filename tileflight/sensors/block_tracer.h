#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

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

/// Where the camera is while it takes each row of an image: in one place, or in one a row (rolling shutter).
class RowPoses {
 public:
  /// One pose, or one a row.
  RowPoses(std::span<const geometry::SE3> T_local_camera, const geometry::Vec3& anchor) {
    for (const geometry::SE3& T : T_local_camera) poses_.emplace_back(T, anchor);
  }
  bool is_one() const { return poses_.size() == 1; }
  /// `row`: of pixels; the last one's pose is also that of rows beyond.
  const TracerPose& of(int row) const { return poses_[std::min(static_cast<std::size_t>(row), poses_.size() - 1)]; }

 private:
  std::vector<TracerPose> poses_;
};

/// Squared sRGB values, 0..255 squared, of a block's eight samples; of valid lanes only.
using BlockSquares = std::array<Float4, 8>;

/// What is to be read of textures for a block's eight samples.
struct BlockReads {
  std::array<const Material*, 8> material;  ///< null: nothing was hit
  std::array<TextureRead, 8> read;          ///< of those with a texture
};

/// Up to 8 x 8 neighbouring samples: those of their blocks that have any valid lane.
struct TracedBeam {
  static constexpr int kColumns = 8;
  static constexpr int kRows = 8;
  struct Block {
    int column, row;     ///< of the block in its RayTable
    std::uint8_t valid;  ///< a bit a lane
  };

  int size = 0;
  std::array<Block, scene::RayPacket8::kLanes> blocks;
  std::array<scene::RayPacket8, 8> packets;  ///< `mesh` is kMiss where nothing is hit or the lane is not valid
  std::array<BlockReads, 8> reads;
};

/// Casts and shades blocks of samples. The hot loop of rendering: no allocation, no virtual call.
class BlockTracer {
 public:
  /// `haze_per_m`, `haze_color`: see RenderOptions.
  BlockTracer(const scene::Scene& scene, const Appearance& appearance, const imaging::Rgb8& background,
              double haze_per_m, const imaging::Rgb8& haze_color);

  /// Has the scene build what casting from such poses needs, while all cores are free to help.
  void prepare(const RowPoses& poses) const { poses.is_one() ? scene_.prepare_beams() : scene_.prepare_rays(); }
  /// Geometry only, of the samples from (x, y) of the table on; both are multiples of the beam's size.
  void cast(const RayTable& table, int x, int y, const RowPoses& poses, TracedBeam& beam) const;
  /// Fills `beam.reads` of a beam that was cast, and asks for the memory that shading it will read.
  void find_texels(TracedBeam& beam) const;
  /// What a packet's samples look like.
  void shade(std::uint8_t valid, const scene::RayPacket8& packet, const BlockReads& reads, BlockSquares& squares) const;

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
