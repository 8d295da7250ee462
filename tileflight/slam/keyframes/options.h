#pragma once

#include <cstdint>

namespace tileflight::keyframes {

/// Initialization of the first map (initializer.h). Not DSO's method; the values are chosen by hand.
struct InitializationOptions {
  int corners = 900;                ///< corners tracked from the first image on
  int max_frames = 90;              ///< images over which parallax is waited for, from one first image
  double buffer_mb = 512.0;         ///< images kept to be tracked backwards from the first map, megabytes (3 bytes a
                                    ///< pixel); beyond that the oldest are dropped, but never those of the attempt
  double min_parallax_rad = 0.026;  ///< median angle between rays after the best rotation, before initialization is
                                    ///< tried
  double fallback_parallax_rad = 0.009;   ///< the same angle, used when the tracks are about to be lost
  double sufficient_parallax_rad = 0.08;  ///< with this much parallax the best hypothesis is accepted even if the
                                          ///< second fits nearly as well
  double max_cost_ratio = 0.8;            ///< joint cost of the best over the second-best hypothesis below which the
                                          ///< choice is decided
  double max_median_residual_px = 0.7;    ///< an initialization with a larger median residual is rejected
  int min_tracks = 60;                    ///< corners that must still be tracked
  int keyframes = 4;                      ///< keyframes made from the initialization window
  int bundle_frames = 14;                 ///< images of the initialization window in the bundle adjustment
  std::size_t first_image = 0;            ///< images before this one are not used, but tracked backwards
  std::uint32_t seed = 1;                 ///< of the RANSAC samples (two_view.h)
};

/// Which pixels become points (pixel_selector.h); DSO, section 3.2. 1500 points and the offset 7 are the values of
/// DSO's implementation.
struct SelectionOptions {
  int points_per_keyframe = 1500;  ///< immature points per keyframe
  float min_gradient = 7.0F;       ///< added to the region's median gradient, grey values per pixel
  int border_px = 6;               ///< minimum distance of a point from the image border
};

/// Direct image alignment to the newest keyframe (tracker.h); DSO, section 3.1. `huber`, `cutoff`, `gradient_weight`
/// and `accept_ratio` have the values of DSO's implementation; the others are chosen by hand.
struct TrackingOptions {
  float huber = 9.0F;             ///< grey values
  float cutoff = 20.0F;           ///< residual above which a pixel is saturated, grey values
  float gradient_weight = 50.0F;  ///< c of DSO, eq. 7, grey values per pixel
  double accept_ratio = 1.5;      ///< RMSE over the last frame's RMSE below which a hypothesis is accepted without
                                  ///< trying others
  double lost_rmse = 16.0;        ///< grey values; with a larger RMSE tracking has failed
  double min_inside_share = 0.1;  ///< share of the keyframe's points that must be visible
  double max_log_gain = 1.2;      ///< change of log brightness to the keyframe above which an alignment is rejected
  int max_failed_frames = 30;     ///< consecutive failed frames after which the odometry is lost
};

/// Depth search for immature points along their epipolar curves (tracer.h); DSO, section 3.2. All but `slack_px` and
/// `stereo_search_share` (chosen by hand) have the values of DSO's implementation, which multiplies the outlier energy
/// by 1.2 here.
struct TracingOptions {
  double max_search_share = 0.027;          ///< longest search in pixels, as a share of width + height
  double stereo_search_share = 0.1;         ///< the same in a stereo camera's picture, where nothing is known before
  int max_steps = 128;                      ///< of a search, each about a pixel while it is not longer
  double slack_px = 2.0;                    ///< search interval below which a point is not traced any more
  float min_quality = 3.0F;                 ///< second-best over best match, for activation
  float outlier_energy_per_pixel = 144.0F;  ///< squared grey values
};

/// The sliding window (slam/mapping/mapper.h); DSO, sections 2.3, 3.1 and 3.2. Window size, active points, `huber`,
/// `gradient_weight`, `keyframe_log_brightness`, `marginal_weight` (0.5^2), `min_residuals`, `min_observations` and
/// `min_visible_share` have the values of DSO's implementation; the others are chosen by hand.
struct WindowOptions {
  int min_keyframes = 5;
  int max_keyframes = 7;
  int active_points = 2000;
  int iterations = 3;                    ///< Gauss-Newton steps at a keyframe
  float huber = 9.0F;                    ///< grey values
  float gradient_weight = 50.0F;         ///< c of DSO, eq. 7, grey values per pixel
  double keyframe_flow_share = 0.025;    ///< optical flow, as a share of width + height, at which a keyframe is made
  double keyframe_log_brightness = 0.5;  ///< change of log brightness at which a keyframe is made
  double marginal_weight = 0.25;    ///< factor on the information of marginalised points (their errors are correlated)
  int min_residuals = 3;            ///< that a point has when it leaves, and
  int min_observations = 4;         ///< good ones in all, for it to be marginalised rather than dropped
  double min_visible_share = 0.05;  ///< a keyframe with a smaller share of its points visible in the newest one is
                                    ///< marginalised
  bool refine_intrinsics = true;    ///< also estimate focal lengths and principal point, starting from the given ones
  double focal_sigma = 0.02;        ///< standard deviation of the given focal length, as a share of it
  double aspect_sigma = 5e-4;       ///< of fx / fy relative to the given ratio
  double principal_point_sigma = 0.0015;  ///< of the principal point, in focal lengths
  float stereo_weight = 1.0F;  ///< of a residual in a stereo picture over one in a keyframe (the coupling factor of
                               ///< Stereo DSO); chosen by hand
};

/// Which points are written to the map (map.h). The values are chosen by hand.
struct MapOptions {
  int min_observations = 3;          ///< minimum number of good residuals of a point
  double max_relative_sigma = 0.05;  ///< largest standard deviation of the inverse distance, relative to it
  double min_parallax_rad = 0.015;   ///< smallest angle between the host's ray and the widest observation
  bool dense = true;  ///< also keep points that were not part of the optimisation; each is fitted once when its
                      ///< keyframe leaves the window
};

/// Loop closure (loop_closure.h). The values are chosen by hand.
struct LoopOptions {
  bool enabled = false;
  int candidates = 5;             ///< earlier keyframes that each keyframe is compared with
  int min_gap_keyframes = 15;     ///< closer keyframes share the sliding window and are not loops
  int min_inliers = 25;           ///< features consistent with one similarity
  double min_spread_rad = 0.12;   ///< RMS angle of their rays about the mean
  int neighbours = 4;             ///< keyframes on either side that are checked for the same correction
  int min_supporters = 2;         ///< of them that must confirm it
  double max_drift_share = 0.1;   ///< of the path length in between; a larger correction is treated as a false match
  double max_log_scale = 0.7;     ///< same limit for the logarithm of the scale change
  double max_rotation_rad = 0.5;  ///< same limit for the rotation
};

/// Every setting of the odometry.
struct OdometryOptions {
  InitializationOptions initialization;
  SelectionOptions selection;
  TrackingOptions tracking;
  TracingOptions tracing;
  WindowOptions window;
  MapOptions map;
  int max_pyramid_levels = 6;    ///< level 0 is the image itself
  int min_level_area_px = 1500;  ///< no coarser level than this
  LoopOptions loops;
  bool inertial_in_window = false;   ///< with an inertial unit: its readings are also residuals of the window, from
                                     ///< when on the keyframes so far show scale and vertical (tight coupling); else
                                     ///< they help where an image alone does not align
  bool estimate_line_delay = false;  ///< of a rolling shutter, beyond that of the calibration (line_delay_record.h). It
                                     ///< changes neither path nor map: track again with what was found
};

}  // namespace tileflight::keyframes
