#pragma once

// Turns immature points with a known inverse distance into active points of the optimisation, spread evenly over the
// image: DSO, section 3.2, "Candidate Point Activation".

#include "tileflight/slam/keyframes/keyframe.h"
#include "tileflight/slam/keyframes/options.h"

namespace tileflight::mapping {

/// Spacing between active points in the newest keyframe, adapted from keyframe to keyframe so as to reach the wanted
/// number of points.
struct ActivationSpacing {
  double pixels = 4.0;  ///< of level 1
};

/// Activates points of all keyframes but the newest and adds observations in all other keyframes. Points that fail are
/// removed. Returns the number of activated points.
int activate_points(keyframes::Window& window, const keyframes::Lens& lens, const keyframes::OdometryOptions& options,
                    ActivationSpacing& spacing);

/// Optimises the inverse distance of an immature point of keyframe `host` by Gauss-Newton over all other keyframes;
/// returns an active point if at least `min_good` residuals are good, else nullopt.
std::optional<keyframes::ActivePoint> try_activation(const keyframes::Window& window, const keyframes::Lens& lens,
                                                     int host, const keyframes::ImmaturePoint& point,
                                                     const keyframes::WindowOptions& options, int min_good);
/// Transforms from a host to all keyframes (by slot), to be reused for many points of that host.
std::vector<keyframes::PairTransform> pair_transforms_from(const keyframes::Window& window, int host);
std::optional<keyframes::ActivePoint> try_activation(const keyframes::Window& window, const keyframes::Lens& lens,
                                                     int host, const std::vector<keyframes::PairTransform>& pairs,
                                                     const keyframes::ImmaturePoint& point,
                                                     const keyframes::WindowOptions& options, int min_good);

}  // namespace tileflight::mapping
