#pragma once

// Gauss-Newton system of the window: section 2.3 of the paper. Unknowns: 8 a keyframe (left twist of T_camera_map, a,
// b), four of the lens where it is estimated, one inverse distance a point. A residual depends on its host and target
// through their relative pose and light only, so that sums are kept by pair and moved to both keyframes' unknowns once:
//   x_rel = x_target + M x_host,   M = diag(-Ad(T_target_host), -1, -gain).

#include <vector>

#include "tileflight/odometry/keyframe.h"

namespace tileflight::odometry {

using Mat8 = Eigen::Matrix<double, 8, 8>;

/// Everything that residuals of one host and target share.
struct Pair {
  ResidualFrame frame;
  Mat8 relative_by_host = Mat8::Zero();  ///< M above, at the linearisation point
};

/// Pairs of a window by host * size + target.
std::vector<Pair> make_pairs(const Window& window);

/// Adjoint of a rigid motion on twists (translation first): T exp(x) = exp(Ad x) T.
Eigen::Matrix<double, 6, 6> adjoint(const SE3& T);

/// H x = -b over the keyframes' and the lens's unknowns, with the points eliminated (Schur complement).
struct NormalEquations {
  Eigen::MatrixXd H;
  Eigen::VectorXd b;
};

/// Which points enter a system, by host slot and index.
struct PointRef {
  int host = 0;
  int index = 0;
};
std::vector<PointRef> all_points(const Window& window);

/// Sums over the good observations of the points. `rho_damping`: H_rho_rho is multiplied by 1 + this in the
/// elimination. Also writes each point's information. Fixed chunks, added in order: the same for any number of threads.
NormalEquations build_normal_equations(Window& window, const std::vector<Pair>& pairs,
                                       const std::vector<PointRef>& points, double rho_damping);

/// Steps of the points' inverse distances that belong to the other unknowns' step x (into ActivePoint::step).
void back_substitute(Window& window, const std::vector<Pair>& pairs, const std::vector<PointRef>& points,
                     const Eigen::VectorXd& x, double rho_damping);

/// Stacked deltas of all keyframes, and of the lens where it is estimated, from their linearisation points.
Eigen::VectorXd stacked_delta(const Window& window);

}  // namespace tileflight::odometry
