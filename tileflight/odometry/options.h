#pragma once

#include <cstdint>

namespace tileflight::odometry {

/// How the first map is made (initializer.h).
struct StartOptions {
  int corners = 900;                ///< corners that are followed from the first picture on
  int max_frames = 90;              ///< pictures kept waiting for parallax; older ones are let go after that
  double min_parallax_rad = 0.026;  ///< median angle left between rays after the best rotation, before a start is tried
  double last_parallax_rad = 0.009;     ///< the same where the tracks are about to be lost
  double enough_parallax_rad = 0.08;    ///< with this much the best hypothesis is taken even if a second one is close
  double max_cost_ratio = 0.8;          ///< best over second-best hypothesis (joint cost) that counts as decided
  double max_median_residual_px = 0.7;  ///< a start whose tracks fit worse than this is refused
  int min_tracks = 60;                  ///< corners that must still be followed
  int keyframes = 4;                    ///< keyframes made out of the start window
  int bundle_frames = 14;               ///< pictures of the start window in the joint adjustment
  std::uint32_t seed = 1;               ///< of the random samples (two_view.h)
};

/// Which pixels become points (pixel_selector.h); section 3.2 of the paper.
struct SelectionOptions {
  int points_per_keyframe = 1500;  ///< immature points a keyframe hosts
  float min_gradient = 7.0F;       ///< added to the region's median gradient, grey values a pixel
  int border_px = 6;               ///< no point nearer to the picture's edge
};

/// Direct image alignment to the newest keyframe (tracker.h); section 3.1.
struct TrackingOptions {
  float huber = 9.0F;             ///< grey values
  float cutoff = 20.0F;           ///< residual above which a pixel counts as saturated, grey values
  float gradient_weight = 50.0F;  ///< c of eq. 7, grey values a pixel
  double accept_ratio = 1.5;      ///< of RMSE to the last frame's RMSE: a hypothesis is taken without trying others
  double lost_rmse = 16.0;        ///< grey values: worse than this is not tracking
  double min_inside_share = 0.1;  ///< of the keyframe's points that must be seen
  double max_log_gain = 1.2;      ///< change of log brightness to the keyframe beyond which a fit is none
  int patience_frames = 30;       ///< frames in a row that may fail before the odometry is called lost
};

/// Following immature points along their epipolar curves (tracer.h); section 3.2.
struct TracingOptions {
  double max_search_share = 0.027;          ///< of width + height: longest search, pixels
  double slack_px = 2.0;                    ///< uncertainty below this needs no tracing any more
  float min_quality = 3.0F;                 ///< second-best over best match, for activation
  float outlier_energy_per_pixel = 144.0F;  ///< squared grey values
};

/// The sliding window (window.h); section 2.3 and 3.3.
struct WindowOptions {
  int min_keyframes = 5;
  int max_keyframes = 7;
  int active_points = 2000;
  int iterations = 3;             ///< Gauss-Newton steps at a keyframe
  float huber = 9.0F;             ///< grey values
  float gradient_weight = 50.0F;  ///< c of eq. 7, grey values a pixel
  double keyframe_shift = 0.025;  ///< optical flow, as a share of width + height, that makes a keyframe
  double keyframe_light = 0.5;    ///< change of log brightness that makes a keyframe
  double marginal_weight =
      0.25;  ///< information of marginalised points is scaled by this (their errors are correlated)
  double min_points_left_share = 0.05;  ///< a keyframe with fewer of its points in the newest one is marginalised
  double light_prior_weight = 1e-1;     ///< information on a keyframe's light offset without a photometric calibration
  bool refine_intrinsics = true;        ///< focal lengths and principal point are estimated too, from the given ones on
  double focal_deviation = 0.02;        ///< standard deviation of the given focal length, as a share of it
  double aspect_deviation = 5e-4;       ///< of fx / fy: pixels are square
  double principal_point_deviation = 0.0015;  ///< in focal lengths
};

/// Which points are written to the map (map.h).
struct MapOptions {
  int min_observations = 3;              ///< good residuals a point had
  double max_relative_deviation = 0.05;  ///< standard deviation of the inverse distance over the inverse distance
  double min_parallax_rad = 0.015;       ///< between the host's ray and the widest observation
  bool dense = true;  ///< also points that had no room in the optimisation, fitted once when their keyframe leaves
};

/// Places that the flight comes back to (loop_closure.h).
struct LoopOptions {
  bool enabled = false;
  int candidates = 5;            ///< earlier keyframes that each one is compared to
  int min_gap_keyframes = 15;    ///< nearer ones saw each other in the window
  int min_inliers = 25;          ///< corners that fit by one similarity
  double min_spread_rad = 0.12;  ///< root mean square angle of their rays about the mean
  int neighbours = 4;            ///< keyframes to either side that are asked for the same correction
  int min_supporters = 2;        ///< of them that must say it
  double max_drift_share = 0.1;  ///< of the path since then: a larger correction is taken for a look-alike
  double max_log_scale = 0.7;    ///< likewise, logarithm of the change of scale
  double max_turn_rad = 0.5;     ///< likewise
};

/// Every setting of the odometry.
struct OdometryOptions {
  StartOptions start;
  SelectionOptions selection;
  TrackingOptions tracking;
  TracingOptions tracing;
  WindowOptions window;
  MapOptions map;
  int max_pyramid_levels = 6;    ///< level 0 is the picture itself
  int min_level_area_px = 1500;  ///< no coarser level than this
  LoopOptions loops;
};

}  // namespace tileflight::odometry
