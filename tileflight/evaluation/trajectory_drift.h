#pragma once

#include "tileflight/evaluation/metrics.h"

namespace tileflight::evaluation {

/// Stretch that a path is measured in: the largest of 1, 2 and 5 times a power of ten that is at most a tenth of it,
/// and at most 100 m. 0 for a path without length.
double stretch_m(double path_length_m);

/// Mean error over all sub-paths of the eight lengths 1 to 8 stretches (those of KITTI's odometry benchmark, 100 to
/// 800 m, on paths from 1 km): Geiger et al., CVPR 2012, section 3.1. Poses are paired one by one. A sub-path leads
/// from any pose to the first one where the true path has grown by the length; its errors are divided by the growth,
/// which exceeds the length by less than a step (the benchmark's program divides by the length itself).
PathDrift path_drift(const geometry::Trajectory& estimate, const geometry::Trajectory& truth);

/// True over estimated length of consecutive stretches, each to the first pose where the true path has grown by one;
/// what is left at the end is no stretch. The estimate is at the scale of the global alignment.
ScaleDrift scale_drift(const geometry::Trajectory& estimate, const geometry::Trajectory& truth);

}  // namespace tileflight::evaluation
