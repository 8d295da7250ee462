#pragma once

// Tracking from a map on: each image is aligned to the reference keyframe, some become keyframes; images that do not
// align are searched by features, then compared with all keyframes of the window. Images far apart are searched by
// features first (wide_search.h). The order of the images is that of their times or the opposite
// one: nothing here depends on its direction.

#include <memory>
#include <optional>

#include "tileflight/slam/mapping/mapper.h"
#include "tileflight/slam/odometry/inertial_guide.h"
#include "tileflight/slam/odometry/line_delay_record.h"
#include "tileflight/slam/odometry/odometry.h"
#include "tileflight/slam/odometry/preprocessor.h"
#include "tileflight/slam/odometry/tracking_log.h"
#include "tileflight/slam/odometry/tracking_state.h"
#include "tileflight/slam/odometry/wide_search.h"

namespace tileflight::odometry {

/// One step of tracking on what others own: the map that grows, and the log of what was tracked.
class FrameTracker {
 public:
  /// All must outlive the tracker. `observer` may be empty, `guide` null: there is no inertial unit; `line_delay` null:
  /// it is not estimated.
  FrameTracker(const OdometryOptions& options, Preprocessor& preprocessor, mapping::Mapper& mapper, TrackingLog& log,
               const KeyframeObserver& observer, InertialGuide* guide = nullptr, LineDelayRecord* line_delay = nullptr)
      : options_(options),
        preprocessor_(preprocessor),
        mapper_(mapper),
        log_(log),
        observer_(observer),
        guide_(guide),
        line_delay_(line_delay) {}

  /// Aligns the next image; records it, makes it a keyframe, or counts it as a failure.
  void track(TrackingState& state, const InputFrame& frame);
  /// Returns whether too many images in a row did not align.
  bool lost(const TrackingState& state) const { return state.failures.count > options_.tracking.max_failed_frames; }
  /// Shows the keyframe `slot` of the window to the observer and keeps its features for loop closure.
  void report_keyframe(const InputFrame& frame, int slot);

 private:
  keyframes::RollingShutter predict_rolling_shutter(const TrackingState& state, const InputFrame& frame) const;
  std::vector<geometry::SE3> hypotheses(const TrackingState& state, double time_s) const;
  tracking::ImageAlignment best_alignment(const TrackingState& state, const keyframes::Pyramid& pyramid, double time_s,
                                          const keyframes::RollingShutter& shutter) const;
  double accepted_rmse(const TrackingState& state) const;
  std::optional<tracking::ImageAlignment> search_wide(TrackingState& state, const keyframes::Pyramid& pyramid);
  std::optional<tracking::ImageAlignment> align_found(TrackingState& state, const ReferenceKeyframe& reference,
                                                      const keyframes::Pyramid& pyramid, WideSearch& search);
  std::optional<tracking::ImageAlignment> recover(TrackingState& state, const keyframes::Pyramid& pyramid);
  void fail(TrackingState& state, const InputFrame& frame, const tracking::ImageAlignment& alignment) const;
  void follow(TrackingState& state, const InputFrame& frame, std::shared_ptr<const keyframes::Pyramid> pyramid,
              const keyframes::RollingShutter& shutter, const tracking::ImageAlignment& alignment);
  bool needs_keyframe(const TrackingState& state, const tracking::ImageAlignment& alignment) const;
  void make_keyframe(TrackingState& state, const InputFrame& frame, std::shared_ptr<const keyframes::Pyramid> pyramid,
                     const keyframes::AffineBrightness& brightness, const tracking::ImageAlignment& alignment);

  const OdometryOptions& options_;
  Preprocessor& preprocessor_;
  mapping::Mapper& mapper_;
  TrackingLog& log_;
  const KeyframeObserver& observer_;
  InertialGuide* guide_;
  LineDelayRecord* line_delay_;
};

}  // namespace tileflight::odometry
