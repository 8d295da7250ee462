#pragma once

// A run checked by others over the same images: in the other direction, and, where both directions disagree, begun at
// later images in each. A wrong initialization is seldom repeated from another image, and leaves warnings; a scale that
// changed on the way (a turn in place) changes alike wherever a run in that direction begins.

#include <cstddef>
#include <functional>
#include <optional>

#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/slam/odometry/odometry.h"
#include "tileflight/slam/odometry/run_comparison.h"
#include "tileflight/slam/odometry/tracking_warnings.h"

namespace tileflight::odometry {

/// Direction and first image of a further run over the images of the run that is checked.
struct RunStart {
  bool against = false;   ///< in the other direction
  std::size_t image = 0;  ///< InitializationOptions::first_image; images before it are tracked backwards from there
};

/// Tracks all images again. The times of the result's trajectory are those of the run that is checked, increasing.
using FurtherRun = std::function<OdometryResult(const RunStart& start)>;

/// Result of check_directions().
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
