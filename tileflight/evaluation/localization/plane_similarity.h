#pragma once

#include <cstddef>
#include <vector>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::localization {

/// Similarity in the plane: p_target = scale R(angle) p_source + translation.
struct PlaneSimilarity {
  double scale = 1.0;
  double angle_rad = 0.0;  ///< counter-clockwise
  geometry::Vec2 translation = geometry::Vec2::Zero();

  geometry::Vec2 operator*(const geometry::Vec2& p) const;
};

/// A point with a size and an orientation.
struct OrientedPoint {
  geometry::Vec2 position = geometry::Vec2::Zero();
  double size = 1.0;
  double angle_rad = 0.0;
};

/// A putative match of two oriented points.
struct PointPair {
  OrientedPoint source, target;
  double weight = 1.0;        ///< contribution to a similarity's score
  std::size_t source_id = 0;  ///< pairs with the same source (or target) count once
  std::size_t target_id = 0;
};

struct PlaneSearchOptions {
  double size_tolerance = 1.6;       ///< largest factor between a pair's size ratio and the scale
  double angle_tolerance_rad = 0.5;  ///< largest deviation of a pair's orientation difference from the rotation angle
  double distortion = 0.12;          ///< tolerated relative distortion of distances between points, while pairs are
                                     ///< collected around one of them
  double fitted_distortion = 0.04;   ///< same, of distances from the pairs' centroid, after the fit
  double blur = 3.0;                 ///< position tolerance, in target sizes
  std::size_t max_similarities = 60;
};

struct FoundSimilarity {
  PlaneSimilarity T_target_source;
  double score = 0.0;              ///< sum of the weights
  std::vector<std::size_t> pairs;  ///< indices of the consistent pairs
};

/// Returns the similarity that a single pair determines.
PlaneSimilarity similarity_from_pair(const PointPair& pair);

/// Fits a similarity by weighted least squares (Umeyama in the plane); `chosen`: indices into `pairs`.
PlaneSimilarity fit_plane_similarity(const std::vector<PointPair>& pairs, const std::vector<std::size_t>& chosen);

/// Finds similarities supported by many pairs, best first, at clearly different places. Each pair proposes one, and
/// those with most support are refitted to their pairs. Deterministic and independent of the number of threads.
std::vector<FoundSimilarity> find_plane_similarities(const std::vector<PointPair>& pairs,
                                                     const PlaneSearchOptions& options = {});

}  // namespace tileflight::localization
