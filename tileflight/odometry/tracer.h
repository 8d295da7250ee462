#pragma once

// Search for an immature point along its epipolar curve: section 3.2 of the paper, on the sphere. In the target the
// point lies on the great circle from R r (rho = 0) towards t (rho -> infinity); phi is the angle along it, psi the
// angle between both:
//   tan(phi) = rho |t| sin(psi) / (1 + rho |t| cos(psi)),      rho = sin(phi) / (|t| sin(psi - phi)).

#include "tileflight/odometry/keyframe.h"
#include "tileflight/odometry/options.h"

namespace tileflight::odometry {

/// Updates the point's interval of inverse distance from one more picture with known pose and light.
void trace_point(const Lens& lens, const PyramidLevel& target, const PairTransform& pair, const TracingOptions& options,
                 float huber, ImmaturePoint& point);

/// The same for many points, in parallel.
void trace_points(const Lens& lens, const PyramidLevel& target, const PairTransform& pair,
                  const TracingOptions& options, float huber, std::vector<ImmaturePoint>& points);

}  // namespace tileflight::odometry
