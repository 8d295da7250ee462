#pragma once

// Odometry in metres and level while the images still come: an Odometry, whose latest keyframes are put together with
// an inertial unit's readings (inertial/align_to_gravity.h) whenever there is a new one.

#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "tileflight/inertial/align_to_gravity.h"
#include "tileflight/odometry/odometry.h"

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
};

enum class MetricStatus {
  kStarting,    ///< there is no map yet, or its scale is not known yet
  kMetric,      ///< the image has a pose in metres
  kNotAligned,  ///< the image has no pose; the next one may have
  kLost         ///< too many images in a row did not align: the next one begins a new map
};

/// State of the inertial unit at an image. The world's z axis points up; its origin is the unit's place, and its x axis
/// the heading of the unit's x axis, at the first estimate. After a loss the next map goes on from the last pose, turned
/// as the gyroscope says: how far the unit went meanwhile is not known, and not part of the covariance.
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
///   not show the scale (hovering), the last one that was known goes on, with what the window says that it may wander.
/// - The velocity is that with which the readings go best through the positions of the latest images.
/// - Covariances: of position and heading, what the odometry says of each step between keyframes, summed up; of the
///   position, the error of scale along the way and of heading across it, too.
///
/// For one thread at a time. The same input gives the same result.
class MetricOdometry {
 public:
  /// Throws InputError if the calibration has no image size.
  MetricOdometry(const imaging::Calibration& calibration, MetricOdometryOptions options);

  /// Readings up to an image's time are to be added before it. One that is not later than the last one is ignored.
  void add_reading(const inertial::ImuSample& reading);
  /// Throws InputError as Odometry::add().
  MetricResult add(imaging::RgbImage image, double time_s);
  /// How often tracking was lost and a new map begun.
  int restarts() const { return restarts_; }

 private:
  /// The map in the world, as last estimated.
  struct Placement {
    geometry::Sim3 T_world_map;
    double sigma_log_scale = 0.0, sigma_up_rad = 0.0;
    double wander_variance = 0.0;  ///< of the map's log scale, relative to its first keyframe, at that time
    inertial::ImuBias bias;
  };
  /// What adds up on the way.
  struct Drift {
    geometry::Vec3 scale_m = geometry::Vec3::Zero();  ///< one sigma of the scale along the way: correlated
    double position_variance_m2 = 0.0;                ///< about each axis
    double heading_variance_rad2 = 0.0;
  };

  MetricResult without_pose(const FrameResult& frame);
  void place_map(const FrameResult& frame, std::string& reason);
  /// How far the level map has to be turned about the vertical.
  double heading_change_rad(const geometry::SE3& T_level_imu, double time_s) const;
  Eigen::Quaterniond predicted_rotation(double time_s) const;
  geometry::SE3 T_world_imu(const geometry::SE3& T_map_camera) const;
  MetricEstimate estimate(const FrameResult& frame);
  void add_drift(const FrameQuality& quality, double sigma_log_scale, const geometry::SE3& T_world_imu);
  void set_velocity(double sigma_position_m, MetricEstimate& now) const;
  void forget_before(double time_s);

  imaging::Calibration calibration_;
  MetricOdometryOptions options_;
  Odometry odometry_;
  std::deque<inertial::ImuSample> readings_;
  std::deque<geometry::StampedPose> images_;  ///< T_map_camera, in the present map
  std::optional<Placement> placement_;        ///< of the present map
  std::optional<MetricEstimate> last_;        ///< the last one, also of a map before
  Drift drift_;
  bool begins_anew_ = false;
  int restarts_ = 0;
};

}  // namespace tileflight::odometry
