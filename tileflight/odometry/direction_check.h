#pragma once

// A run checked by others over the same images: in the other direction, and, where both directions disagree, from a
// later image in each. All begin at different places, so that a wrong initialization is in one of them only.

#include <cstddef>
#include <functional>
#include <optional>

#include "tileflight/geometry/trajectory.h"
#include "tileflight/odometry/odometry.h"
#include "tileflight/odometry/run_comparison.h"
#include "tileflight/odometry/tracking_doubts.h"

namespace tileflight::odometry {

enum class Direction { kSame, kOther };  ///< as the run that is checked, or against it

/// Tracks the images of the run that is checked, in either direction, without the first `left_out` of that direction.
/// The times of the result's trajectory are those of the run that is checked, increasing.
using FurtherRun = std::function<OdometryResult(Direction direction, std::size_t left_out)>;

/// What further runs tell of a run.
struct DirectionCheck {
  bool use_other = false;  ///< the run in the other direction is to be used
  /// Between both directions, if they disagree and their own residuals and warnings do not tell which is right.
  std::optional<RunAgreement> disagreement;
  geometry::Trajectory counterpart;  ///< of a run against the one that is to be used, to estimate errors from
};

/// Checks `run`, of `images` images. Of two directions that disagree, the one is used that a run against it from a
/// later image agrees with (then RunAgreement::is_answered); else one that is found again from a later image while the
/// other is not; else as choose_run() says. `may_use_other`: without it the run itself is used in any case, and later
/// images are not tried.
DirectionCheck check_directions(const OdometryResult& run, std::size_t images, bool may_use_other,
                                const FurtherRun& track, const DoubtThresholds& limits = {});

}  // namespace tileflight::odometry
