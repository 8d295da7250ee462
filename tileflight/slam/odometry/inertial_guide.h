#pragma once

// An inertial unit beside tracking: where its readings see the camera at the next image, and its part in the window
// (slam/mapping/inertial_window.h), from when on the keyframes so far show scale and vertical.

#include <optional>

#include "tileflight/slam/inertial/imu_check.h"
#include "tileflight/slam/mapping/mapper.h"
#include "tileflight/slam/odometry/tracking_log.h"
#include "tileflight/slam/odometry/tracking_state.h"

namespace tileflight::odometry {

class InertialGuide {
 public:
  /// Throws InputError for readings that check_readings() refuses.
  /// `is_tight`: the window is to be coupled.
  InertialGuide(inertial::InertialInput readings, bool is_tight);

  /// T_camera_map of an image by the readings: from the newest keyframe on if the window is coupled; else the rotation
  /// since the last image, with the translation of constant velocity. nullopt where readings are missing.
  std::optional<geometry::SE3> predict(const TrackingState& state, const mapping::Mapper& mapper, double time_s) const;
  /// Preintegrates the readings between two images; nullopt if they are not whole. The bias is the newest keyframe's.
  std::optional<inertial::Preintegration> between(double from_s, double to_s, const mapping::Mapper& mapper) const;
  /// Couples the window to the unit if the keyframes so far show scale and vertical, uncouples it if the readings
  /// contradict, and begins the coupling anew if scale and vertical are known far better than before. Call it after a
  /// new keyframe.
  void update(const TrackingLog& log, mapping::Mapper& mapper);

  /// Returns the time of the image at which the window was first coupled; nullopt: not yet.
  std::optional<double> coupled_since_s() const { return coupled_since_s_; }

 private:
  bool is_due(std::size_t keyframes, bool is_coupled) const;
  inertial::InertialInput readings_of(double from_s, double to_s) const;
  void couple(const inertial::InertialAlignment& found, const geometry::SE3& T_map_keyframe, mapping::Mapper& mapper);

  inertial::InertialInput readings_;
  bool is_tight_ = false;
  inertial::ImuCheck check_;
  geometry::ImuBias bias_;        ///< of the latest smoothing
  double time_offset_s_ = 0.0;    ///< the unit's clock minus the camera's, of the latest smoothing
  geometry::SE3 T_imu_camera_;    ///< of the latest smoothing
  std::size_t tried_at_ = 0;      ///< keyframes at the latest smoothing
  double guessed_scale_ = 0.0;    ///< of the latest smoothing; 0: none
  double sigma_log_scale_ = 0.0;  ///< with which the coupling began
  std::optional<double> coupled_since_s_;
};

}  // namespace tileflight::odometry
