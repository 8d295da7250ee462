#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/base/progress.h"
#include "tileflight/geometry/point_cloud.h"
#include "tileflight/geometry/trajectory.h"
#include "tileflight/imaging/camera.h"
#include "tileflight/imaging/image.h"
#include "tileflight/imaging/photometric.h"
#include "tileflight/mapping/systematic_displacement.h"
#include "tileflight/photometry/options.h"
#include "tileflight/tracking/frame_quality.h"

namespace tileflight::odometry {

// Types of other rooms that appear in this interface.
using photometry::MapOptions;
using photometry::OdometryOptions;
using tracking::FrameQuality;

/// One input image of the odometry. It carries no ground truth.
struct InputFrame {
  std::int64_t index = 0;  ///< frame index in the dataset
  double time_s = 0.0;
  double exposure_ms = 0.0;  ///< 0: unknown
  imaging::RgbImage image;   ///< colour is used for map points only; tracking uses luma
};

/// Supplies the images in order; returns nullopt after the last one. Called from one thread.
using FrameSource = std::function<std::optional<InputFrame>()>;

/// Processor time of all threads by stage, seconds. Reading the images is not included.
struct StageTimes {
  double initialization = 0.0;  ///< everything up to the first map
  double preprocessing = 0.0;   ///< luma and pyramids, after initialization
  double tracking = 0.0;        ///< alignment to the keyframe
  double tracing = 0.0;         ///< depth search for immature points
  double keyframes = 0.0;       ///< selection, activation, window optimisation, marginalisation
  double loops = 0.0;           ///< keyframe features, loop detection and closure

  double total() const { return initialization + preprocessing + tracking + tracing + keyframes + loops; }
};

/// Prior knowledge besides the images; every part is optional.
struct Priors {
  imaging::GrayImage mask;     ///< same size as the images; pixels below 128 are ignored (vehicle body, mount); empty:
                               ///< no mask
  geometry::Trajectory poses;  ///< T_world_camera at the images' times: initialization takes its motion from them, and
                               ///< map and trajectory are given in their frame and scale
  std::function<std::optional<imaging::FloatImage>(std::int64_t index)>
      depth_m;  ///< depth image of frame `index`, metres along the optical axis, not finite or 0 where unknown; sets
                ///< the scale
};

/// A keyframe with its points, for a debug image.
struct KeyframeView {
  struct Point {
    float x = 0, y = 0;  ///< pixels
    float inverse_distance = 0;
  };
  std::int64_t index = 0;  ///< frame index
  const imaging::RgbImage& image;
  std::vector<Point> points;
};

/// Callback for each keyframe. Called from the odometry's thread.
using KeyframeObserver = std::function<void(const KeyframeView&)>;

/// Two keyframes recognized as showing the same place (options.loops).
struct LoopClosure {
  std::int64_t from_frame = 0;  ///< the earlier keyframe's InputFrame::index
  std::int64_t to_frame = 0;
  double scale_change = 1.0;  ///< length at `to_frame` over the same length at `from_frame`, before loop closure
  int inliers = 0;            ///< feature matches consistent with the loop
};

struct OdometryResult {
  geometry::Trajectory trajectory;  ///< T_map_camera of every tracked frame; without priors the scale is arbitrary
                                    ///< (monocular)
  geometry::Trajectory keyframes;
  geometry::PointCloud map;  ///< frame `map`; scalars: inverse_depth_variance, observations, first_frame, last_frame
  std::vector<std::int64_t> keyframe_frame_indices;  ///< InputFrame::index of each of `keyframes`
  std::vector<std::vector<int>>
      map_point_keyframes;                ///< for each point of `map`: indices into `keyframes` of its host (first) and
                                          ///< of the others with a good residual when it left the window
  std::optional<imaging::Camera> camera;  ///< the given camera with refined intrinsics, if estimated; none if
                                          ///< initialization failed
  std::int64_t frames = 0;                ///< read
  std::int64_t frames_tracked = 0;
  std::vector<FrameQuality> quality;  ///< of every image read, in order
  std::optional<mapping::SystematicDisplacement>
      systematic_displacement;       ///< from the residuals of all keyframes; none if there are too few
  std::vector<LoopClosure> loops;    ///< loops used to correct the poses and the map
  std::int64_t relocalizations = 0;  ///< how often tracking failed and was recovered on an older keyframe
  bool lost = false;                 ///< tracking ended before the last image, or never started
  std::string lost_reason;           ///< if lost: the frame and the reason
  double wall_time_s = 0.0;          ///< wall time of the run, image decoding included
  StageTimes cpu_time;
};

/// Direct Sparse Odometry: Engel, Koltun, Cremers, IEEE TPAMI 40(3), 2018. The result does not depend on the number of
/// threads. `aids`: prior knowledge. Throws InputError if an image, mask or depth differs in size from the calibration,
/// if the calibration has no image size, or if the prior poses do not overlap the images in time.
OdometryResult run_odometry(const imaging::Calibration& calibration, const imaging::PhotometricCalibration* photometric,
                            const FrameSource& next_frame, const OdometryOptions& options,
                            const Progress& progress = {}, const Priors& aids = {},
                            const KeyframeObserver& observer = {});

}  // namespace tileflight::odometry
