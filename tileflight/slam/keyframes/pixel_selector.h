#pragma once

#include <vector>

#include "tileflight/slam/keyframes/pyramid.h"

namespace tileflight::keyframes {

struct SelectedPixel {
  int x = 0;
  int y = 0;
  int scale = 0;  ///< 0, 1, 2: pyramid level at which its gradient passed the threshold
};

/// Selects high-gradient pixels spread over the image (DSO, section 3.2, "Candidate Point Selection"). Threshold:
/// median gradient of a 32x32 region plus `min_gradient`, smoothed 3x3. One pixel is selected per d x d block; blocks
/// of 2d and 4d without one are retried with a lower threshold on coarser gradients. d is adapted to the wanted count.
/// Pixels outside the lens's valid region or closer than `border_px` to the border are never selected. Order: by rows
/// of blocks. `block_px` holds the initial d, taken from a similar image (0: none yet), and receives the final one.
std::vector<SelectedPixel> select_pixels(const Pyramid& pyramid, const RayTable& rays, int wanted,
                                         const SelectionOptions& options, int& block_px);
inline std::vector<SelectedPixel> select_pixels(const Pyramid& pyramid, const RayTable& rays, int wanted,
                                                const SelectionOptions& options) {
  int block_px = 0;
  return select_pixels(pyramid, rays, wanted, options, block_px);
}

}  // namespace tileflight::keyframes
