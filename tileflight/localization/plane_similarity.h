#pragma once

#include <cstddef>
#include <vector>

#include "tileflight/geometry/transform.h"

namespace tileflight::localization {

/// p_target = scale R(angle) p_source + translation, in the plane.
struct PlaneSimilarity {
  double scale = 1.0;
  double angle_rad = 0.0;  ///< counter-clockwise
  geometry::Vec2 translation = geometry::Vec2::Zero();

  geometry::Vec2 operator*(const geometry::Vec2& p) const;
};

/// A point with a size and a direction of its own.
struct OrientedPoint {
  geometry::Vec2 position = geometry::Vec2::Zero();
  double size = 1.0;
  double angle_rad = 0.0;
};

/// Two that may be one and the same.
struct PointPair {
  OrientedPoint source, target;
  double weight = 1.0;        ///< how much it speaks for a similarity
  std::size_t source_id = 0;  ///< pairs with the same source (or target) speak only once
  std::size_t target_id = 0;
};

struct PlaneSearchOptions {
  double size_tolerance = 1.6;       ///< factor by which a pair's sizes may be off
  double angle_tolerance_rad = 0.5;  ///< by which a pair's directions may be off
  double distortion = 0.12;          ///< of distances between points, while pairs are gathered by one of them
  double fitted_distortion = 0.04;   ///< of distances from the middle of the pairs, after the fit to them
  double blur = 3.0;                 ///< of each position, in target sizes
  std::size_t most = 60;             ///< similarities
};

struct FoundSimilarity {
  PlaneSimilarity T_target_source;
  double score = 0.0;              ///< sum of the weights
  std::vector<std::size_t> pairs;  ///< that agree
};

/// The similarity of one pair alone.
PlaneSimilarity similarity_of(const PointPair& pair);

/// Least squares of weighted pairs of points (Umeyama in the plane).
PlaneSimilarity fit_plane_similarity(const std::vector<PointPair>& pairs, const std::vector<std::size_t>& chosen);

/// Similarities that many pairs agree on, best first, at clearly different places: each pair proposes its own, those
/// that most others agree with are fitted to them. Deterministic, same for any number of threads.
std::vector<FoundSimilarity> find_plane_similarities(const std::vector<PointPair>& pairs,
                                                     const PlaneSearchOptions& options = {});

}  // namespace tileflight::localization
