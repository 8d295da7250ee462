#include "tileflight/slam/mapping/gauge.h"

#include "tileflight/core/geometry/decompositions.h"
#include "tileflight/slam/mapping/normal_equations.h"

namespace tileflight::mapping {

Eigen::MatrixXd gauge_nullspace(const keyframes::Window& window) {
  const bool scale_is_free = !window.has_stereo();
  Eigen::MatrixXd N = Eigen::MatrixXd::Zero(window.unknowns(), scale_is_free ? 7 : 6);
  for (int i = 0; i < window.size(); ++i) {
    const geometry::SE3& T = window.keyframes[i].T_camera_map_linear;
    // T exp(-e) = exp(-Ad(T) e) T; scaling the map by 1 + ds moves the translation by t ds.
    N.block<6, 6>(8 * i, 0) = -adjoint(T);
    if (scale_is_free) N.block<3, 1>(8 * i, 6) = T.translation;
  }
  return N;
}

Eigen::VectorXd remove_gauge_component(const Eigen::VectorXd& x, const Eigen::MatrixXd& directions) {
  return x - directions * geometry::solve_least_squares(directions, x);
}

}  // namespace tileflight::mapping
