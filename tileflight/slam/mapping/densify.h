#pragma once

// Densification of the map: the candidates of a keyframe that were never activated are fitted to the window's images
// when the keyframe leaves it.

#include <vector>

#include "tileflight/slam/keyframes/keyframe.h"
#include "tileflight/slam/keyframes/options.h"

namespace tileflight::mapping {

/// Refines the immature points of `host` that have a depth by Gauss-Newton on the inverse distance over all other
/// keyframes (as activation does), with poses and brightness fixed. Returns only points with at least
/// `options.map.min_observations` good residuals. The window is not changed, so trajectory and active points are not
/// affected.
std::vector<keyframes::ActivePoint> densify_keyframe(const keyframes::Window& window, const keyframes::Lens& lens,
                                                      int host, const keyframes::OdometryOptions& options);

}  // namespace tileflight::mapping
