#pragma once

// Turns immature points with a known inverse distance into active points of the optimisation, spread evenly over the
// image: DSO, section 3.2, "Candidate Point Activation".

#include "tileflight/photometry/keyframe.h"
#include "tileflight/photometry/options.h"

namespace tileflight::mapping {

/// Spacing between active points in the newest keyframe, adapted from keyframe to keyframe so as to reach the wanted
/// number of points.
struct ActivationSpacing {
  double pixels = 4.0;  ///< of level 1
};

/// Activates points of all keyframes but the newest and adds observations in all other keyframes. Points that fail are
/// removed. Returns the number of activated points.
int activate_points(photometry::Window& window, const photometry::Lens& lens,
                    const photometry::OdometryOptions& options, ActivationSpacing& spacing);

/// Optimises the inverse distance of an immature point of keyframe `host` by Gauss-Newton over all other keyframes;
/// returns an active point if at least `min_good` residuals are good, else nullopt.
std::optional<photometry::ActivePoint> try_activation(const photometry::Window& window, const photometry::Lens& lens,
                                                      int host, const photometry::ImmaturePoint& point,
                                                      const photometry::WindowOptions& options, int min_good);
/// Transforms from a host to all keyframes (by slot), to be reused for many points of that host.
std::vector<photometry::PairTransform> pair_transforms_from(const photometry::Window& window, int host);
std::optional<photometry::ActivePoint> try_activation(const photometry::Window& window, const photometry::Lens& lens,
                                                      int host, const std::vector<photometry::PairTransform>& pairs,
                                                      const photometry::ImmaturePoint& point,
                                                      const photometry::WindowOptions& options, int min_good);

}  // namespace tileflight::mapping
