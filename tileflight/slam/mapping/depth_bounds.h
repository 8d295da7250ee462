#pragma once

// Bounds of inverse distances by what is known around them, for images so far apart that a search from infinity would
// be long and ambiguous.

#include <vector>

#include "tileflight/slam/keyframes/keyframe.h"
#include "tileflight/slam/tracking/tracking_reference.h"

namespace tileflight::mapping {

/// Bounds the inverse distance of each point by those of the nearest known pixels, with a margin. `known`: pixels of
/// the points' own keyframe; with too few of them the points are left as they are.
void bound_by_neighbours(const std::vector<tracking::ReferencePoint>& known,
                         std::vector<keyframes::ImmaturePoint>& points);

}  // namespace tileflight::mapping
