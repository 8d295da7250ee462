#pragma once

#include "tileflight/world/scene/packets.h"

namespace tileflight::render {

// The area of a texture that a pixel covers.
//
// Rays of neighbouring pixels differ by dD; they meet the plane of the hit triangle (normal N, distance t) dP apart,
//   dP = t (dD - D (dD . N) / (D . N))                                        (Igehy, SIGGRAPH 1999, without dN)
// and the texel column and row move by their gradients along dP. For the steps to the right and down, these moves are
// the columns of J = d(texel) / d(pixel): a parallelogram as long and wide as J's singular values sigma_1 >= sigma_2.
// About sigma_1 / sigma_2 probes (at most kMaxProbes) lie evenly along its long axis, each read at the mip level whose
// texel is max(sigma_1 / probes, sigma_2) wide: McCormack et al., "Feline: fast elliptical lines for anisotropic
// texture mapping", SIGGRAPH 1999.

constexpr int kMaxProbes = 8;

/// Texture gradients of the triangles that eight rays hit; zero in lanes without a hit.
struct alignas(32) TextureGradients8 {
  float s_x[8], s_y[8], s_z[8];  ///< gradient of the texel column over the triangle's plane, texels a metre
  float t_x[8], t_y[8], t_z[8];  ///< of the texel row
  float width[8], height[8];     ///< of level 0, texels
  float max_level[8];            ///< coarsest level that may be read
};

struct alignas(32) Footprints8 {
  float probes[8];             ///< integers, 1 to kMaxProbes
  float lod[8];                ///< mip level, 0 to max_level
  float step_s[8], step_t[8];  ///< from probe to probe, texture coordinates
};

/// Computes the footprints of all eight lanes; lanes form blocks of 4 x 2 neighbours (ray_table.h).
Footprints8 compute_footprints(const scene::RayPacket8& packet, const TextureGradients8& lanes);

}  // namespace tileflight::render
