#pragma once

#include <cstdint>
#include <vector>

#include "tileflight/imaging/textured_mesh.h"

namespace tileflight::tiling {

struct PhotogrammetryOptions {
  double simplification_m = 0.085;  ///< detail that is lost
  double noise_m = 0.035;           ///< standard deviation of the surface's error along each axis
  double noise_length_m = 2.2;      ///< over which that error is alike
  int texture_reduction = 2;  ///< texels of the source along each axis that become one, before a blur of one texel
  std::uint32_t seed = 1;
};

/// What a reconstruction from photographs keeps of a place: coarser geometry with smooth error, blurred textures. What
/// met still meets (the error depends on the place alone).
std::vector<imaging::TexturedMesh> photogrammetric(const std::vector<imaging::TexturedMesh>& meshes,
                                                   const PhotogrammetryOptions& options);

}  // namespace tileflight::tiling
