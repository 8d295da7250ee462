#pragma once

#include <vector>

#include "tileflight/odometry/pyramid.h"

namespace tileflight::odometry {

struct SelectedPixel {
  int x = 0;
  int y = 0;
  int scale = 0;  ///< 0, 1, 2: pyramid level whose gradient made it stand out
};

/// Pixels that stand out from their surroundings, spread over the picture: section 3.2, "Candidate point selection".
/// Threshold: median gradient of a 32x32 region plus `min_gradient`, smoothed 3x3. One pixel a block of d x d; blocks
/// of 2d and 4d without any are tried with a lower threshold on coarser gradients. d is adapted to the wanted count.
/// Pixels outside the lens's valid region or nearer than `border_px` to the edge are never taken. Order: row by row of
/// blocks. `block_px` is d of a similar picture, where to begin (0: none yet), and becomes this picture's.
std::vector<SelectedPixel> select_pixels(const Pyramid& pyramid, const RayTable& rays, int wanted,
                                         const SelectionOptions& options, int& block_px);
inline std::vector<SelectedPixel> select_pixels(const Pyramid& pyramid, const RayTable& rays, int wanted,
                                                const SelectionOptions& options) {
  int block_px = 0;
  return select_pixels(pyramid, rays, wanted, options, block_px);
}

}  // namespace tileflight::odometry
