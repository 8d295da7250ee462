#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/geometry/point_cloud.h"
#include "tileflight/geometry/progress.h"
#include "tileflight/geometry/trajectory.h"
#include "tileflight/imaging/camera.h"
#include "tileflight/imaging/image.h"
#include "tileflight/imaging/photometric.h"
#include "tileflight/odometry/frame_quality.h"
#include "tileflight/odometry/residual_pattern.h"

namespace tileflight::odometry {

struct OdometryOptions;  // options.h

/// A picture as odometry gets it. Truth has no way in here.
struct InputFrame {
  std::int64_t index = 0;  ///< of the dataset
  double time_s = 0.0;
  double exposure_ms = 0.0;  ///< 0: unknown
  imaging::RgbImage image;   ///< colour is only for the map's points; tracking works on luma
};

/// Where pictures come from, in order; nullopt after the last. Called from one thread.
using FrameSource = std::function<std::optional<InputFrame>()>;

/// Processor time of all threads by stage, seconds; reading the pictures is not among it.
struct StageSeconds {
  double start = 0.0;      ///< everything until the first map
  double pictures = 0.0;   ///< luma and pyramids, after the start
  double tracking = 0.0;   ///< alignment to the keyframe
  double tracing = 0.0;    ///< following immature points
  double keyframes = 0.0;  ///< selection, activation, window optimisation, marginalisation
  double loops = 0.0;      ///< corners of keyframes, finding and closing loops

  double total() const { return start + pictures + tracking + tracing + keyframes + loops; }
};

/// What is known beside the pictures; all of it optional.
struct Aids {
  imaging::GrayImage mask;     ///< of the pictures' size; below 128: never look here (own body, mount); empty: none
  geometry::Trajectory poses;  ///< T_world_camera with the pictures' times: the start takes its motion from them, and
                               ///< map and trajectory are then in their frame and scale
  std::function<std::optional<imaging::FloatImage>(std::int64_t index)>
      depth_m;  ///< of a picture, metres along the optical axis, not finite or 0 where unknown: gives the scale
};

/// A keyframe with what is known of its points, for a debug picture.
struct KeyframeView {
  struct Point {
    float x = 0, y = 0;  ///< pixels
    float inverse_distance = 0;
  };
  std::int64_t index = 0;  ///< of the frame
  const imaging::RgbImage& image;
  std::vector<Point> points;
};

/// Who wants to look on. Called from the odometry's thread.
using KeyframeObserver = std::function<void(const KeyframeView&)>;

/// Two keyframes that were found to see the same place (options.loops).
struct LoopFound {
  std::int64_t from_frame = 0;  ///< the earlier keyframe's InputFrame::index
  std::int64_t to_frame = 0;
  double scale_change = 1.0;  ///< length there over the same length here, before the loop was closed
  int inliers = 0;            ///< corners that agree
};

struct OdometryResult {
  geometry::Trajectory trajectory;  ///< T_map_camera of every tracked frame; scale arbitrary (monocular) without aids
  geometry::Trajectory keyframes;
  geometry::PointCloud map;  ///< frame `map`; scalars: inverse_depth_variance, observations, first_frame, last_frame
  std::vector<std::int64_t> keyframe_frames;  ///< InputFrame::index of each of `keyframes`
  std::vector<std::vector<int>>
      map_keyframes;                      ///< of each point of `map`: positions in `keyframes` of its host (first)
                                          ///< and of others in which it was seen well when it left the window
  std::optional<imaging::Camera> camera;  ///< the given one, or what was estimated of it; none where nothing started
  std::int64_t frames = 0;                ///< read
  std::int64_t frames_tracked = 0;
  std::vector<FrameQuality> quality;          ///< of every picture read, in their order
  std::optional<CommonDisplacement> pattern;  ///< of all keyframes' residuals; none where they are too few to tell
  std::vector<LoopFound> loops;               ///< that the poses and the map were corrected by
  std::int64_t recoveries = 0;                ///< times that tracking failed and was found again on an older keyframe
  bool lost = false;                          ///< tracking ended before the pictures did, or never began
  std::string lost_reason;                    ///< at which frame and why, when lost
  double seconds = 0.0;                       ///< wall time of the run, image decoding included
  StageSeconds processor_time;
};

/// Direct Sparse Odometry: Engel, Koltun, Cremers, IEEE TPAMI 40(3), 2018. The result is the same for any number of
/// threads. Throws InputError for a picture, mask or depth of another size than the calibration's, for a calibration
/// without a picture, and for known poses that share no time with the pictures.
OdometryResult run_odometry(const imaging::Calibration& calibration, const imaging::PhotometricCalibration* photometric,
                            const FrameSource& next_frame, const OdometryOptions& options,
                            const Progress& progress = {}, const Aids& aids = {},
                            const KeyframeObserver& observer = {});

}  // namespace tileflight::odometry
