#pragma once

// More points for the map than the optimisation needs: a keyframe's other candidates, fitted to the window's pictures
// when the keyframe leaves it.

#include <vector>

#include "tileflight/odometry/keyframe.h"
#include "tileflight/odometry/options.h"

namespace tileflight::odometry {

/// The immature points of `host` whose inverse distance was found, by Gauss-Newton on it alone in all other keyframes
/// of the window (as activation does), with poses and light as they are. Only points with
/// `options.map.min_observations` good residuals. The window is not changed, so trajectory and active points do not
/// depend on this.
std::vector<ActivePoint> further_points(const Window& window, const Lens& lens, int host,
                                        const OdometryOptions& options);

}  // namespace tileflight::odometry
