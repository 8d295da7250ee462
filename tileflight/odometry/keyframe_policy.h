#pragma once

// When a picture becomes a keyframe and which keyframes and points leave the window: section 3.1, steps 2 and 3.

#include "tileflight/odometry/keyframe.h"
#include "tileflight/odometry/options.h"
#include "tileflight/odometry/tracker.h"

namespace tileflight::odometry {

/// How a tracked picture differs from the keyframe it was tracked to.
struct TrackingChange {
  OpticalFlow flow;
  double log_brightness = 0.0;  ///< e^a is the gain between both
  double rmse = 0.0;            ///< grey values
  double first_rmse = 0.0;      ///< of the first picture tracked to this keyframe
};

/// The weighted sum of flow and brightness is over 1, or the residual doubled.
bool needs_keyframe(const TrackingChange& change, int width, int height, const WindowOptions& options);

/// Marks keyframes that should leave: ones nearly out of sight of the newest, and, when the window is full, one by its
/// distance score. To be called once the newest keyframe is in the window.
void mark_keyframes(Window& window, const Lens& lens, const WindowOptions& options);

/// Takes out of their hosts the points that left the view of the newest keyframe or whose host is marked: into the
/// prior where they were well observed, else dropped. Points that leave are appended to `left`, with their host's slot.
struct LeftPoint {
  int host = 0;
  ActivePoint point;
};
void retire_points(Window& window, const WindowOptions& options, std::vector<LeftPoint>& left);

}  // namespace tileflight::odometry
