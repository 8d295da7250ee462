#pragma once

#include "tileflight/core/geometry/transform.h"

namespace tileflight::inertial {

/// A keyframe of the camera's odometry.
struct VisualKeyframe {
  double time_s = 0.0;  ///< the camera's clock
  geometry::SE3 T_map_camera;
  Eigen::Matrix<double, 6, 6> step_covariance =
      Eigen::Matrix<double, 6, 6>::Zero();  ///< of the motion from the keyframe before: right twist, translation first,
                                            ///< map units
  double step_log_scale_variance = 0.0;     ///< of log(the map's scale here / that at the keyframe before)
  bool is_metric = false;  ///< the map is in metres (static stereo): `step_log_scale_variance` is that of log(the map's
                           ///< scale here / the true one)
};

}  // namespace tileflight::inertial
