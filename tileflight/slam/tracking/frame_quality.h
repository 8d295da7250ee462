#pragma once

#include <cstdint>

namespace tileflight::tracking {

/// Measures of how well an image was tracked. Standard deviations are of the pose relative to the keyframe that it was
/// tracked to
/// (`keyframe`: the previous one, or, before the first map's first keyframe, the next one), in map units. They follow
/// from the curvature of the residuals and a factor for correlated errors (rescale_sigmas() in run_comparison.h
/// calibrates them for a flight); 0 for the first keyframe and for images without a pose.
struct FrameQuality {
  std::int64_t frame = 0;  ///< InputFrame::index
  double time_s = 0.0;
  bool tracked = false;
  bool is_keyframe = false;
  int keyframe = -1;                  ///< reference of the pose: index into OdometryResult::keyframes; -1: none
  double rmse = 0.0;                  ///< of the alignment, grey values
  double inside_share = 0.0;          ///< share of the keyframe's points visible in the image
  double saturated_share = 0.0;       ///< share of those with a residual above the cut-off
  int known_points = 0;               ///< points of the keyframe (its own, if it is one) with a distance known to a
                                      ///< tenth
  double distance_to_keyframe = 0.0;  ///< distance between the camera centres of image and keyframe
  double sigma_position = 0.0;        ///< of the camera's position, root of the covariance's trace
  double sigma_rotation_rad = 0.0;    ///< root of the trace
  double sigma_log_scale = 0.0;  ///< of log(map scale here / map scale at the first map's first keyframe); grows from
                                 ///< keyframe to keyframe, away from that one
};

}  // namespace tileflight::tracking
