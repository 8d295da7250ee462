#pragma once

// Odometry in metres and level while the images still come: an Odometry, whose latest keyframes are put together with
// an inertial unit's readings (slam/inertial/align_to_gravity.h) whenever there is a new one.

#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "tileflight/slam/inertial/align_to_gravity.h"
#include "tileflight/slam/odometry/odometry.h"

namespace tileflight::odometry {

/// Fewer points and no memory of the images before the map: each image takes a tenth of a second or less.
OdometryOptions live_odometry_options();

struct MetricOdometryOptions {
  OdometryOptions odometry = live_odometry_options();
  inertial::ImuModel imu;  ///< noise; T_imu_camera: camera axes are those of images
  inertial::InertialLimits limits;
  int keyframes = 40;              ///< the latest, from which scale and vertical are estimated
  double window_s = 60.0;          ///< they are not older than this
  double velocity_window_s = 0.4;  ///< of the images that tell the velocity
  // For the scale to count as known the first time:
  double max_scale_change = 0.03;             ///< between two estimates in a row
  double max_velocity_difference_m_s = 0.25;  ///< between the keyframes' and readings' and that of the latest images
  double gate_sigmas = 5.0;  ///< a step from image to image that is farther from the readings is theirs instead
  double least_gate_m = 0.05;
  int max_bridged_images = 10;  ///< in a row; then tracking counts as lost
};

enum class MetricStatus {
  kStarting,    ///< there is no map yet, or its scale is not known yet
  kMetric,      ///< the image has a pose in metres
  kNotAligned,  ///< the image has no pose; the next one may have
  kLost         ///< too many images in a row did not align: the next one begins a new map
};

/// State of the inertial unit at an image. The world's z axis points up; its origin is the unit's place, and its x axis
/// the heading of the unit's x axis, at the first estimate. After a loss the next map goes on from the last pose,
/// turned as the gyroscope says: how far the unit went meanwhile is not known, and not part of the covariance.
struct MetricEstimate {
  double time_s = 0.0;  ///< of the image
  geometry::SE3 T_world_imu;
  geometry::Vec3 velocity_m_s = geometry::Vec3::Zero();        ///< world axes
  geometry::Vec3 angular_rate_rad_s = geometry::Vec3::Zero();  ///< the unit's axes
  geometry::Mat3 position_covariance_m2 = geometry::Mat3::Zero();
  geometry::Mat3 rotation_covariance_rad2 = geometry::Mat3::Zero();  ///< about the world's axes
  geometry::Mat3 velocity_covariance_m2_s2 = geometry::Mat3::Zero();
  double metres_per_map_unit = 0.0;
  double sigma_log_scale = 0.0;
  double saturated_share = 0.0;  ///< of the keyframe's points: FrameQuality::saturated_share
};

struct MetricResult {
  MetricStatus status = MetricStatus::kStarting;
  std::optional<MetricEstimate> estimate;  ///< with kMetric
  std::string reason;                      ///< why there is none
};

/// Images and readings in, in order of time; the state of each image out, from when on the scale is known.
///
/// - Scale and vertical are those of the latest keyframes, estimated again at each new one. What changes by that turns
///   and scales the map about the unit's present place and heading: the path has no jumps. If the readings of late do
///   not show the scale (hovering), the last known scale is used, with the drift that the window states for it.
/// - A step from one image to the next that the readings contradict (an image that is aligned wrongly) is replaced by
///   theirs: they are far better than a tenth of a metre for a tenth of a second.
/// - The velocity is that of the keyframes and readings together, carried on by the readings, and corrected by that
///   with which the readings go best through the positions of the latest images (a Kalman filter of one variance).
/// - Covariances: of position and heading, what the odometry says of each step between keyframes, summed up; of the
///   position, the error of scale along the way and of heading across it, too; all inflated by factors that were found
///   from flights with truth.
///
/// One thread at a time may use an object. The same input gives the same result.
class MetricOdometry {
 public:
  /// Throws InputError if the calibration has no image size.
  MetricOdometry(const imaging::Calibration& calibration, MetricOdometryOptions options);

  /// Readings up to an image's time are to be added before it. One that is not later than the last one is ignored.
  void add_reading(const geometry::ImuSample& reading);
  /// Throws InputError as Odometry::add().
  MetricResult add(imaging::RgbImage image, double time_s);
  /// Returns how often tracking was lost and a new map begun.
  int restarts() const { return restarts_; }

 private:
  /// The map in the world, as last estimated.
  struct Placement {
    geometry::Sim3 T_world_map;
    double sigma_log_scale = 0.0, sigma_up_rad = 0.0;
    double wander_variance = 0.0;  ///< of the map's log scale, relative to its first keyframe, at that time
    geometry::Vec3 velocity_m_s = geometry::Vec3::Zero();  ///< of the unit at that time, world axes
    geometry::ImuBias bias;
  };
  /// Errors that add up on the way.
  struct Drift {
    geometry::Vec3 scale_m = geometry::Vec3::Zero();  ///< one sigma of the scale along the way: correlated
    double position_variance_m2 = 0.0;                ///< about each axis
    double heading_variance_rad2 = 0.0;
  };

  /// A velocity in world axes with its variance about each of them.
  struct Velocity {
    geometry::Vec3 value_m_s = geometry::Vec3::Zero();
    double variance_m2_s2 = 0.0;

    void update(const Velocity& measured);
  };
  /// State of the unit that the readings predict from the last estimate on.
  struct Prediction {
    geometry::SE3 T_world_imu;
    Velocity velocity;
    double sigma_m = 0.0;
  };

  MetricResult without_pose(const FrameResult& frame);
  MetricResult lose(const std::string& reason);
  /// Places the map in the world. Returns whether that was possible; else sets `reason`.
  bool place_map(const FrameResult& frame, std::string& reason);
  Placement placed(const inertial::InertialAlignment& found, const geometry::SE3& T_map_keyframe,
                   const FrameResult& frame) const;
  bool is_settled(const Placement& placement, const FrameResult& frame);
  /// Returns how far the level map has to be turned about the vertical.
  double heading_change_rad(const geometry::SE3& T_level_imu, double time_s) const;
  Prediction predict(double time_s) const;
  /// Returns whether the image's step was replaced by that of the readings.
  bool bridge(const FrameResult& frame, const Prediction& expected);
  geometry::SE3 T_world_imu(const Placement& placement, const geometry::SE3& T_map_camera) const;
  MetricEstimate estimate(const FrameResult& frame, const std::optional<Prediction>& expected, bool is_placed);
  void add_drift(const FrameQuality& quality, double sigma_log_scale, const geometry::SE3& T_world_imu);
  /// Fits the velocity to the positions of the latest images; nullopt: too few.
  std::optional<Velocity> fitted_velocity(const Placement& placement, const FrameQuality& quality) const;
  void forget_before(double time_s);

  imaging::Calibration calibration_;
  MetricOdometryOptions options_;
  Odometry odometry_;
  std::deque<geometry::ImuSample> readings_;
  std::deque<geometry::StampedPose> images_;  ///< T_map_camera, in the present map
  std::optional<Placement> placement_;        ///< of the present map
  std::optional<double> guessed_scale_;       ///< of the present map, until it counts as known
  std::optional<MetricEstimate> last_;        ///< the last one, also of a map before
  double velocity_variance_m2_s2_ = 0.0;      ///< of the last one, without the scale's
  double bridged_s_ = 0.0;                    ///< time of the last image whose step was replaced
  int bridged_images_ = 0;                    ///< in a row
  Drift drift_;
  bool begins_anew_ = false;
  int restarts_ = 0;
};

}  // namespace tileflight::odometry
