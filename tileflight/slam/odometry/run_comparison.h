#pragma once

// Comparison of two runs over the same images, forwards and backwards. They initialize at different places and
// propagate scale in opposite directions, so they disagree if one of them initialized wrongly or its scale changed
// while the camera turned in place.

#include <optional>
#include <vector>

#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/slam/tracking/frame_quality.h"

namespace tileflight::odometry {

/// Distance between two trajectories of the same images after alignment by a similarity.
struct RunAgreement {
  std::size_t pictures = 0;   ///< images with a pose in both runs
  double rms_share = 0.0;     ///< RMS distance of the camera centres over the path length
  double worst_share = 0.0;   ///< largest distance over the path length
  double worst_time_s = 0.0;  ///< time of the largest distance
};

/// Measures how far apart two runs are. nullopt with fewer than `least` images in common, or with a path of zero
/// length. The rotation of the similarity comes from the orientations, so a straight path is enough. The path length is
/// the shorter one of both after alignment, so that a run whose scale collapsed is not divided by the longer path of
/// the other. Paths that no positive scale brings together disagree by the size of the first.
std::optional<RunAgreement> measure_agreement(const geometry::Trajectory& first, const geometry::Trajectory& second,
                                              std::size_t least = 5);

/// Difference of the motions since the previous keyframe between two runs, relative to the sigmas stated by the first
/// run: mean squared difference over twice the squared sigma. It is 1 if the sigmas are right and the errors of the two
/// runs are independent.
struct Dispersion {
  std::size_t pictures = 0;  ///< images compared
  double position = 1.0;
  double rotation = 1.0;
};

/// Estimates the dispersion between two runs. `quality` and `keyframes` belong to the first run. nullopt if fewer than
/// `least` images can be compared.
std::optional<Dispersion> estimate_dispersion(const geometry::Trajectory& first, const geometry::Trajectory& keyframes,
                                              const std::vector<tracking::FrameQuality>& quality,
                                              const geometry::Trajectory& second, std::size_t least = 10);

/// Multiplies the sigmas of positions and rotations by the square root of the dispersion, at least by one half. Each
/// flight has its own noise, texture and geometry, so two runs over it are used to calibrate its errors.
void rescale_sigmas(std::vector<tracking::FrameQuality>& quality, const Dispersion& dispersion);

}  // namespace tileflight::odometry
