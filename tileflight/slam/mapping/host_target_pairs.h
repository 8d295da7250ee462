#pragma once

// Relative pose and brightness of each two keyframes of a window, which all residuals of one host and target share, at
// the present state and at the linearisation point.

#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/slam/keyframes/keyframe.h"

namespace tileflight::mapping {

using Mat8 = Eigen::Matrix<double, 8, 8>;

/// Quantities shared by all residuals of one host and target.
struct HostTargetPair {
  keyframes::HostTargetPrecalc frame;
  Mat8 d_relative_d_host = Mat8::Zero();  ///< M of normal_equations.h, at the linearisation point
};

/// All host-target pairs of a window, at index host * size + target.
std::vector<HostTargetPair> make_host_target_pairs(const keyframes::Window& window);

/// Transforms from each keyframe to its stereo pictures, at index host * cameras + camera. Those of a keyframe without
/// that picture are not set.
std::vector<keyframes::HostTargetPrecalc> make_stereo_pairs(const keyframes::Window& window);

/// Adjoint of a rigid motion on twists (translation first): T exp(x) = exp(Ad x) T.
Eigen::Matrix<double, 6, 6> adjoint(const geometry::SE3& T);

}  // namespace tileflight::mapping
