#pragma once

#include <cstdint>
#include <vector>

#include "tileflight/core/imaging/textured_mesh.h"

namespace tileflight::demo_place {

/// Errors of a simulated reconstruction.
struct PhotogrammetryOptions {
  double simplification_m = 0.085;  ///< size of detail that is lost
  double noise_m = 0.035;           ///< standard deviation of the surface's error along each axis
  double noise_length_m = 2.2;      ///< correlation length of that error
  int texture_reduction = 2;        ///< source texels along each axis merged into one, before a blur of one texel
  std::uint32_t seed = 1;
};

/// Simulates a reconstruction from photographs: coarser geometry with smooth error, blurred textures. Meshes that touch
/// still touch (the error depends only on position).
std::vector<imaging::TexturedMesh> simulate_photogrammetry(const std::vector<imaging::TexturedMesh>& meshes,
                                                           const PhotogrammetryOptions& options);

}  // namespace tileflight::demo_place
