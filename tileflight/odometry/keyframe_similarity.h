#pragma once

// The similarity between two keyframes of a monocular map, from corners of which both know the distance.

#include <optional>
#include <vector>

#include "tileflight/odometry/keyframe_matching.h"

namespace tileflight::odometry {

struct SimilarityOptions {
  double max_angle_rad = 0.008;   ///< between a moved point and the ray where it was found
  double max_log_distance = 0.3;  ///< difference of the logarithms of both distances
  int trials = 400;               ///< random triples of points
};

struct KeyframeSimilarity {
  geometry::Sim3 T_a_b;
  std::vector<FeatureMatch> inliers;
  double spread_rad = 0.0;     ///< root mean square angle between inliers' rays and their mean
  double angle_rms_rad = 0.0;  ///< of the inliers
};

/// The similarity that most matches agree with, from triples (Umeyama 1991) and refined on the angles both ways and the
/// distances. Only matches whose distance is known in both count. nullopt with fewer than four.
std::optional<KeyframeSimilarity> find_similarity(const std::vector<Feature>& a, const std::vector<Feature>& b,
                                                  const std::vector<FeatureMatch>& matches,
                                                  const SimilarityOptions& options);

}  // namespace tileflight::odometry
