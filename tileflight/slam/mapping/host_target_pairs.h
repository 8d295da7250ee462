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

/// Adds to `sums` (over the window's unknowns) how a residual couples them with one further unknown that moves pixels,
/// such as a point's inverse distance: J^T W j, with j = grad I d(pixel)/d(unknown) and
/// `by_unknown` = d(pixel)/d(unknown). Returns the sum of the gradients' squares times `by_unknown`.
inline Eigen::Vector2d add_coupling(const keyframes::Window& window, int host, const HostTargetPair& pair,
                                    const keyframes::Observation& observation, const Eigen::Vector2d& by_unknown,
                                    Eigen::VectorXd& sums) {
  const keyframes::Linearization& lin = observation.linearization;
  const Eigen::Vector2d weighted = lin.sums.gg.cast<double>() * by_unknown;
  keyframes::Vec8 coupling;
  coupling << lin.d_pixel_d_pose.cast<double>().transpose() * weighted,
      lin.sums.gA.cast<double>().transpose() * by_unknown;
  sums.segment<8>(8 * observation.target) += coupling;
  sums.segment<8>(8 * host) += pair.d_relative_d_host.transpose() * coupling;
  if (window.intrinsics.estimated) sums.tail<4>() += lin.d_pixel_d_intrinsics.cast<double>().transpose() * weighted;
  return weighted;
}

}  // namespace tileflight::mapping
