#pragma once

#include <Eigen/Core>

#include "tileflight/slam/keyframes/keyframe.h"

namespace tileflight::mapping {

/// Unobservable directions of the window's unknowns: position and rotation of the map frame (6) and, without stereo
/// cameras, its scale (1), at the linearisation points. One row per unknown, a column for each direction; the rows of
/// brightness and intrinsics are zero.
Eigen::MatrixXd gauge_nullspace(const keyframes::Window& window);

/// Projects x onto the complement of the gauge directions (the columns of `directions`).
Eigen::VectorXd remove_gauge_component(const Eigen::VectorXd& x, const Eigen::MatrixXd& directions);

}  // namespace tileflight::mapping
