#pragma once

// Corners of keyframes that are found again from elsewhere: a binary descriptor (Calonder et al., "BRIEF", ECCV 2010,
// turned as in Rublee et al., "ORB", ICCV 2011) sampled on the sphere's tangent plane, so that a wide lens' distortion
// and the camera's roll do not matter; candidates by votes of equal descriptor parts.

#include <array>
#include <bit>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "tileflight/geometry/transform.h"
#include "tileflight/odometry/pyramid.h"

namespace tileflight::odometry {

using Descriptor = std::array<std::uint64_t, 4>;

inline int hamming(const Descriptor& a, const Descriptor& b) {
  int bits = 0;
  for (int i = 0; i < 4; ++i) bits += std::popcount(a[i] ^ b[i]);
  return bits;
}

struct Feature {
  Eigen::Vector2f pixel;  ///< level 0
  Eigen::Vector3f ray;    ///< unit
  float size_px = 1.0F;   ///< of one of its level's pixels, in level 0
  float rho = 0.0F;       ///< inverse distance along the ray; 0: unknown
  Descriptor descriptor{};
};

struct FeatureOptions {
  int features = 700;        ///< most a keyframe has
  int levels = 3;            ///< of the pyramid that are searched
  int max_area_px = 600000;  ///< the first of them is the finest one that is not larger
};

/// Corners evenly over the picture, strongest of their neighbourhood, with descriptors.
std::vector<Feature> find_features(const Pyramid& pyramid, const LensPyramid& lens, const FeatureOptions& options);

struct FeatureMatch {
  int a = 0;
  int b = 0;
};

/// Pairs that are each other's nearest, clearly nearer than the second nearest of either side.
std::vector<FeatureMatch> match_features(const std::vector<Feature>& a, const std::vector<Feature>& b);

/// Which keyframes have features like these: an inverted index over 16 parts of 16 bits each. Each part of a feature
/// votes for the keyframes that have it.
class FeatureIndex {
 public:
  struct Votes {
    int keyframe = 0;
    int votes = 0;
  };
  void add(int keyframe, const std::vector<Feature>& features);
  /// Keyframes before `end` by descending votes, at most `most`; parts that very many keyframes have do not count.
  std::vector<Votes> candidates(const std::vector<Feature>& features, int end, int most) const;

 private:
  std::unordered_map<std::uint32_t, std::vector<int>> keyframes_of_part_;
};

}  // namespace tileflight::odometry
