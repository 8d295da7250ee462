#pragma once

// Densification of the map: the candidates of a keyframe that were never activated are fitted to the window's images
// when the keyframe leaves it.

#include <vector>

#include "tileflight/photometry/keyframe.h"
#include "tileflight/photometry/options.h"

namespace tileflight::mapping {

/// Refines the immature points of `host` that have a depth by Gauss-Newton on the inverse distance over all other
/// keyframes (as activation does), with poses and brightness fixed. Returns only points with at least
/// `options.map.min_observations` good residuals. The window is not changed, so trajectory and active points are not
/// affected.
std::vector<photometry::ActivePoint> densify_keyframe(const photometry::Window& window, const photometry::Lens& lens,
                                                      int host, const photometry::OdometryOptions& options);

}  // namespace tileflight::mapping
