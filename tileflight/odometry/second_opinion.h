#pragma once

// Two runs over the same pictures, forwards and backwards, begin in different places and carry their scale the other
// way round: where one of them took a wrong start, or changed its scale while the camera turned in place, they
// disagree.

#include <optional>
#include <vector>

#include "tileflight/geometry/trajectory.h"
#include "tileflight/odometry/frame_quality.h"

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

/// How far two runs' steps from the keyframe before differ, in the sigmas that the first run states of them: 1 where
/// the sigmas are right and the two runs' errors their own. Mean squared difference over twice the squared sigma.
struct Dispersion {
  std::size_t pictures = 0;  ///< that were compared
  double position = 1.0;
  double rotation = 1.0;
};

/// `quality` and `keyframes`: of the first run. nullopt where fewer than `least` pictures can be compared.
std::optional<Dispersion> dispersion(const geometry::Trajectory& first, const geometry::Trajectory& keyframes,
                                     const std::vector<FrameQuality>& quality, const geometry::Trajectory& second,
                                     std::size_t least = 10);

/// Multiplies the sigmas of positions and rotations by the root of the dispersion, at least by a half: each flight has
/// its own noise, texture and geometry, and two runs over it tell what its errors really are.
void calibrate(std::vector<FrameQuality>& quality, const Dispersion& dispersion);

}  // namespace tileflight::odometry
