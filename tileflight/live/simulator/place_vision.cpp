#include "tileflight/live/simulator/place_vision.h"

#include <algorithm>
#include <array>
#include <utility>

#include "tileflight/tiles/tileset/view_criteria.h"

namespace tileflight::simulator {
namespace {

using geometry::Mat3;
using geometry::SE3;
using geometry::Vec3;

localization::LiveOptions live_options(const inertial::ImuModel& imu) {
  localization::LiveOptions options;
  options.imu = imu;
  options.starts_at_rest = true;
  return options;
}

/// Converts north, west and up at a position to the local frame (east, north, up).
SE3 T_local_north_west_up(const Vec3& origin_local) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(0.5 * M_PI, Vec3::UnitZ())), origin_local};
}

}  // namespace

PlaceVision::PlaceVision(std::shared_ptr<WorkingSet> tiles, const imaging::Camera& camera,
                         const inertial::ImuModel& imu)
    : tiles_(std::move(tiles)), camera_(camera), imu_(imu) {}

void PlaceVision::start(const SE3& T_local_body) {
  T_local_body_start_ = T_local_body;
  T_local_world_ = T_local_north_west_up(T_local_body.translation);
  position_ = (T_local_body * imu_.T_imu_camera).translation;
  is_started_ = true;
}

void PlaceVision::add_reading(const geometry::ImuSample& reading) {
  rate_rad_s_ = reading.angular_rate_rad_s;
  if (localizer_) localizer_->add_reading(reading);
}

void PlaceVision::follow() {
  const double width = std::min(camera_.width(), localization::LiveOptions{}.pictures.width);
  const std::array<SensorViewpoint, 1> viewpoints{
      SensorViewpoint{position_, tileset::view_cone_of(camera_).pixels_per_rad * width / camera_.width()}};
  const std::shared_ptr<const ResidentScene> scene = tiles_->load_for(viewpoints);
  if (localizer_ && scene == scene_) return;
  if (localizer_)
    localizer_->use(scene->scene(), scene->appearance());
  else
    localizer_ =
        std::make_unique<localization::Localizer>(scene->scene(), scene->appearance(), camera_, live_options(imu_));
  scene_ = scene;
}

odometry::MetricResult PlaceVision::add(const imaging::RgbImage& image, double time_s) {
  const bool is_first = localizer_ == nullptr;
  follow();
  if (is_first) {
    constexpr double kSigma_m = 0.3, kSigma_rad = 0.03;
    localizer_->start(T_local_body_start_ * imu_.T_imu_camera, time_s, kSigma_m, kSigma_rad);
  }
  const localization::LivePose pose = localizer_->add(image, time_s);
  position_ = pose.T_local_camera.translation;
  if (pose.located) {
    if (is_lost_) ++losses_;
    was_located_ = true;
    is_lost_ = false;
    return {odometry::MetricStatus::kMetric, estimate(pose, time_s), {}};
  }
  is_lost_ = is_lost_ || pose.lost;
  if (is_lost_)
    return {odometry::MetricStatus::kLost, {}, "the images do not match the tiles where the vehicle is expected"};
  return {was_located_ ? odometry::MetricStatus::kNotAligned : odometry::MetricStatus::kStarting, {}, {}};
}

odometry::MetricEstimate PlaceVision::estimate(const localization::LivePose& pose, double time_s) const {
  const SE3 T_camera_imu = imu_.T_imu_camera.inverse();
  const SE3 T_world_local = T_local_world_.inverse();
  const Mat3 R_world_local = T_world_local.rotation.toRotationMatrix();
  const Mat3 R_world_camera = R_world_local * pose.T_local_camera.rotation.toRotationMatrix();
  const Vec3 arm_local = pose.T_local_camera.rotation * T_camera_imu.translation;
  odometry::MetricEstimate estimate;
  estimate.time_s = time_s;
  estimate.T_world_imu = T_world_local * pose.T_local_camera * T_camera_imu;
  estimate.angular_rate_rad_s = rate_rad_s_;
  const Vec3 rate_local = (pose.T_local_camera * T_camera_imu).rotation * rate_rad_s_;
  estimate.velocity_m_s = R_world_local * (pose.velocity_m_s + rate_local.cross(arm_local));
  estimate.position_covariance_m2 = R_world_camera * pose.covariance.topLeftCorner<3, 3>() * R_world_camera.transpose();
  estimate.rotation_covariance_rad2 =
      R_world_camera * pose.covariance.bottomRightCorner<3, 3>() * R_world_camera.transpose();
  estimate.velocity_covariance_m2_s2 = pose.sigma_velocity_m_s * pose.sigma_velocity_m_s * Mat3::Identity();
  estimate.metres_per_map_unit = 1.0;
  estimate.saturated_share = 1.0 - pose.correlation;
  return estimate;
}

}  // namespace tileflight::simulator
