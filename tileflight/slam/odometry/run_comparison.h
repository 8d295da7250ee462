#pragma once

// Comparison of two runs over the same images, forwards and backwards. They initialize at different places and
// propagate scale in opposite directions, so they disagree if one of them initialized wrongly or its scale changed
// while the camera turned in place.

// A run checked by others over the same images: in the other direction, and, where both directions disagree, begun at
// later images in each. A wrong initialization is seldom repeated from another image, and leaves warnings; a scale that
// changed on the way (a turn in place) changes alike wherever a run in that direction begins.

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/slam/odometry/odometry.h"
#include "tileflight/slam/odometry/tracking_warnings.h"
#include "tileflight/slam/tracking/frame_quality.h"

namespace tileflight::odometry {

/// Distance between two trajectories of the same images after alignment by a similarity.
struct RunAgreement {
  std::size_t pictures = 0;   ///< images with a pose in both runs
  double rms_share = 0.0;     ///< RMS distance of the camera centres over the path length
  double worst_share = 0.0;   ///< largest distance over the path length
  double worst_time_s = 0.0;  ///< time of the largest distance
};

/// nullopt with fewer than `least` images in common, or with a path of zero length. The rotation of the similarity
/// comes from the orientations, so a straight path is enough. The path length is the shorter one of both after
/// alignment, so that a run whose scale collapsed is not divided by the longer path of the other. Paths that
/// no positive scale brings together disagree by the size of the first.
std::optional<RunAgreement> measure_agreement(const geometry::Trajectory& first, const geometry::Trajectory& second,
                                              std::size_t least = 5);

/// How far the motions since the previous keyframe differ between two runs, relative to the sigmas stated by the first
/// run: mean squared difference over twice the squared sigma. It is 1 if the sigmas are right and the errors of the two
/// runs are independent.
struct Dispersion {
  std::size_t pictures = 0;  ///< images compared
  double position = 1.0;
  double rotation = 1.0;
};

/// `quality` and `keyframes` belong to the first run. nullopt if fewer than `least` images can be compared.
std::optional<Dispersion> estimate_dispersion(const geometry::Trajectory& first, const geometry::Trajectory& keyframes,
                                              const std::vector<tracking::FrameQuality>& quality,
                                              const geometry::Trajectory& second, std::size_t least = 10);

/// Multiplies the sigmas of positions and rotations by the square root of the dispersion, at least by one half. Each
/// flight has its own noise, texture and geometry, so two runs over it are used to calibrate its errors.
void rescale_sigmas(std::vector<tracking::FrameQuality>& quality, const Dispersion& dispersion);

/// How a run goes over the images of the one that is checked.
struct RunStart {
  bool against = false;   ///< in the other direction
  std::size_t image = 0;  ///< InitializationOptions::first_image; images before it are tracked backwards from there
};

/// Tracks all images again. The times of the result's trajectory are those of the run that is checked, increasing.
using FurtherRun = std::function<OdometryResult(const RunStart& start)>;

/// What further runs tell of a run.
struct DirectionCheck {
  RunStart use;  ///< the run that is to be used; by default the one that is checked
  /// Between both directions, if they disagree and their own residuals and warnings do not tell which is right.
  std::optional<RunAgreement> disagreement;
  geometry::Trajectory counterpart;  ///< of another run than the one to be used, to estimate errors from
};

/// Checks `run`, of `images` images. Where both directions disagree, a path is used that two runs from different images
/// of a direction show, one of them without warnings (find_warnings()): that run. If both directions have such a path,
/// and not the same, or neither has one, choose_run() decides. `may_use_other`: without it the run itself is used in
/// any case, and later images are not tried.
DirectionCheck check_directions(const OdometryResult& run, std::size_t images, bool may_use_other,
                                const FurtherRun& track, const WarningThresholds& limits = {});

}  // namespace tileflight::odometry
