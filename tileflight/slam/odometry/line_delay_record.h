#pragma once

// Collects what the windows of a run say of the line delay (slam/mapping/line_delay.h). A window counts as it is before
// the next keyframe comes: then the motion at each of its keyframes is known from the images before and after it.

#include <functional>
#include <map>
#include <optional>
#include <vector>

#include "tileflight/slam/mapping/line_delay.h"
#include "tileflight/slam/mapping/mapper.h"
#include "tileflight/slam/odometry/odometry.h"
#include "tileflight/slam/odometry/tracking_log.h"
#include "tileflight/slam/odometry/tracking_state.h"

namespace tileflight::odometry {

/// Result of track_with_line_delay().
struct LineDelayPasses {
  OdometryResult result;                               ///< of the last one
  double line_delay_s = 0.0;                           ///< that it was tracked with
  std::optional<mapping::LineDelayEstimate> estimate;  ///< of the whole delay; nullopt: too few keyframes
  int passes = 0;
};

/// Finds the line delay of a rolling shutter whose row times are not known: tracks the images, estimates the line delay
/// from the residuals that are left, and tracks them again with it, until it stays. `track` tracks the images with
/// OdometryOptions::estimate_line_delay and a line delay in the order of play. An estimate that differs from `given_s`
/// by less than three standard deviations is not used: the shutter may be as given.
LineDelayPasses track_with_line_delay(double given_s, const std::function<OdometryResult(double line_delay_s)>& track);

class LineDelayRecord {
 public:
  /// Begins with the first map; `tracked` are its images, in order of time.
  void begin(const std::vector<TrackedFrame>& tracked, const mapping::Mapper& mapper);
  /// Takes up an image that was aligned, before it is made a keyframe.
  void follow(const LastFrame& image);
  /// Counts the window when the image that was aligned last becomes a keyframe; the window is still without it. `lens`:
  /// level 0.
  void add_window(const mapping::Mapper& mapper, const keyframes::Lens& lens);
  /// Tells that this keyframe is in the window now.
  void add_keyframe(int id);

  /// Estimates the line delay from all windows; nullopt: too few windows.
  std::optional<mapping::LineDelayEstimate> estimate(const mapping::Mapper& mapper) const;

 private:
  /// Mean motion between two images.
  struct Motion {
    geometry::Vec6 velocity = geometry::Vec6::Zero();  ///< left twist of T_camera_map a second
    double interval_s = 0.0;                           ///< 0: unknown
  };
  static Motion motion(const geometry::SE3& T_to_from, double interval_s);
  static std::optional<geometry::Vec6> velocity_between(const Motion& before, const Motion& after);

  std::map<int, geometry::Vec6> velocities_;  ///< by the keyframe's id
  Motion last_;                               ///< to the image aligned last
  Motion before_newest_;                      ///< to the newest keyframe
  std::optional<int> newest_;                 ///< id, until the image after it is aligned
  std::vector<mapping::LineDelaySystem> windows_;
};

}  // namespace tileflight::odometry
