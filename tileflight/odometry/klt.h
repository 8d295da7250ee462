#pragma once

// Corners and their tracks from one picture to the next, for the start only: Shi and Tomasi, CVPR 1994; inverse
// compositional translation (Baker and Matthews, IJCV 56(3), 2004) that does not mind a change of gain and offset.

#include <optional>
#include <vector>

#include "tileflight/odometry/pyramid.h"

namespace tileflight::odometry {

/// Up to `wanted` corners spread over a grid: in each cell those with the largest smaller eigenvalue of the gradient's
/// second moments.
std::vector<Eigen::Vector2f> find_corners(const Pyramid& pyramid, const RayTable& rays, int wanted);

/// Where each point of `from` is in `to`; nullopt where it is lost (outside, other looks, or the way back ends
/// elsewhere).
std::vector<std::optional<Eigen::Vector2f>> track_corners(const Pyramid& from, const Pyramid& to,
                                                          const std::vector<Eigen::Vector2f>& points);

}  // namespace tileflight::odometry
