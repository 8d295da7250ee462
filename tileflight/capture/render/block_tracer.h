#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "tileflight/capture/render/appearance.h"
#include "tileflight/capture/render/linear_color.h"
#include "tileflight/capture/render/ray_table.h"
#include "tileflight/core/base/simd.h"
#include "tileflight/core/imaging/image.h"
#include "tileflight/world/scene/packets.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::render {

/// A camera pose in floats, relative to the scene's anchor.
struct TracerPose {
  std::array<float, 9> rotation{};  ///< row-major, camera to local
  std::array<float, 3> origin{};    ///< metres
  float scene_time = 0.0F;          ///< scene::Ray::time

  TracerPose() = default;
  TracerPose(const geometry::SE3& T_local_camera, const geometry::Vec3& anchor);
};

/// Camera poses during the readout of an image: one for all rows, or one for each row (rolling shutter).
class RowPoses {
 public:
  /// One pose, or one per row. `scene_times`: of the scene (scene::Ray::time) at each; empty: 0 for all.
  RowPoses(std::span<const geometry::SE3> T_local_camera, const geometry::Vec3& anchor,
           std::span<const float> scene_times = {}) {
    for (const geometry::SE3& T : T_local_camera) poses_.emplace_back(T, anchor);
    for (std::size_t i = 0; i < scene_times.size(); ++i) poses_[i].scene_time = scene_times[i];
  }
  bool has_single_pose() const { return poses_.size() == 1; }
  /// `row`: pixel row; rows beyond the last use the last pose.
  const TracerPose& at_row(int row) const { return poses_[std::min(static_cast<std::size_t>(row), poses_.size() - 1)]; }

 private:
  std::vector<TracerPose> poses_;
};

/// Squared sRGB values, 0..255 squared, of a block's eight samples; only valid lanes are defined.
using SquaredColors8 = std::array<Float4, 8>;

/// Rounds one sample's squared sRGB values to a pixel.
TILEFLIGHT_LANE_INLINE imaging::Rgb8 encode_squared(const Float4& squares) {
  Float4 roots;
  for (int c = 0; c < 4; ++c) roots[c] = std::sqrt(squares[c]);
  const auto values = __builtin_convertvector(roots + 0.5F, base::Int4);
  return {static_cast<std::uint8_t>(values[0]), static_cast<std::uint8_t>(values[1]),
          static_cast<std::uint8_t>(values[2])};
}

/// Computes the linear light of one sample's squared sRGB values: SrgbTables::decode() of their roots, to the bit. The
/// fourth number is 0.
TILEFLIGHT_LANE_INLINE void decode_squared(const SrgbTables& srgb, const Float4& squares, Float4& light) {
  Float4 roots;
  for (int c = 0; c < 4; ++c) roots[c] = std::sqrt(squares[c]);
  roots = roots < 255.0F ? roots : Float4{} + 255.0F;
  const auto below = __builtin_convertvector(roots, base::Int4);
  const Float4 share = roots - __builtin_convertvector(below, Float4);
  // Beyond 255 comes 0, of which the share is none.
  const auto at = [&srgb](int level) { return srgb.decode(static_cast<std::uint8_t>(level)); };
  const Float4 from{at(below[0]), at(below[1]), at(below[2]), 0.0F};
  const Float4 to{at(below[0] + 1), at(below[1] + 1), at(below[2] + 1), 0.0F};
  light = from + share * (to - from);
}

/// Texture reads for a block's eight samples.
struct BlockTextureReads {
  std::array<const Material*, 8> material;  ///< null: no hit
  std::array<TextureRead, 8> read;          ///< for samples with a texture
};

/// Blocks of up to 8 x 8 neighbouring samples, without those that have no valid lane.
struct TracedBeam {
  static constexpr int kColumns = 8;
  static constexpr int kRows = 8;
  struct Block {
    int column, row;     ///< of the block in its RayTable
    std::uint8_t valid;  ///< one bit per lane
  };

  int size = 0;
  std::array<Block, scene::RayPacket8::kLanes> blocks;
  std::array<scene::RayPacket8, 8> packets;  ///< `mesh` is kMiss if nothing is hit or the lane is not valid
  std::array<BlockTextureReads, 8> reads;
};

/// Calls `work(lane, x, y)` for each valid sample of a block.
template <class Work>
TILEFLIGHT_LANE_INLINE void for_each_lane(const TracedBeam::Block& block, const Work& work) {
  for (int i = 0; i < RayBlock::kLanes; ++i) {
    if ((block.valid >> i & 1) == 0) continue;
    work(i, block.column * RayBlock::kColumns + i % RayBlock::kColumns,
         block.row * RayBlock::kRows + i / RayBlock::kColumns);
  }
}

/// Calls `work(x, y)` for the first sample of each beam of a tile; `n` x `n` samples a pixel.
template <class Work>
TILEFLIGHT_LANE_INLINE void for_each_beam(const imaging::PixelRegion& tile, int n, const Work& work) {
  for (int y = tile.y0 * n; y < tile.y1 * n; y += TracedBeam::kRows) {
    for (int x = tile.x0 * n; x < tile.x1 * n; x += TracedBeam::kColumns) work(x, y);
  }
}

/// Size of the tiles by which threads share an image.
inline constexpr int kTileWidth = 64, kTileHeight = 32;
/// Divides a region into tiles, in rows.
std::vector<imaging::PixelRegion> tiles_of(const imaging::PixelRegion& region);

