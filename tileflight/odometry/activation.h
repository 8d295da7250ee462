#pragma once

// Immature points whose inverse distance is known become part of the optimisation, where the picture has room for them:
// section 3.2, "Candidate point activation".

#include "tileflight/odometry/keyframe.h"
#include "tileflight/odometry/options.h"

namespace tileflight::odometry {

/// Spacing between active points in the newest keyframe that leads to the wanted number of them; carried from keyframe
/// to keyframe.
struct ActivationSpacing {
  double pixels = 4.0;  ///< of level 1
};

/// Activates points of all keyframes but the newest and gives them observations in all others. Points that failed are
/// removed. Returns the number activated.
int activate_points(Window& window, const Lens& lens, const OdometryOptions& options, ActivationSpacing& spacing);

/// Turns an immature point of keyframe `host` into an active one if Gauss-Newton on its inverse distance in all other
/// keyframes ends with at least `min_good` good residuals.
std::optional<ActivePoint> try_activation(const Window& window, const Lens& lens, int host, const ImmaturePoint& point,
                                          const WindowOptions& options, int min_good);
/// The same for many points of one host, whose transforms to all keyframes (by slot) are made once.
std::vector<PairTransform> pairs_from(const Window& window, int host);
std::optional<ActivePoint> try_activation(const Window& window, const Lens& lens, int host,
                                          const std::vector<PairTransform>& pairs, const ImmaturePoint& point,
                                          const WindowOptions& options, int min_good);

}  // namespace tileflight::odometry
