#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "tileflight/imaging/image.h"

namespace tileflight::localization {

struct FeatureOptions {
  double least_contrast = 0.4;    ///< of the difference of Gaussians at a feature, grey values
  double most_edge_ratio = 10.0;  ///< of its principal curvatures: edges have no place along themselves
  /// In each square of 512 pixels of an octave, so many of highest contrast at most: features are spread over the
  /// picture and over sizes, and two pictures of one place keep the same ones.
  std::size_t most_per_square = 800;
};

/// A place in a picture with its own size and direction.
struct LocalFeature {
  float x = 0.0F, y = 0.0F;  ///< pixels, centres at integers
  float sigma = 0.0F;        ///< of the Gaussian at whose scale it stands out, pixels
  float angle_rad = 0.0F;    ///< of the prevailing gradient, from x (right) to y (down)
  float contrast = 0.0F;     ///< grey values; positive: dark on bright
};

/// Gradient histograms around a feature: 4 x 4 cells of 8 directions, relative to its size and direction.
using Descriptor = std::array<std::uint8_t, 128>;

struct LocalFeatures {
  std::vector<LocalFeature> features;
  std::vector<Descriptor> descriptors;  ///< one each

  std::size_t size() const { return features.size(); }
};

/// Scale-invariant features: extrema of differences of Gaussians over place and scale, described by histograms of
/// gradients (Lowe, IJCV 60(2), 2004), the square roots of which are compared (Arandjelovic and Zisserman, CVPR 2012).
/// Of places near what was not seen (0 in `seen`; empty: all was) there are none. In a fixed order; same bytes for any
/// number of threads.
LocalFeatures find_features(const imaging::GrayImage& image, const imaging::GrayImage& seen = {},
                            const FeatureOptions& options = {});

}  // namespace tileflight::localization
