#pragma once

// Loop closure for flights that return to a place. Two keyframes with matching features (keyframe_matching.h) that fit
// by one similarity (keyframe_similarity.h) form a loop if neighbouring keyframes confirm it and drift can explain the
// correction. The pose graph (pose_graph.h) distributes the error. Loop closure does not affect tracking: it runs over
// all keyframes after the last image.

#include <cstdint>
#include <map>
#include <vector>

#include "tileflight/geometry/transform.h"
#include "tileflight/loops/keyframe_similarity.h"
#include "tileflight/mapping/map.h"
#include "tileflight/photometry/options.h"

namespace tileflight::loops {

/// A keyframe as used by loop closure.
struct LoopKeyframe {
  int id = 0;
  std::int64_t frame_index = 0;
  geometry::SE3 T_map_camera;
  std::vector<Feature> features;
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
void assign_feature_depths(const photometry::Lens& lens, const std::vector<mapping::MapPoint>& points,
                           std::vector<LoopKeyframe>& keyframes);

/// All accepted loops, in the order of `to`. Deterministic.
std::vector<Loop> find_loops(const std::vector<LoopKeyframe>& keyframes, const photometry::LoopOptions& options);

/// Poses (with scale) of all keyframes after loop closure; the first one is fixed. Unchanged without loops.
std::vector<geometry::Sim3> correct_poses(const std::vector<LoopKeyframe>& keyframes, const std::vector<Loop>& loops);

/// Rescales the points with their hosts; `scale`: of each keyframe, by id.
void rescale_points(const std::map<int, double>& scale, std::vector<mapping::MapPoint>& points);

}  // namespace tileflight::loops
