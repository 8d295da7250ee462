#pragma once

// Decides when an image becomes a keyframe and which keyframes and points leave the window: DSO, section 3.1, steps 2
// and 3.

#include "tileflight/slam/keyframes/keyframe.h"
#include "tileflight/slam/keyframes/options.h"
#include "tileflight/slam/tracking/tracker.h"

namespace tileflight::mapping {

/// Difference of a tracked image from the keyframe it was tracked to.
struct TrackingChange {
  tracking::OpticalFlow flow;
  double log_brightness = 0.0;  ///< e^a is the gain between both
  double rmse = 0.0;            ///< grey values
  double first_rmse = 0.0;      ///< of the first image tracked to this keyframe, grey values
};

/// Returns whether the weighted sum of flow and brightness change exceeds 1, or the RMSE doubled.
bool needs_keyframe(const TrackingChange& change, int width, int height, const keyframes::WindowOptions& options);

/// Marks keyframes to marginalise: those with too few points visible in the newest one or a brightness change of more
/// than e^0.7 to it and, if the window is full, one more by its distance score (DSO, eq. 20). Call after the newest
/// keyframe was added.
void flag_for_marginalization(keyframes::Window& window, const keyframes::Lens& lens,
                              const keyframes::WindowOptions& options);

/// An active point that leaves the window, with its host's slot.
struct RetiredPoint {
  int host = 0;
  keyframes::ActivePoint point;
};
/// Removes the points that left the view of the newest keyframe or whose host is marked: well observed ones are
/// marginalised into the prior, the others dropped. Appends the removed points to `left`.
void retire_points(keyframes::Window& window, const keyframes::WindowOptions& options, std::vector<RetiredPoint>& left);

}  // namespace tileflight::mapping
