#pragma once

#include <memory>
#include <optional>

#include "tileflight/core/geometry/imu_sample.h"
#include "tileflight/evaluation/localization/localizer.h"
#include "tileflight/live/simulator/working_set.h"
#include "tileflight/slam/odometry/metric_odometry.h"

namespace tileflight::simulator {

/// Locates a vehicle by the images of its camera in tiles of the place (localization/localizer.h), and by its inertial
/// unit between them. Only the tiles that the camera can see are in memory. One thread at a time may use an object.
class PlaceVision {
 public:
  /// `imu`: as the autopilot's own; T_imu_camera has the camera axes of images.
  PlaceVision(std::shared_ptr<WorkingSet> tiles, const imaging::Camera& camera, const inertial::ImuModel& imu);

  /// Tells where the vehicle stands before its first image: the pose of the body (forward, right, down), local frame.
  void start(const geometry::SE3& T_local_body);
  bool is_started() const { return is_started_; }

  /// Readings up to an image's time are to be added before it.
  void add_reading(const geometry::ImuSample& reading);
  /// Locates an image, after start(). The estimate is in a world at the start of the vehicle with axes north, west and
  /// up; its saturated_share is one minus the correlation of image and place. Throws InputError for an image of another
  /// size.
  odometry::MetricResult add(const imaging::RgbImage& image, double time_s);
  /// Converts the world of the estimates to the local frame.
  const geometry::SE3& T_local_world() const { return T_local_world_; }
  /// Returns how often the vehicle was lost and found again.
  int restarts() const { return losses_; }

 private:
  odometry::MetricEstimate estimate(const localization::LivePose& pose, double time_s) const;
  /// Takes the tiles that the camera sees around where it was last.
  void follow();

  std::shared_ptr<WorkingSet> tiles_;
  imaging::Camera camera_;
  inertial::ImuModel imu_;
  geometry::SE3 T_local_world_;
  geometry::SE3 T_local_body_start_;
  std::shared_ptr<const ResidentScene> scene_;
  std::unique_ptr<localization::Localizer> localizer_;
  geometry::Vec3 position_ = geometry::Vec3::Zero();  ///< of the camera, last known, local frame
  geometry::Vec3 rate_rad_s_ = geometry::Vec3::Zero();
  bool is_started_ = false, was_located_ = false, is_lost_ = false;
  int losses_ = 0;
};

}  // namespace tileflight::simulator
