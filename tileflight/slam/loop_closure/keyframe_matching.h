#pragma once

// Keyframe features for loop detection: a binary descriptor (Calonder et al., "BRIEF", ECCV 2010, rotated as in Rublee
// et al., "ORB", ICCV 2011) sampled on the tangent plane of the unit sphere, hence independent of lens distortion and
// camera roll. Candidate keyframes are found by votes of equal descriptor parts.

#include <array>
#include <bit>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/slam/keyframes/pyramid.h"

namespace tileflight::loop_closure {

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

/// Finds corners spread evenly over the image, local maxima of the corner score, with descriptors.
std::vector<Feature> find_features(const keyframes::Pyramid& pyramid, const keyframes::LensPyramid& lens,
                                   const FeatureOptions& options);

struct FeatureMatch {
  int a = 0;
  int b = 0;
};

/// Returns the mutual nearest neighbours that are clearly closer than the second nearest on either side.
std::vector<FeatureMatch> match_features(const std::vector<Feature>& a, const std::vector<Feature>& b);

/// Inverted index from descriptor parts (16 parts of 16 bits each) to keyframes. Each part of a query feature votes for
/// the keyframes that contain it.
class FeatureIndex {
 public:
  struct Votes {
    int keyframe = 0;
    int votes = 0;
  };
  void add(int keyframe, const std::vector<Feature>& features);
  /// Returns the keyframes with ids below `end` by descending votes, at most `most`; parts shared by very many
  /// keyframes are ignored.
  std::vector<Votes> candidates(const std::vector<Feature>& features, int end, int most) const;

 private:
  std::unordered_map<std::uint32_t, std::vector<int>> keyframes_by_word_;
};

}  // namespace tileflight::loop_closure
