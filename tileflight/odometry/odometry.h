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

struct OdometryResult {
  geometry::Trajectory trajectory;  ///< T_map_camera of every tracked frame; scale arbitrary (monocular)
  geometry::Trajectory keyframes;
  geometry::PointCloud map;  ///< frame `map`; scalars: inverse_depth_variance, observations, first_frame, last_frame
  std::int64_t frames = 0;   ///< read
  std::int64_t frames_tracked = 0;
  bool lost = false;        ///< tracking ended before the pictures did, or never began
  std::string lost_reason;  ///< at which frame and why, when lost
  double seconds = 0.0;     ///< wall time of the run, image decoding included
};

/// Direct Sparse Odometry: Engel, Koltun, Cremers, IEEE TPAMI 40(3), 2018.
OdometryResult run_odometry(const imaging::Calibration& calibration, const imaging::PhotometricCalibration* photometric,
                            const FrameSource& next_frame, const OdometryOptions& options,
                            const Progress& progress = {});

}  // namespace tileflight::odometry
