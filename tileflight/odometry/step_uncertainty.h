#pragma once

// How well the window knows a keyframe relative to the one before: the covariance of its pose, and that of the map's
// scale there. The scale is carried on by points whose distance is known and which both keyframes see; where the camera
// turns away from them, or they are few, it may change.

#include "tileflight/odometry/normal_equations.h"

namespace tileflight::odometry {

/// Of a step from one keyframe to the next, in units of the map.
struct StepUncertainty {
  Eigen::Matrix<double, 6, 6> pose = Eigen::Matrix<double, 6, 6>::Zero();  ///< covariance of the left twist of
                                                                           ///< T_camera_before; translation first
  double log_scale = 0.0;  ///< variance of the logarithm of the scale at the keyframe over the scale at the one before
  int known_points = 0;    ///< points that the keyframe sees whose distance is known to a tenth
  int points = 0;          ///< all points of the window that the keyframe sees
};

/// Of the window's keyframe `slot` (1 or above), its residuals being linearised at the present state.
/// `residual_variance`: of a residual, squared grey values. Slot 0 has its points only. The window is as
/// before afterwards.
StepUncertainty step_uncertainty(Window& window, int slot, double residual_variance);

}  // namespace tileflight::odometry
