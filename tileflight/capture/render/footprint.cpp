#include "tileflight/capture/render/footprint.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include "tileflight/capture/render/ray_table.h"
#include "tileflight/core/base/simd.h"

// Each function is one branch-free loop over the eight lanes, which the compiler vectorises.
namespace tileflight::render {
namespace {

using scene::RayPacket8;
constexpr int kLanes = RayPacket8::kLanes;

/// Columns of J: moves in texels to the pixel on the right (x) and below (y).
struct alignas(32) TexelMoves {
  float s_x[8], t_x[8], s_y[8], t_y[8];
};

struct alignas(32) DirectionSteps {
  float x[8], y[8], z[8];
};

/// Differences between the directions of lanes to + i and from + i.
TILEFLIGHT_LANE_INLINE DirectionSteps steps_right(const RayPacket8& packet) {
  DirectionSteps steps;
  for (int i = 0; i < kLanes; ++i) {
    const int from = i % RayBlock::kColumns + 1 < RayBlock::kColumns ? i : i - 1;
    steps.x[i] = packet.direction_x[from + 1] - packet.direction_x[from];
    steps.y[i] = packet.direction_y[from + 1] - packet.direction_y[from];
    steps.z[i] = packet.direction_z[from + 1] - packet.direction_z[from];
  }
  return steps;
}

TILEFLIGHT_LANE_INLINE DirectionSteps steps_down(const RayPacket8& packet) {
  DirectionSteps steps;
  for (int i = 0; i < kLanes; ++i) {
    const int from = i % RayBlock::kColumns;
    steps.x[i] = packet.direction_x[from + RayBlock::kColumns] - packet.direction_x[from];
    steps.y[i] = packet.direction_y[from + RayBlock::kColumns] - packet.direction_y[from];
    steps.z[i] = packet.direction_z[from + RayBlock::kColumns] - packet.direction_z[from];
  }
  return steps;
}

TILEFLIGHT_LANE_INLINE TexelMoves texel_moves(const RayPacket8& packet, const TextureGradients8& lanes) {
  const DirectionSteps right = steps_right(packet);
  const DirectionSteps down = steps_down(packet);
  TexelMoves moves;
  for (int i = 0; i < kLanes; ++i) {
    const float nx = packet.normal_x[i], ny = packet.normal_y[i], nz = packet.normal_z[i];
    const float dx = packet.direction_x[i], dy = packet.direction_y[i], dz = packet.direction_z[i];
    const float inverse_dot = 1.0F / (nx * dx + ny * dy + nz * dz);
    const float along_s = (lanes.s_x[i] * dx + lanes.s_y[i] * dy + lanes.s_z[i] * dz) * inverse_dot;
    const float along_t = (lanes.t_x[i] * dx + lanes.t_y[i] * dy + lanes.t_z[i] * dz) * inverse_dot;
    const float t = packet.far[i];
    const float sx = t * (lanes.s_x[i] - along_s * nx);
    const float sy = t * (lanes.s_y[i] - along_s * ny);
    const float sz = t * (lanes.s_z[i] - along_s * nz);
    const float tx = t * (lanes.t_x[i] - along_t * nx);
    const float ty = t * (lanes.t_y[i] - along_t * ny);
    const float tz = t * (lanes.t_z[i] - along_t * nz);
    moves.s_x[i] = sx * right.x[i] + sy * right.y[i] + sz * right.z[i];
    moves.t_x[i] = tx * right.x[i] + ty * right.y[i] + tz * right.z[i];
    moves.s_y[i] = sx * down.x[i] + sy * down.y[i] + sz * down.z[i];
    moves.t_y[i] = tx * down.x[i] + ty * down.y[i] + tz * down.z[i];
  }
  return moves;
}

/// J J^T, set to zero in lanes whose footprint exceeds the whole image or is not a number.
struct alignas(32) SecondMoments {
  float half_trace[8], half_difference[8], mixed[8];
  float huge[8];  ///< 1 where the footprint is larger than the image, else 0
};

TILEFLIGHT_LANE_INLINE SecondMoments second_moments(const TexelMoves& j, const TextureGradients8& lanes) {
  SecondMoments m;
  for (int i = 0; i < kLanes; ++i) {
    const float ss = j.s_x[i] * j.s_x[i] + j.s_y[i] * j.s_y[i];
    const float tt = j.t_x[i] * j.t_x[i] + j.t_y[i] * j.t_y[i];
    const float st = j.s_x[i] * j.t_x[i] + j.s_y[i] * j.t_y[i];
    const float largest = lanes.width[i] * lanes.width[i] + lanes.height[i] * lanes.height[i];
    const bool fits = 0.5F * (ss + tt) < largest;
    m.half_trace[i] = fits ? 0.5F * (ss + tt) : 0.0F;
    m.half_difference[i] = fits ? 0.5F * (ss - tt) : 0.0F;
    m.mixed[i] = fits ? st : 0.0F;
    m.huge[i] = fits ? 0.0F : 1.0F;
  }
  return m;
}

/// Log2 by exponent and a linear mantissa: exact at powers of two, continuous, error at most 0.09 in between. For x >
/// 0.
TILEFLIGHT_LANE_INLINE float coarse_log2(float x) {
  const auto bits = std::bit_cast<std::int32_t>(x);
  const float mantissa = std::bit_cast<float>((bits & 0x007FFFFF) | 0x3F800000);
  return static_cast<float>((bits >> 23) - 127) + (mantissa - 1.0F);
}

}  // namespace

TILEFLIGHT_WIDE_VECTORS Footprints8 compute_footprints(const RayPacket8& packet, const TextureGradients8& lanes) {
  const SecondMoments m = second_moments(texel_moves(packet, lanes), lanes);
  Footprints8 result;
  for (int i = 0; i < kLanes; ++i) {
    const float difference = m.half_difference[i];
    const float root = std::sqrt(difference * difference + m.mixed[i] * m.mixed[i]);
    // Squares of the singular values; probes closer than texels are useless.
    const float lambda_1 = std::max(m.half_trace[i] + root, 1.0F);
    const float lambda_2 = std::max(m.half_trace[i] - root, 1.0F);
    const float ratio = std::sqrt(lambda_1 / lambda_2);
    const float probes =
        static_cast<float>(static_cast<std::int32_t>(std::min(ratio + 0.7F, static_cast<float>(kMaxProbes))));
    const float texel_squared = std::max(lambda_1 / (probes * probes), lambda_2);
    const float lod = std::min(0.5F * coarse_log2(texel_squared), lanes.max_level[i]);
    // Eigenvector of lambda_1, from the better conditioned row of J J^T - lambda_1 I.
    const float axis_s = difference >= 0.0F ? difference + root : m.mixed[i];
    const float axis_t = difference >= 0.0F ? m.mixed[i] : root - difference;
    const float length = std::sqrt(axis_s * axis_s + axis_t * axis_t);
    const float step = std::sqrt(lambda_1) / (probes * std::max(length, 1e-30F));
    result.probes[i] = probes;
    result.lod[i] = m.huge[i] > 0.0F ? lanes.max_level[i] : lod;
    result.step_s[i] = axis_s * step / std::max(lanes.width[i], 1.0F);
    result.step_t[i] = axis_t * step / std::max(lanes.height[i], 1.0F);
  }
  return result;
}

}  // namespace tileflight::render
