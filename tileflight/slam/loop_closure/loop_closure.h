#pragma once

// Loop closure for flights that return to a place. Two keyframes with matching features (keyframe_matching.h) that fit
// by one similarity (keyframe_similarity.h) form a loop if neighbouring keyframes confirm it and drift can explain the
// correction. Loops are then measured directly and correct the path (loop_correction.h). Loop closure does not affect
// tracking: it runs over all keyframes after the last image.

#include <cstdint>
#include <vector>

#include "tileflight/core/geometry/decompositions.h"
#include "tileflight/core/geometry/transform.h"
#include "tileflight/slam/keyframes/options.h"
#include "tileflight/slam/loop_closure/keyframe_image.h"
#include "tileflight/slam/loop_closure/keyframe_similarity.h"
#include "tileflight/slam/mapping/map.h"

namespace tileflight::loop_closure {

/// A keyframe as used by loop closure.
struct LoopKeyframe {
  int id = 0;
  std::int64_t frame_index = 0;
  geometry::SE3 T_map_camera;
  std::vector<Feature> features;
  KeyframeImage image;
  /// Covariance of the motion from the keyframe before (its right twist, translation first, units of the map), and
  /// variance of the logarithm of the map's scale here over that at the keyframe before.
  geometry::Mat6 step_covariance = geometry::Mat6::Zero();
  double step_log_scale_variance = 0.0;
};

/// Two keyframes that see the same place.
struct Loop {
  int from = 0;  ///< indices into the list of keyframes, from < to
  int to = 0;
  geometry::Sim3 T_from_to;  ///< scale: a length in `from` over the same length in `to`
  int inliers = 0;           ///< features consistent with it
};

/// Sets the features' inverse distances from map points that project within a few pixels, hosted by the keyframe itself
/// or one close in time, if those points agree.
void assign_feature_depths(const keyframes::Lens& lens, const std::vector<mapping::MapPoint>& points,
                           std::vector<LoopKeyframe>& keyframes);

/// Returns all accepted loops, in the order of `to`. Deterministic.
std::vector<Loop> find_loops(const std::vector<LoopKeyframe>& keyframes, const keyframes::LoopOptions& options);

}  // namespace tileflight::loop_closure
