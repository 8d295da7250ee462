#pragma once

// Places that a long flight comes back to. Keyframes whose corners match (keyframe_matching.h) and whose points fit by
// one similarity (keyframe_similarity.h) are a loop, if neighbouring keyframes say the same and the correction is one
// that drift can explain. The pose graph (pose_graph.h) spreads the contradiction. Nothing of this touches the
// tracking: it is done over all keyframes after the last picture.

#include <cstdint>
#include <map>
#include <vector>

#include "tileflight/geometry/transform.h"
#include "tileflight/odometry/keyframe_similarity.h"
#include "tileflight/odometry/map.h"
#include "tileflight/odometry/options.h"

namespace tileflight::odometry {

/// A keyframe as loop closure sees it.
struct LoopKeyframe {
  int id = 0;
  std::int64_t frame_index = 0;
  geometry::SE3 T_map_camera;
  std::vector<Feature> features;
};

/// Two keyframes that see the same place.
struct Loop {
  int from = 0;  ///< positions in the list of keyframes, from < to
  int to = 0;
  geometry::Sim3 T_from_to;  ///< its scale: of a length in `from` over the same in `to`
  int inliers = 0;           ///< corners that agree with it
};

/// Gives the features of each keyframe the inverse distances of the map's points about them: those of points that it or
/// a keyframe near it in time hosts, where those within a few pixels agree.
void give_distances(const Lens& lens, const std::vector<MapPoint>& points, std::vector<LoopKeyframe>& keyframes);

/// All loops that hold, in the order of `to`. Deterministic.
std::vector<Loop> find_loops(const std::vector<LoopKeyframe>& keyframes, const LoopOptions& options);

/// Poses (with scale) of all keyframes once the loops are closed; the first one stays. Unchanged without loops.
std::vector<geometry::Sim3> closed_poses(const std::vector<LoopKeyframe>& keyframes, const std::vector<Loop>& loops);

/// Points are carried along with their hosts; `scale`: of each keyframe, by id.
void rescale(const std::map<int, double>& scale, std::vector<MapPoint>& points);

}  // namespace tileflight::odometry
