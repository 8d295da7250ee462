#pragma once

// Similarity between two keyframes of a monocular map, from matched features with known distance in both.

#include <optional>
#include <vector>

#include "tileflight/slam/loop_closure/keyframe_matching.h"

namespace tileflight::loop_closure {

struct SimilarityOptions {
  double max_angle_rad = 0.008;   ///< between a transformed point and the matched ray
  double max_log_distance = 0.3;  ///< difference of the logarithms of both distances
  int trials = 400;               ///< random triples of points
};

struct KeyframeSimilarity {
  geometry::Sim3 T_a_b;
  std::vector<FeatureMatch> inliers;
  double spread_rad = 0.0;     ///< RMS angle between the inliers' rays and their mean
  double angle_rms_rad = 0.0;  ///< RMS angular error of the inliers
};

/// Finds the similarity with the most inliers, sampled from triples (Umeyama 1991) and refined on the angular errors in
/// both directions and the distances. Uses only matches with known distance in both keyframes; nullopt with fewer than
/// four.
std::optional<KeyframeSimilarity> find_similarity(const std::vector<Feature>& a, const std::vector<Feature>& b,
                                                  const std::vector<FeatureMatch>& matches,
                                                  const SimilarityOptions& options);

}  // namespace tileflight::loop_closure
