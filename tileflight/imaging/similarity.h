#pragma once

#include <limits>

#include "tileflight/imaging/image.h"

namespace tileflight::imaging {

/// How alike two pictures of one size are, over the pixels that count in both.
struct Similarity {
  /// Normalised cross-correlation of grey values, -1 to 1: unchanged by gain and offset of either. NaN where one of the
  /// pictures has no contrast.
  double ncc = std::numeric_limits<double>::quiet_NaN();
  /// Mean structural similarity (Wang, Bovik, Sheikh, Simoncelli, IEEE TIP 13(4), 2004): Gaussian window of 11 x 11
  /// pixels, sigma 1.5, K1 = 0.01, K2 = 0.03, L = 255. NaN where no window counts.
  double ssim = std::numeric_limits<double>::quiet_NaN();
};

/// `mask`: pixels that count (not 0); empty: all. For the structural similarity a window counts where all of its pixels
/// do, so that what lies outside of a lens's image does not. Pictures of two sizes, or of another than the mask's, are
/// an InputError.
Similarity similarity(const GrayImage& a, const GrayImage& b, const GrayImage& mask = {});

}  // namespace tileflight::imaging
