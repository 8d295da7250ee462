#pragma once

// Two runs over the same pictures, forwards and backwards, begin in different places and carry their scale the other
// way round: where one of them took a wrong start, or changed its scale while the camera turned in place, they
// disagree.

#include <optional>

#include "tileflight/geometry/trajectory.h"

namespace tileflight::odometry {

/// How far two trajectories of the same pictures lie from each other after the best similarity.
struct Agreement {
  std::size_t pictures = 0;   ///< that both have a pose of
  double rms_share = 0.0;     ///< root mean square distance of the cameras over the path's length
  double worst_share = 0.0;   ///< largest distance over the path's length
  double worst_time_s = 0.0;  ///< where it is
};

/// nullopt with fewer than `least` pictures in common, and without a path. The similarity's rotation is from the
/// orientations, so that a straight path is enough. The path is that of `first` or of `second`, whichever is shorter
/// after the similarity: a scale that collapsed must not hide behind the other's length.
std::optional<Agreement> agreement(const geometry::Trajectory& first, const geometry::Trajectory& second,
                                   std::size_t least = 5);

}  // namespace tileflight::odometry
