#pragma once

#include <cstdint>

namespace tileflight::odometry {

/// How well a picture was tracked. Standard deviations are of the pose relative to the keyframe before (`keyframe`), in
/// units of the map, by the residuals' curvature and a factor for the errors that they share (calibrate() in
/// second_opinion.h makes them the flight's own); 0 where there is none before (the first keyframe) and where the
/// picture has no pose.
struct FrameQuality {
  std::int64_t frame = 0;  ///< InputFrame::index
  double time_s = 0.0;
  bool tracked = false;
  bool is_keyframe = false;
  int keyframe = -1;                ///< that the pose is relative to: position in OdometryResult::keyframes; -1: none
  double rmse = 0.0;                ///< of the alignment, grey values
  double inside_share = 0.0;        ///< of the keyframe's points that the picture shows
  double saturated_share = 0.0;     ///< of those, with a residual above the cut-off
  int known_points = 0;             ///< of the keyframe (its own, if it is one): distance known to a tenth
  double step = 0.0;                ///< distance of the camera from the keyframe's
  double sigma_position = 0.0;      ///< of the camera's position, root of the trace
  double sigma_rotation_rad = 0.0;  ///< root of the trace
  double sigma_log_scale = 0.0;  ///< of the logarithm of the map's scale here over the scale at the start: grows from
                                 ///< keyframe to keyframe
};

}  // namespace tileflight::odometry
