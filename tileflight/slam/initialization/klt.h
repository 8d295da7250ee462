#pragma once

// Corner detection and tracking between consecutive images, used by initialization only: Shi and Tomasi, CVPR 1994;
// inverse compositional translation (Baker and Matthews, IJCV 56(3), 2004), invariant to a change of gain and offset.

#include <optional>
#include <vector>

#include "tileflight/slam/keyframes/pyramid.h"

namespace tileflight::initialization {

/// Up to `wanted` corners spread over a grid: in each cell those with the largest minimum eigenvalue of the gradient's
/// second-moment matrix.
std::vector<Eigen::Vector2f> find_corners(const keyframes::Pyramid& pyramid, const keyframes::RayTable& rays,
                                          int wanted);

/// Pixel in `to` of each point of `from`; nullopt where the track is lost (outside the image, changed appearance, or a
/// failed forward-backward check).
std::vector<std::optional<Eigen::Vector2f>> track_corners(const keyframes::Pyramid& from, const keyframes::Pyramid& to,
                                                          const std::vector<Eigen::Vector2f>& points);

/// Tracks corners between images far apart: begins at `guesses`, one for each point, and leaves out levels that are so
/// coarse that guesses a few pixels off need none of them.
std::vector<std::optional<Eigen::Vector2f>> track_corners_from(const keyframes::Pyramid& from,
                                                               const keyframes::Pyramid& to,
                                                               const std::vector<Eigen::Vector2f>& points,
                                                               const std::vector<Eigen::Vector2f>& guesses);

}  // namespace tileflight::initialization
