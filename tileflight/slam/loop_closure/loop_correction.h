#pragma once

// Correction of a trajectory by loops. Their directly measured motions (loop_alignment.h) and the odometry's steps,
// each with its covariance, make a pose graph (pose_graph.h). A path that has drifted less than its loops are known to
// would only become worse: it is kept.

#include <map>
#include <optional>
#include <vector>

#include "tileflight/slam/loop_closure/loop_alignment.h"
#include "tileflight/slam/loop_closure/loop_closure.h"

namespace tileflight::loop_closure {

/// A loop with its measurement; a is `from`, b is `to`.
struct MeasuredLoop {
  Loop loop;
  LoopAlignment alignment;
};

/// Measures the loops that can be measured, at most one to each keyframe: the one with the most features. `lens`: of
/// the full image; `points`: of the whole map. Deterministic.
std::vector<MeasuredLoop> measure_loops(const keyframes::LensPyramid& lens,
                                        const std::vector<mapping::MapPoint>& points,
                                        const std::vector<LoopKeyframe>& keyframes, const std::vector<Loop>& loops);

/// Returns the covariance of the path's motion between two keyframes, `from` < `to`: of its right twist (translation
/// first, units of `from`), and last of the logarithm of the map's scale at `to` over that at `from`. Errors of the
/// steps are taken to be independent of each other.
geometry::Mat7 path_covariance(const std::vector<LoopKeyframe>& keyframes, int from, int to);

/// Measures how well a path and its loops agree.
struct LoopConsistency {
  double loop_variance_factor = 1.0;  ///< on the loops' covariances, at least 1: their alignments from both sides
                                      ///< differ by so much more than stated
  double contradiction = 0.0;  ///< squared difference of the path from its loops over the loops' own variance and what
                               ///< chance adds with so many loops: up to 1 if all of it may be the loops' error, many
                               ///< if the path has drifted. Of the motions or of the scale, whichever contradicts more
  double path_variance_factor = 1.0;  ///< on the steps' covariances, at least 1, with which they and the loops' explain
                                      ///< the contradictions
  double scale_variance_factor = 1.0;  ///< the same, on those of the scale
};

/// Measures the consistency by the median loop; without loops the factors are 1. Each flight has its own texture, light
/// and speed, so that what its sigmas are worth is asked of itself, as by two runs over it
/// (slam/odometry/run_comparison.h).
LoopConsistency measure_consistency(const std::vector<LoopKeyframe>& keyframes, const std::vector<MeasuredLoop>& loops);

/// Returns the poses (with scale) of all keyframes after loop closure; the first one is fixed. nullopt where there is
/// nothing to gain: no loops, or none that contradict the path by more than their own errors may.
std::optional<std::vector<geometry::Sim3>> correct_poses(const std::vector<LoopKeyframe>& keyframes,
                                                         const std::vector<MeasuredLoop>& loops);

/// Rescales the points with their hosts; `scale`: of each keyframe, by id.
void rescale_points(const std::map<int, double>& scale, std::vector<mapping::MapPoint>& points);

}  // namespace tileflight::loop_closure
