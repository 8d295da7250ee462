#pragma once

// Finding a picture again that does not align with the newest keyframe: on all keyframes of the window, in directions
// about their own.

#include <optional>
#include <vector>

#include "tileflight/odometry/tracker.h"

namespace tileflight::odometry {

struct Relocalization {
  std::size_t keyframe = 0;   ///< index of the reference that it was found on
  AlignmentResult alignment;  ///< to that reference
};

/// Every reference is tried in its own direction and turned in steps up to a quarter of a radian about both axes of the
/// picture, on the coarsest level only; the best few are aligned on all levels. nullopt if none ends below
/// `accepted_rmse` (grey values) with a good part of its pixels in view.
std::optional<Relocalization> relocalize(const LensPyramid& lens, const std::vector<TrackingReference>& references,
                                         const Pyramid& target, double accepted_rmse, const TrackingOptions& options);

}  // namespace tileflight::odometry
