#pragma once

// Whether an image shows what a keyframe expects, independent of how the alignment weighs residuals.

#include "tileflight/core/geometry/transform.h"
#include "tileflight/slam/keyframes/pyramid.h"
#include "tileflight/slam/tracking/tracking_reference.h"

namespace tileflight::tracking {

/// Pearson's correlation between the reference's grey values and the target's where both show the same points, at level
/// 0; whatever gain and offset are. 0 if fewer than three points are inside the target, or one has no contrast.
double correlation(const keyframes::LensPyramid& lens, const TrackingReference& reference,
                   const keyframes::Pyramid& target, const geometry::SE3& T_target_reference);

}  // namespace tileflight::tracking
