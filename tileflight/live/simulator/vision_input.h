#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <utility>
#include <variant>

#include "tileflight/live/autopilot/mavlink.h"
#include "tileflight/live/simulator/place_vision.h"
#include "tileflight/live/simulator/settings.h"
#include "tileflight/live/simulator/simulator_options.h"
#include "tileflight/slam/odometry/metric_odometry.h"

namespace tileflight::simulator {

/// Makes the model of a vehicle's inertial unit for an estimator: noise from its settings, read every `interval_s`,
/// with biases as known after a calibration at rest. `T_body_camera`: camera axes forward, right, down.
inertial::ImuModel imu_model(const ImuSettings& settings, double interval_s, const geometry::SE3& T_body_camera);

/// Converts an estimate to the message ODOMETRY. The pose is in a frame of its own, with x along the heading of the
/// first estimate and z down (MAV_FRAME_LOCAL_FRD), or for an estimate in the axes north, west and up in north, east,
/// down (MAV_FRAME_LOCAL_NED); velocity and rates are in body axes (MAV_FRAME_BODY_FRD).
/// `time_us`: time of the exposure. `sigma_rate_rad_s`: noise of the gyroscope. The quality is the share of the
/// keyframe's points that fit, in percent and at least 1.
autopilot::Odometry vision_message(const odometry::MetricEstimate& estimate, std::uint64_t time_us, int resets,
                                   double sigma_rate_rad_s, VisionSource source = VisionSource::kPictures);

/// Makes the vision input of a vehicle's autopilot from the images of one of its cameras and the readings of its
/// inertial unit: odometry, or localization in tiles of the place. It sees no ground truth but the pose at the start.
/// Times are those of the messages to the autopilot. For one thread at a time.
class VisionInput {
 public:
  /// Uses the vehicle's first inertial unit and the camera that the settings name, which must exist. `step_s`: step of
  /// the autopilot; exposure interval and latency are rounded to multiples of it. `tiles`: those that images are
  /// located in, for VisionSource::kPlace; else null.
  VisionInput(const VehicleSettings& vehicle, double step_s, std::shared_ptr<WorkingSet> tiles, SimulatorLog log);

  const std::string& camera() const { return settings_.camera; }
  /// Discards all state, for an autopilot that starts.
  void restart();
  void add_reading(const autopilot::HilSensor& reading);
  /// Returns whether an image is taken at this step.
  bool is_exposure(std::uint64_t step) const { return step % exposure_steps_ == 0; }
  /// Adds the picture of this step. `T_local_body`: the vehicle's true pose, of which only the first one is used, by
  /// VisionSource::kPlace: the autopilot knows where it starts.
  void add_picture(imaging::RgbImage picture, std::uint64_t step, std::uint64_t time_us,
                   const geometry::SE3& T_local_body);
  /// Tells whether it locates images in tiles of the place.
  bool locates() const { return tiles_ != nullptr; }
  /// Returns the estimate of the latest picture; nullopt: it has none.
  const std::optional<odometry::MetricEstimate>& latest() const { return latest_; }
  /// Converts the world of the estimates to the local frame. locates() only.
  geometry::SE3 T_local_world() const { return std::get<PlaceVision>(estimator_).T_local_world(); }
  /// Returns the message whose latency is over at this step.
  std::optional<autopilot::Odometry> message_at(std::uint64_t step);

 private:
  using Estimator = std::variant<odometry::MetricOdometry, PlaceVision>;
  Estimator make_estimator() const;
  void tell(const odometry::MetricResult& result, double time_s);

  VisionSettings settings_;
  std::string vehicle_;
  SimulatorLog log_;
  imaging::Calibration calibration_;
  inertial::ImuModel imu_;
  double sigma_rate_rad_s_ = 0.0;
  std::uint64_t exposure_steps_ = 1, latency_steps_ = 1;
  std::shared_ptr<WorkingSet> tiles_;
  Estimator estimator_;
  std::deque<std::pair<std::uint64_t, autopilot::Odometry>> waiting_;  ///< until their step
  std::optional<odometry::MetricEstimate> latest_;
  std::optional<std::uint64_t> first_us_;  ///< of the pictures
  bool was_known_ = false;                 ///< the pose, in the latest images
  bool told_lost_ = false;                 ///< since the pose was known last
};

}  // namespace tileflight::simulator
