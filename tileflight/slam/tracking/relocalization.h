#pragma once

// Relocalization of an image that does not align with the newest keyframe: against all keyframes of the window, with
// view directions around theirs.

#include <optional>
#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/slam/keyframes/pyramid.h"
#include "tileflight/slam/tracking/tracker.h"
#include "tileflight/slam/tracking/tracking_reference.h"

namespace tileflight::tracking {

/// Returns Pearson's correlation, which tells whether an image shows what a keyframe expects, independent of how the
/// alignment weighs residuals: between the reference's grey values and the target's where both show the same points, at
/// level 0; whatever gain and offset are. 0 if fewer than three points are inside the target, or one has no contrast.
double correlation(const keyframes::LensPyramid& lens, const TrackingReference& reference,
                   const keyframes::Pyramid& target, const geometry::SE3& T_target_reference);

/// Least correlation of grey values seen and expected, by correlation(). An alignment to another place lowers the gain
/// and lets what does not fit saturate, so that its RMSE may pass: one did with a correlation of 0.17 (docs/trust.md).
/// Right ones have 0.93 to 0.999.
inline constexpr double kMinCorrelation = 0.6;

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
