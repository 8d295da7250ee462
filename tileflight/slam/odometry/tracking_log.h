#pragma once

// Record of an odometry's images, and the results that follow from it together with the map.

#include <cstdint>
#include <vector>

#include "tileflight/slam/loop_closure/loop_correction.h"
#include "tileflight/slam/mapping/mapper.h"
#include "tileflight/slam/odometry/focal_change.h"
#include "tileflight/slam/odometry/odometry.h"
#include "tileflight/slam/tracking/tracker.h"

namespace tileflight::odometry {

/// An image with its pose relative to the keyframe it was tracked to.
struct TrackedFrame {
  std::int64_t index = 0;
  double time_s = 0.0;
  int keyframe = 0;  ///< id
  geometry::SE3 T_camera_keyframe;
  tracking::ImageAlignment alignment;  ///< to `keyframe`; for a keyframe, to the one it was tracked to
};

/// Keyframes before the first one, made backwards in time (backward_tracking.h), with their points. Their ids are
/// negative: -1 is the nearest to the first keyframe, whose id is 0.
struct EarlierMap {
  std::int64_t frames_tracked = 0;                 ///< images before the first keyframe that have a pose
  std::vector<mapping::KeyframeRecord> keyframes;  ///< in order of time; T_map_camera: with the first keyframe as map
  std::vector<mapping::StepUncertainty> steps;     ///< of each, relative to the keyframe after it
  std::vector<mapping::MapPoint> points;           ///< hosted by them
};

/// An image that was read.
struct FrameStamp {
  std::int64_t index = 0;
  double time_s = 0.0;
};

/// Images of another camera of the rig.
struct OtherImageCount {
  std::int64_t frames = 0;
  std::int64_t blind = 0;       ///< of those: they show nothing
  std::int64_t last = -1;       ///< index of the last frame with one
  std::int64_t since_last = 0;  ///< frames after it
  int checks = 0;               ///< comparisons with the rig's calibration
  std::vector<RigFit> fits;     ///< their results, where there are any
};

/// Grows with each image; nothing in it is changed later. Poses are relative to keyframes, so that they follow them.
struct TrackingLog {
  std::vector<FrameStamp> read;       ///< every image, in order
  std::vector<TrackedFrame> tracked;  ///< those with a pose, in order of time
  EarlierMap earlier;                 ///< set once, with the first map
  FocalChangeRecord focal_changes;    ///< from the first map on
  std::int64_t relocalizations = 0;
  std::vector<loop_closure::LoopKeyframe>
      loop_keyframes;                         ///< all keyframes in order of id; filled for loop closure only
  std::vector<OtherImageCount> other_images;  ///< by OdometryInput::other_cameras
  StageTimes cpu_time;
};

/// Number of images read before a time.
std::int64_t frames_before(double time_s, const TrackingLog& log);

/// Quality of every image read, in order.
std::vector<FrameQuality> frame_qualities(const TrackingLog& log, const mapping::Mapper& mapper);
/// Quality of the last image with a pose; equal to its entry in frame_qualities() at this moment.
FrameQuality last_frame_quality(const TrackingLog& log, const mapping::Mapper& mapper);

/// T_map_camera of every image with a pose, and of the keyframes, without loop closure.
geometry::Trajectory trajectory_so_far(const TrackingLog& log, const mapping::Mapper& mapper);
geometry::Trajectory keyframes_so_far(const TrackingLog& log, const mapping::Mapper& mapper);
/// The latest keyframes, at most `count`, in order of time.
std::vector<inertial::VisualKeyframe> latest_keyframes_so_far(const TrackingLog& log, const mapping::Mapper& mapper,
                                                              std::size_t count);
/// The points that pass the options' filters, without loop closure.
geometry::PointCloud map_so_far(const TrackingLog& log, const mapping::Mapper& mapper, const MapOptions& options);

/// Sets trajectory, keyframes, map and loops of `result`, after loop closure if the options ask for it (its processor
/// time is added to the result's); with an inertial unit's readings also `inertial`, by which path, map and qualities
/// are made metric and level, if it is. `lens`: of the full image and its levels.
void set_path_and_map(const TrackingLog& log, const mapping::Mapper& mapper, const keyframes::LensPyramid& lens,
                      const OdometryOptions& options, const std::optional<inertial::InertialInput>& readings,
                      OdometryResult& result);

}  // namespace tileflight::odometry
