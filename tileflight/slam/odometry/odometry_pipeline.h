#pragma once

// The odometry's state machine, fed one image at a time:
//
//   initializing ──first map──→ tracking ⇄ recovering ──too many failures──→ lost
//
// Before the first map, images are collected until their parallax gives one; those before its first keyframe are then
// tracked backwards (backward_tracking.h). After it each image is aligned to the reference keyframe, and some become
// keyframes (frame_tracker.h). Images that do not align are compared with all keyframes of the window until one does,
// or until there are too many of them. A lost odometry stays lost; its map remains.

#include <optional>
#include <string>
#include <variant>

#include "tileflight/slam/mapping/mapper.h"
#include "tileflight/slam/odometry/frame_tracker.h"
#include "tileflight/slam/odometry/initial_map.h"
#include "tileflight/slam/odometry/odometry.h"
#include "tileflight/slam/odometry/preprocessor.h"
#include "tileflight/slam/odometry/tracking_log.h"
#include "tileflight/slam/odometry/tracking_state.h"

namespace tileflight::odometry {

class OdometryPipeline {
 public:
  OdometryPipeline(OdometryInput input, const OdometryOptions& options);
  OdometryPipeline(const OdometryPipeline&) = delete;  // the stages refer to options and lens
  OdometryPipeline& operator=(const OdometryPipeline&) = delete;

  /// See Odometry::add().
  FrameResult add(InputFrame frame, const std::optional<geometry::SE3>& T_world_camera);
  bool lost() const;
  std::int64_t frames() const { return static_cast<std::int64_t>(log_.read.size()); }
  /// Short status text for progress reports.
  std::string progress_text() const;

  geometry::Trajectory trajectory() const { return trajectory_so_far(log_, mapper_); }
  geometry::Trajectory keyframes() const { return keyframes_so_far(log_, mapper_); }
  std::vector<inertial::VisualKeyframe> latest_keyframes(std::size_t count) const {
    return latest_keyframes_so_far(log_, mapper_, count);
  }
  geometry::PointCloud map() const { return map_so_far(log_, mapper_, options_.map); }
  /// See Odometry::T_world_map().
  std::optional<geometry::Sim3> T_world_map() const;
  /// The result so far, in the frame and scale of the priors.
  OdometryResult result() const;

 private:
  /// Counts the frame's images by the rig's other cameras, and compares the first ones with the rig's calibration.
  void inspect_other_images(const InputFrame& frame);
  void check_other_image(const InputFrame& frame, std::size_t camera);
  void require_usable(const InputFrame& frame, const std::optional<geometry::SE3>& T_world_camera) const;
  FrameResult frame_result(const FrameStamp& frame) const;
  std::optional<geometry::SE3> prior_pose(const InputFrame& frame) const;
  OdometryResult result_in_map_frame() const;

  // initializing
  void initialize(InitializationState& state, InputFrame frame);
  /// The map of the frame just added, by static stereo, or else of all frames, by their motion; nullopt: none yet.
  std::optional<InitialMap> find_initial_map(InitializationState& state);
  StereoResult stereo_result() const;

  FrameTracker tracker() {
    return {options_,
            preprocessor_,
            mapper_,
            log_,
            input_.keyframe_observer,
            guide_ ? &*guide_ : nullptr,
            line_delay_ ? &*line_delay_ : nullptr};
  }

  OdometryOptions options_;
  OdometryInput input_;        ///< without what the preprocessor has taken over
  bool priors_given_at_once_;  ///< OdometryInput::poses was given to the constructor, so images bring none
  Preprocessor preprocessor_;
  mapping::Mapper mapper_;
  std::variant<InitializationState, TrackingState> state_;
  TrackingLog log_;
  std::optional<InertialGuide> guide_;         ///< with OdometryInput::inertial
  std::optional<LineDelayRecord> line_delay_;  ///< with OdometryOptions::estimate_line_delay
};

}  // namespace tileflight::odometry
