#pragma once

// A rolling shutter whose row times are not known: the images are tracked, the line delay is estimated from the
// residuals that are left, and they are tracked again with it, until it stays.

#include <functional>
#include <optional>

#include "tileflight/slam/odometry/odometry.h"

namespace tileflight::odometry {

/// What all passes found.
struct LineDelayPasses {
  OdometryResult result;                               ///< of the last one
  double line_delay_s = 0.0;                           ///< that it was tracked with
  std::optional<mapping::LineDelayEstimate> estimate;  ///< of the whole delay; nullopt: too few keyframes
  int passes = 0;
};

/// `track` tracks the images with OdometryOptions::estimate_line_delay and a line delay in the order of play. An
/// estimate that differs from `given_s` by less than three standard deviations is not used: the shutter may be as
/// given.
LineDelayPasses track_with_line_delay(double given_s, const std::function<OdometryResult(double line_delay_s)>& track);

}  // namespace tileflight::odometry
