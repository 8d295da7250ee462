#pragma once

// A keyframe's picture as loop closure keeps it until the flight has ended: a byte a pixel, and not all levels.

#include <cstdint>
#include <vector>

#include "tileflight/slam/keyframes/pyramid.h"

namespace tileflight::loop_closure {

/// Grey values of one pyramid level, row by row.
struct KeyframeImage {
  int level = 0;  ///< of the pyramid that it was made from
  int width = 0;
  int height = 0;
  float grey_per_step = 1.0F;
  std::vector<std::uint8_t> steps;
};

/// Keeps the finest level of at most 310 000 pixels (640 x 480). Rounding adds 0.3 of a step of noise.
KeyframeImage keep_image(const keyframes::Pyramid& pyramid);

/// Returns a pyramid whose level 0 is the image kept; `levels`: their number.
keyframes::Pyramid restore_pyramid(const KeyframeImage& image, int levels);

/// Returns the lens of the levels from `first` on, as the lens of a pyramid of its own.
keyframes::LensPyramid lens_from_level(const keyframes::LensPyramid& lens, int first);

}  // namespace tileflight::loop_closure
