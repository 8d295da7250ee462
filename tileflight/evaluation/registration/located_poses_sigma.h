#pragma once

#include <vector>

#include "tileflight/core/alignment/similarity_chart.h"
#include "tileflight/evaluation/registration/located_poses.h"

namespace tileflight::registration {

/// Similarity of located poses, each counted alike: rotation by their mean, translation and scale by the positions
/// (core/alignment/umeyama.h). Throws InputError for none.
geometry::Sim3 similarity_of(const std::vector<LocatedPose>& poses);

/// Distribution of located poses along their path.
enum class PathCoverage {
  kWhole,  ///< evenly spread over all of it
  kParts   ///< parts of it have no located pose
};

/// Standard deviation of similarity_of() `poses`, which are in the path's order, as displacement of the map's points
/// (metres, RMS over points and noise), against the similarity of all poses of the path, located without error. By
/// leaving out one interval of the path at a time, since neighbours share their errors:
///
/// - kParts: jackknife (core/alignment/uncertainty.h). A path that bends gives another similarity for each of its parts.
/// - kWhole: a path that bends is the same in sample and whole, so the bend is no error, however much a leg of it
/// pulls.
///   The estimates' second differences leave out what changes slowly along the path (Wolter, Introduction to Variance
///   Estimation, 2nd edition, chapter 8: contrasts of a systematic sample), but also errors that are shared for longer.
///   Hence twice that, and at most the jackknife, which counts all. For fewer than eight poses as kParts.
///
/// NaN for fewer than four poses.
double similarity_sigma_m(const std::vector<LocatedPose>& poses, const alignment::PointSpread& points,
                          PathCoverage coverage);

}  // namespace tileflight::registration
