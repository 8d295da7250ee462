#pragma once

// Uncertainty of a keyframe relative to the previous one: covariance of its pose and variance of the map's scale. Scale
// is propagated by points with known distance that both keyframes see; if the camera turns away from them, or they are
// few, the scale may drift.

#include "tileflight/slam/mapping/normal_equations.h"

namespace tileflight::mapping {

/// Uncertainty of the motion from one keyframe to the next, in map units.
struct StepUncertainty {
  Eigen::Matrix<double, 6, 6> pose = Eigen::Matrix<double, 6, 6>::Zero();  ///< covariance of the left twist of
                                                                           ///< T_camera_before; translation first
  double log_scale = 0.0;  ///< variance of log(scale at the keyframe / scale at the previous one)
  bool is_metric = false;  ///< with stereo cameras: `log_scale` is that of log(scale at the keyframe / true scale)
  int before = -1;         ///< id of the keyframe before; -1: none
  geometry::SE3 T_before_keyframe;  ///< pose in the axes of the keyframe before when both were last in the window, set
                                    ///< by the Mapper. Of two that leave at different times the one that stays is moved
                                    ///< further by what later keyframes see of it
  int known_points = 0;             ///< points visible in the keyframe with a distance known to a tenth
  int points = 0;                   ///< all points of the window visible in the keyframe
};

/// Uncertainty of the window's keyframe `slot`, with residuals linearised at the present state. `residual_variance`: of
/// one residual, squared grey values. For slot 0 only the point counts are set. The window is restored afterwards.
StepUncertainty step_uncertainty(keyframes::Window& window, int slot, double residual_variance);

}  // namespace tileflight::mapping
