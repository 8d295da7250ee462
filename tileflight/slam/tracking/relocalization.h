#pragma once

// Relocalization of an image that does not align with the newest keyframe: against all keyframes of the window, with
// view directions around theirs.

#include <optional>
#include <vector>

#include "tileflight/slam/tracking/tracker.h"

namespace tileflight::tracking {

struct Relocalization {
  std::size_t keyframe = 0;  ///< index of the reference it aligned to
  ImageAlignment alignment;  ///< to that reference
};

/// Tries each reference with its own orientation and rotated in steps up to a quarter of a radian about both image axes
/// or up to half a radian about the optical axis and a quarter about the image's vertical axis (a vehicle's turn), on
/// the coarsest level only; the best few are aligned on all levels. nullopt if none reaches an RMSE below
/// `accepted_rmse` (grey values) with enough of its pixels in view and grey values that correlate.
std::optional<Relocalization> relocalize(const keyframes::LensPyramid& lens,
                                         const std::vector<TrackingReference>& references,
                                         const keyframes::Pyramid& target, double accepted_rmse,
                                         const keyframes::TrackingOptions& options);

}  // namespace tileflight::tracking
