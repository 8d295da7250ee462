#pragma once

#include "tileflight/evaluation/metrics/metrics.h"

namespace tileflight::metrics {

/// Returns T_from_to: pose `to` of a trajectory relative to pose `from`.
geometry::SE3 relative_motion(const geometry::Trajectory& trajectory, std::size_t from, std::size_t to);

/// Returns the segment length for measuring drift: the largest of 1, 2 and 5 times a power of ten that is at most a
/// tenth of the path, and at most 100 m. 0 for a path of zero length.
double choose_segment_length_m(double path_length_m);

/// Computes the mean error over all sub-paths of 1 to 8 segments (100 to 800 m, as in KITTI's odometry benchmark, for
/// paths from 1 km on): Geiger et al., CVPR 2012, section 3.1. Poses correspond by index. A sub-path leads from any
/// pose to the first one at which the true path has grown by the length. Its errors are divided by the actual growth,
/// which exceeds the length by less than one step (KITTI's code divides by the length itself).
PathDrift compute_path_drift(const geometry::Trajectory& estimate, const geometry::Trajectory& truth);

/// Computes the true over the estimated length of consecutive segments, each ending at the first pose at which the true
/// path has grown by the segment length. The remainder at the end is ignored. The estimate has the scale of the global
/// alignment.
ScaleDrift compute_scale_drift(const geometry::Trajectory& estimate, const geometry::Trajectory& truth);

}  // namespace tileflight::metrics