/// Sums of the light of a tile's pixels, small enough for the processor's cache. The fourth numbers are not used.
class TileLight {
 public:
  explicit TileLight(const imaging::PixelRegion& tile)
      : tile_(tile), pixels_(width() * static_cast<std::size_t>(tile.y1 - tile.y0)) {}

  Float4& at(int x, int y) { return pixels_[first_of_row(y) + static_cast<std::size_t>(x - tile_.x0)]; }
  /// Calls `sink(x, y, light)` for each row, from its first pixel (x, y) on, with the sums times `scale`.
  template <class Sink>
  void hand_over(float scale, const Sink& sink) const {
    std::array<LinearRgb, kTileWidth> row;
    for (int y = tile_.y0; y < tile_.y1; ++y) {
      for (std::size_t i = 0; i < width(); ++i) {
        const Float4 light = pixels_[first_of_row(y) + i] * scale;
        row[i] = {light[0], light[1], light[2]};
      }
      sink(tile_.x0, y, std::span<const LinearRgb>(row).first(width()));
    }
  }

 private:
  std::size_t width() const { return static_cast<std::size_t>(tile_.x1 - tile_.x0); }
  std::size_t first_of_row(int y) const { return static_cast<std::size_t>(y - tile_.y0) * width(); }

  imaging::PixelRegion tile_;
  std::vector<Float4> pixels_;
};

/// Casts and shades blocks of samples. The inner loop of rendering: no allocation, no virtual call.
class BlockTracer {
 public:
  /// `haze_per_m`, `haze_color`: see RenderOptions.
  BlockTracer(const scene::Scene& scene, const Appearance& appearance, const imaging::Rgb8& background,
              double haze_per_m, const imaging::Rgb8& haze_color);

  /// Largest number of moments that cast_moments() takes.
  static constexpr std::size_t kMostMoments = 4;

  /// Builds the scene's acceleration structures in advance, while all cores are available.
  void prepare() const {
    scene_.build_beam_tree();
    if (appearance_.has_blending()) scene_.build_ray_tree();
  }
  /// Intersects the samples from (x, y) of the table on; both are multiples of the beam's size.
  void cast(const RayTable& table, int x, int y, const RowPoses& poses, TracedBeam& beam) const;
  /// Intersects samples at several moments of an exposure, with one traversal for all; one beam a moment.
  void cast_moments(const RayTable& table, int x, int y, std::span<const RowPoses> moments,
                    std::span<TracedBeam> beams) const;
  /// Prefetches what compute_texture_reads() needs of a beam that was cast.
  void prefetch_shading(const TracedBeam& beam) const;
  /// Computes `reads` of beams that were cast, the same samples at one or several moments, and prefetches the texels
  /// that shading will read.
  void compute_texture_reads(std::span<TracedBeam> moments) const;
  /// Computes the colours of a packet's samples.
  void shade(std::uint8_t valid, const scene::RayPacket8& packet, const BlockTextureReads& reads,
             SquaredColors8& squares) const;

  /// Returns the valid lanes whose surfaces blend with what lies behind them, one bit each.
  std::uint8_t blending_lanes(std::uint8_t valid, const BlockTextureReads& reads) const;
  /// Returns the opacity of a sample's surface, 0 to 1; 1 without a hit.
  float opacity(const scene::RayPacket8& packet, const BlockTextureReads& reads, int lane) const;
  /// Replaces the hits of these lanes by the next ones behind them, with their reads. Surfaces within a millimetre of
  /// each other along the ray count as one. The other lanes are disabled.
  void cast_behind(std::uint8_t lanes, scene::RayPacket8& packet, BlockTextureReads& reads) const;

 private:
  Float4 apply_material_color(const Material& material, const scene::RayPacket8& packet, int lane,
                              const Float4& squares) const;

  Float4 apply_haze(const Float4& squares, float distance_m) const;

  const scene::Scene& scene_;
  const Appearance& appearance_;
  Float4 background_squares_;
  LinearRgb haze_;  ///< linear
  float haze_per_m_;
};

/// Takes beams through three steps, cast, texture reads and shading, with three beams under way at a time: what a step
/// needs from memory is prefetched one step earlier and arrives while the other beams are computed.
template <class Cast, class Shade>
class BeamPipeline {
 public:
  /// `cast(x, y, beam)`; `shade(beam)` of a beam with its texture reads.
  BeamPipeline(const BlockTracer& tracer, const Cast& cast, const Shade& shade)
      : tracer_(tracer), cast_(cast), shade_(shade) {}

  void push(int x, int y) {
    TracedBeam& beam = beams_[count_ % kSteps];
    cast_(x, y, beam);
    tracer_.prefetch_shading(beam);
    if (count_ >= 1) read(count_ - 1);
    if (count_ >= 2) shade(count_ - 2);
    ++count_;
  }
  void finish() {
    if (count_ >= 1) read(count_ - 1);
    if (count_ >= 2) shade(count_ - 2);
    if (count_ >= 1) shade(count_ - 1);
    count_ = 0;
  }

 private:
  static constexpr std::size_t kSteps = 3;
  void read(std::size_t i) { tracer_.compute_texture_reads(std::span(&beams_[i % kSteps], 1)); }
  void shade(std::size_t i) { shade_(beams_[i % kSteps]); }

  const BlockTracer& tracer_;
  const Cast& cast_;
  const Shade& shade_;
  std::array<TracedBeam, kSteps> beams_;
  std::size_t count_ = 0;  ///< beams that were cast
};

}  // namespace tileflight::render
