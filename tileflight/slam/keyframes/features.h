#pragma once

// Corners that are found again in other images: a binary descriptor (Calonder et al., "BRIEF", ECCV 2010, rotated as in
// Rublee et al., "ORB", ICCV 2011) sampled on the tangent plane of the unit sphere, hence independent of lens
// distortion and camera roll.

#include <array>
#include <bit>
#include <cstdint>
#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/slam/keyframes/pyramid.h"

namespace tileflight::keyframes {

using BinaryDescriptor = std::array<std::uint64_t, 4>;

inline int hamming(const BinaryDescriptor& a, const BinaryDescriptor& b) {
  int bits = 0;
  for (int i = 0; i < 4; ++i) bits += std::popcount(a[i] ^ b[i]);
  return bits;
}

struct Feature {
  Eigen::Vector2f pixel;  ///< level 0
  Eigen::Vector3f ray;    ///< unit
  float size_px = 1.0F;   ///< size of a pixel of its level, in level-0 pixels
  float rho = 0.0F;       ///< inverse distance along the ray; 0: unknown
  BinaryDescriptor descriptor{};
};

struct FeatureOptions {
  int features = 700;        ///< maximum per keyframe
  int levels = 3;            ///< number of pyramid levels searched
  int max_area_px = 600000;  ///< the first one is the finest level not larger than this
};

/// Suits images far apart, which have little in common.
inline constexpr FeatureOptions kManyFeatures{.features = 2500, .levels = 3, .max_area_px = 2500000};

/// Finds corners spread evenly over the image, local maxima of the corner score, with descriptors.
std::vector<Feature> find_features(const keyframes::Pyramid& pyramid, const keyframes::LensPyramid& lens,
                                   const FeatureOptions& options);

struct FeatureMatch {
  int a = 0;
  int b = 0;
};

/// Returns the mutual nearest neighbours that are clearly closer than the second nearest on either side.
std::vector<FeatureMatch> match_features(const std::vector<Feature>& a, const std::vector<Feature>& b);

/// Returns the matches whose distances to most of the matches around them are alike in both images, whatever the
/// image's turn: of images far apart these are right with few exceptions.
std::vector<FeatureMatch> consistent_matches(const std::vector<Feature>& a, const std::vector<Feature>& b,
                                             const std::vector<FeatureMatch>& matches);

}  // namespace tileflight::keyframes
