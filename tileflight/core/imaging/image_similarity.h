#pragma once

#include <limits>

#include "tileflight/core/imaging/image.h"

namespace tileflight::imaging {

/// Similarity of two images of equal size over the pixels valid in both.
struct ImageSimilarity {
  /// Normalised cross-correlation of grey values, -1 to 1: invariant to gain and offset of either image. NaN if one of
  /// the images has no contrast.
  double ncc = std::numeric_limits<double>::quiet_NaN();
  /// Mean structural similarity (Wang, Bovik, Sheikh, Simoncelli, IEEE TIP 13(4), 2004): Gaussian window of 11 x 11
  /// pixels, sigma 1.5, K1 = 0.01, K2 = 0.03, L = 255. NaN if no window is valid.
  double ssim = std::numeric_limits<double>::quiet_NaN();
};

/// Compares two images of equal size. `mask`: valid pixels (nonzero); empty: all. A window of the structural similarity
/// is used only if all its pixels are valid, so that pixels outside the lens's image circle do not contribute. Throws
/// InputError if the sizes of images or mask differ.
ImageSimilarity compute_image_similarity(const GrayImage& a, const GrayImage& b, const GrayImage& mask = {});

}  // namespace tileflight::imaging
