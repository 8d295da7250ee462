#pragma once

// One unknown's couplings with those of the window, residual by residual: J^T W j for the column j of an unknown that
// moves pixels, such as a point's inverse distance.

#include "tileflight/slam/mapping/host_target_pairs.h"

namespace tileflight::mapping {

/// Adds to `sums` (over the window's unknowns) a residual's J^T W j, with j = grad I d(pixel)/d(unknown) and
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
