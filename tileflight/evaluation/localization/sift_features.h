#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "tileflight/core/imaging/image.h"

namespace tileflight::localization {

/// Gradient histograms around a feature: 4 x 4 cells of 8 directions, relative to its size and direction.
using SiftDescriptor = std::array<std::uint8_t, 128>;

/// Returns the dominant gradient directions around (x, y), radians from x (right) to y (down): the peaks of a histogram
/// of 36 directions, at most two (section 5 of Lowe's paper). `image`: blurred by `sigma`, pixels.
std::vector<float> dominant_orientations(const imaging::FloatImage& image, float x, float y, float sigma);

/// Computes the descriptor of the gradients around (x, y) of an image blurred by `sigma`, in axes turned by `angle_rad`
/// (section 6 of Lowe's paper), with square roots as in RootSIFT.
SiftDescriptor compute_descriptor(const imaging::FloatImage& image, float x, float y, float sigma, float angle_rad);

struct SiftOptions {
  double min_contrast = 0.4;     ///< smallest magnitude of the difference of Gaussians at a feature, grey values
  double max_edge_ratio = 10.0;  ///< largest ratio of the principal curvatures; rejects edges, which are not localised
                                 ///< along themselves
  /// Maximum number of features, those of highest contrast, in each square of 512 pixels of an octave. This spreads
  /// features over image and scale, and two images of one place keep the same ones.
  std::size_t max_per_tile = 800;
};

/// A feature with its position, scale and orientation.
struct LocalFeature {
  float x = 0.0F, y = 0.0F;  ///< pixels, centres at integers
  float sigma = 0.0F;        ///< standard deviation of the Gaussian at its scale, pixels
  float angle_rad = 0.0F;    ///< dominant gradient direction, from x (right) to y (down)
  float contrast = 0.0F;     ///< grey values; positive: dark on bright
};

struct LocalFeatures {
  std::vector<LocalFeature> features;
  std::vector<SiftDescriptor> descriptors;  ///< one per feature

  std::size_t size() const { return features.size(); }
};

/// Finds SIFT features: extrema of differences of Gaussians over position and scale, described by histograms of
/// gradients (Lowe, IJCV 60(2), 2004), of which the square roots are stored (RootSIFT: Arandjelovic and Zisserman, CVPR
/// 2012). No features are returned near unseen pixels (0 in `seen`; empty: all seen). The order is fixed and
/// independent of the number of threads.
LocalFeatures find_sift_features(const imaging::GrayImage& image, const imaging::GrayImage& seen = {},
                                 const SiftOptions& options = {});

}  // namespace tileflight::localization
