#pragma once

#include <Eigen/Core>

#include "tileflight/odometry/keyframe.h"

namespace tileflight::odometry {

/// Directions of the window's unknowns that no residual can see: position and rotation of the map frame (6) and its
/// scale (1), at the linearisation points. As many rows as unknowns, 7 columns; the rows of light and lens are
/// zero.
Eigen::MatrixXd gauge_directions(const Window& window);

/// x without its part along the gauge directions.
Eigen::VectorXd without_gauge(const Eigen::VectorXd& x, const Eigen::MatrixXd& directions);

}  // namespace tileflight::odometry
