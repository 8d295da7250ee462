#pragma once

// The images before the first keyframe are tracked backwards in time, by the same steps as those after it: from the
// first map on, with a copy of it that grows in the opposite direction. The forward map is not changed,
// so that later images have the same poses, to the last bit, with or without earlier ones.

#include <cstddef>
#include <deque>

#include "tileflight/slam/odometry/odometry.h"
#include "tileflight/slam/odometry/preprocessor.h"
#include "tileflight/slam/odometry/tracking_log.h"

namespace tileflight::odometry {

/// Tracks the first `count` of `frames` (in order of time; the image after them is the first keyframe) from the last to
/// the first, until too many in a row do not align. `mapper` holds the first map and nothing else, and `log` the images
/// of the initialization; those tracked are put before them, and their keyframes and points into `log.earlier`.
/// `far_apart`: the images are (TrackingState). `observer` (may be empty) sees the keyframes in the order in which they
/// are made.
void track_backwards(const std::deque<InputFrame>& frames, std::size_t count, const OdometryOptions& options,
                     const Preprocessor& preprocessor, const mapping::Mapper& mapper, const KeyframeObserver& observer,
                     bool far_apart, TrackingLog& log);

}  // namespace tileflight::odometry
