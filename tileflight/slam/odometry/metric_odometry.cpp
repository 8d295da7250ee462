#include "tileflight/slam/odometry/metric_odometry.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "tileflight/core/base/input_error.h"

namespace tileflight::odometry {
namespace {

using geometry::Mat3;
using geometry::SE3;
using geometry::Sim3;
using geometry::Vec3;

Eigen::Quaterniond about_up(double angle_rad) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle_rad, Vec3::UnitZ()));
}

/// Angle about z that, put before `from`, brings it nearest to `to`: it maximises the trace of R_z(angle) from to^T.
double turn_about_up_rad(const Eigen::Quaterniond& from, const Eigen::Quaterniond& to) {
  const Mat3 between = (to * from.conjugate()).toRotationMatrix();
  return std::atan2(between(1, 0) - between(0, 1), between(0, 0) + between(1, 1));
}

// Chosen by hand, from flights over the stadium against their truth: what alignment and window state is too small for
// pictures as small and motions as lively as these.
constexpr double kScaleInflation = 5.0, kStepInflation = 5.0, kTiltInflation = 2.0;
constexpr double kAlignedVelocity_m_s = 0.03;  ///< standard deviation about each axis of the alignment's velocity
constexpr double kCorrelatedErrors = 4.0;      ///< images of a keyframe share its errors
constexpr int kFewestForVelocity = 3;

/// Place of a body before now if it stands still now: the sum of its changes of velocity.
struct BackwardMotion {
  double time_s = 0.0;  ///< after now, so negative
  Vec3 displacement_m = Vec3::Zero();
};

/// Integrates attitude and displacement back to `from_s` by the trapezoidal rule, with the latest reading first. `R`:
/// attitude at `now_s`.
std::vector<BackwardMotion> motion_before(const std::deque<geometry::ImuSample>& readings, Eigen::Quaterniond R,
                                          double now_s, const geometry::ImuBias& bias, double gravity_m_s2,
                                          double from_s) {
  std::vector<BackwardMotion> motions{{0.0, Vec3::Zero()}};
  Vec3 velocity = Vec3::Zero(), displacement = Vec3::Zero();
  double at_s = now_s;
  const auto acceleration = [&](const geometry::ImuSample& one) {
    return Vec3(R * (one.specific_force_m_s2 - bias.accelerometer_m_s2) - Vec3(0, 0, gravity_m_s2));
  };
  std::optional<Vec3> after;
  for (auto one = readings.rbegin(); one != readings.rend() && at_s > from_s; ++one) {
    if (one->time_s > now_s) continue;
    const double dt = at_s - one->time_s;
    R = R * geometry::so3_exp(-dt * (one->angular_rate_rad_s - bias.gyroscope_rad_s));
    const Vec3 here = acceleration(*one);
    const Vec3 mean = 0.5 * (here + after.value_or(here));
    displacement += -dt * velocity + 0.5 * dt * dt * mean;
    velocity -= dt * mean;
    at_s = one->time_s;
    after = here;
    motions.push_back({at_s - now_s, displacement});
  }
  return motions;
}

/// Linear between the entries; the last one beyond them.
Vec3 displacement_at(const std::vector<BackwardMotion>& motions, double time_s) {
  const auto later = [](const BackwardMotion& one, double t) { return one.time_s > t; };
  const auto at = std::lower_bound(motions.begin(), motions.end(), time_s, later);
  if (at == motions.end()) return motions.back().displacement_m;
  if (at == motions.begin()) return at->displacement_m;
  const auto before = std::prev(at);
  const double share = (before->time_s - time_s) / (before->time_s - at->time_s);
  return (1.0 - share) * before->displacement_m + share * at->displacement_m;
}

/// Holds the intrinsics, as Odometry does when it is given the readings.
MetricOdometryOptions with_held_intrinsics(MetricOdometryOptions options) {
  options.odometry.window.refine_intrinsics = false;
  return options;
}

}  // namespace

OdometryOptions live_odometry_options() {
  OdometryOptions options;
  options.selection.points_per_keyframe = 800;
  options.window.active_points = 1000;
  options.initialization.corners = 500;
  options.initialization.buffer_mb = 0.0;
  options.tracking.max_failed_frames = 15;
  options.map.dense = false;
  return options;
}

MetricOdometry::MetricOdometry(const imaging::Calibration& calibration, MetricOdometryOptions options)
    : calibration_(calibration),
      options_(with_held_intrinsics(std::move(options))),
      odometry_(calibration_, options_.odometry) {}

void MetricOdometry::add_reading(const geometry::ImuSample& reading) {
  if (!readings_.empty() && !(reading.time_s > readings_.back().time_s)) return;
  readings_.push_back(reading);
}

MetricResult MetricOdometry::add(imaging::RgbImage image, double time_s) {
  if (begins_anew_) {
    odometry_ = Odometry(calibration_, options_.odometry);
    images_.clear();
    placement_.reset();
    guessed_scale_.reset();
    bridged_images_ = 0;
    begins_anew_ = false;
  }
  const FrameResult frame = odometry_.add(std::move(image), time_s);
  forget_before(time_s - options_.window_s);
  if (!frame.T_map_camera) return without_pose(frame);
  images_.push_back({time_s, *frame.T_map_camera});
  std::optional<Prediction> expected;
  if (placement_ && last_) {
    expected = predict(time_s);
    bridged_images_ = bridge(frame, *expected) ? bridged_images_ + 1 : 0;
    if (bridged_images_ > options_.max_bridged_images) return lose("the images contradict the inertial unit");
  }
  std::string reason = "the map's scale is not known yet";
  const bool is_placed = (frame.quality.is_keyframe || images_.size() == 1) && place_map(frame, reason);
  if (!placement_) return {MetricStatus::kStarting, {}, reason};
  last_ = estimate(frame, expected, is_placed);
  return {MetricStatus::kMetric, last_, {}};
}

MetricResult MetricOdometry::without_pose(const FrameResult& frame) {
  const std::string reason = frame.reason.empty() ? "there is no map yet" : frame.reason;
  if (frame.status == FrameStatus::kInitializing) return {MetricStatus::kStarting, {}, reason};
  return frame.status == FrameStatus::kLost ? lose(reason) : MetricResult{MetricStatus::kNotAligned, {}, reason};
}

MetricResult MetricOdometry::lose(const std::string& reason) {
  begins_anew_ = true;
  ++restarts_;
  return {MetricStatus::kLost, {}, reason};
}

/// Drops readings and images that are too old for the estimate of scale and vertical.
void MetricOdometry::forget_before(double time_s) {
  while (!readings_.empty() && readings_.front().time_s < time_s) readings_.pop_front();
  while (!images_.empty() && images_.front().time_s < time_s) images_.pop_front();
}

bool MetricOdometry::place_map(const FrameResult& frame, std::string& reason) {
  std::vector<inertial::VisualKeyframe> keyframes =
      odometry_.latest_keyframes(static_cast<std::size_t>(options_.keyframes));
  std::erase_if(keyframes, [&](const inertial::VisualKeyframe& one) {
    return readings_.empty() || one.time_s < readings_.front().time_s;
  });
  inertial::InertialAlignment found;
  try {
    const geometry::Trajectory images{{images_.begin(), images_.end()}};
    const inertial::InertialInput input{{readings_.begin(), readings_.end()}, options_.imu, "inertial unit"};
    found = inertial::align_to_gravity(keyframes, images, input, options_.limits);
  } catch (const InputError& error) {
    found.reason = error.what();
  }
  if (!found.metric) {
    reason = found.reason;
    return false;
  }
  const Placement placement = placed(found, keyframes.back().T_map_camera, frame);
  if (!placement_ && !is_settled(placement, frame)) {
    reason = "the map's scale has not settled yet";
    return false;
  }
  placement_ = placement;
  return true;
}

MetricOdometry::Placement MetricOdometry::placed(const inertial::InertialAlignment& found, const SE3& T_map_keyframe,
                                                 const FrameResult& frame) const {
  const Eigen::Quaterniond R_level_map = found.T_world_camera.back().rotation * T_map_keyframe.rotation.conjugate();
  const Sim3 T_level_map(found.scale.back(), R_level_map, Vec3::Zero());
  const SE3 T_level_imu = (T_level_map * *frame.T_map_camera) * options_.imu.T_imu_camera.inverse();
  const SE3 before = placement_ ? T_world_imu(*placement_, *frame.T_map_camera) : (last_ ? last_->T_world_imu : SE3());
  const Eigen::Quaterniond turn = about_up(heading_change_rad(T_level_imu, frame.quality.time_s));
  Placement placement;
  placement.T_world_map =
      Sim3(T_level_map.scale, turn * R_level_map, before.translation - turn * T_level_imu.translation);
  placement.sigma_log_scale = kScaleInflation * std::max(1.0, found.residual_ratio) * found.sigma_log_scale;
  placement.sigma_up_rad = kTiltInflation * found.sigma_up_rad;
  placement.wander_variance = std::pow(frame.quality.sigma_log_scale, 2);
  placement.velocity_m_s = turn * found.velocity_m_s.back();
  placement.bias = found.bias.back();
  return placement;
}

/// The stated deviation of a young map's scale is too small, since so are those of its keyframes: wait until two
/// estimates in a row, and both ways to the velocity, agree.
bool MetricOdometry::is_settled(const Placement& placement, const FrameResult& frame) {
  const double scale = placement.T_world_map.scale;
  const double before = std::exchange(guessed_scale_, scale).value_or(0.0);
  if (!(std::abs(std::log(scale / before)) < options_.max_scale_change)) return false;
  const std::optional<Velocity> seen = fitted_velocity(placement, frame.quality);
  return seen && (seen->value_m_s - placement.velocity_m_s).norm() < options_.max_velocity_difference_m_s;
}

double MetricOdometry::heading_change_rad(const SE3& T_level_imu, double time_s) const {
  if (last_) {
    const Eigen::Quaterniond R_world_imu = placement_ ? T_world_imu(*placement_, images_.back().T_local_camera).rotation
                                                      : predict(time_s).T_world_imu.rotation;
    return turn_about_up_rad(T_level_imu.rotation, R_world_imu);
  }
  const Vec3 forward = T_level_imu.rotation * Vec3::UnitX();
  return -std::atan2(forward.y(), forward.x());
}

MetricOdometry::Prediction MetricOdometry::predict(double time_s) const {
  const geometry::ImuBias bias = placement_ ? placement_->bias : geometry::ImuBias{};
  Prediction expected{last_->T_world_imu, {last_->velocity_m_s, velocity_variance_m2_s2_}};
  Vec3& velocity_m_s = expected.velocity.value_m_s;
  Eigen::Quaterniond& R = expected.T_world_imu.rotation;
  double at_s = last_->time_s;
  for (const geometry::ImuSample& one : readings_) {
    if (one.time_s <= at_s || one.time_s > time_s) continue;
    const double dt = one.time_s - at_s;
    R = R * geometry::so3_exp(dt * (one.angular_rate_rad_s - bias.gyroscope_rad_s));
    const Vec3 acceleration =
        R * (one.specific_force_m_s2 - bias.accelerometer_m_s2) - Vec3(0, 0, options_.imu.gravity_m_s2);
    expected.T_world_imu.translation += dt * velocity_m_s + 0.5 * dt * dt * acceleration;
    velocity_m_s += dt * acceleration;
    at_s = one.time_s;
  }
  // The vertical's error stays the same for a second or so.
  constexpr double kCorrelated_s = 1.0;
  const double gone_s = time_s - last_->time_s;
  const double sigma_m_s2 = options_.imu.gravity_m_s2 * (placement_ ? placement_->sigma_up_rad : 0.0);
  expected.velocity.variance_m2_s2 += sigma_m_s2 * sigma_m_s2 * gone_s * kCorrelated_s;
  expected.sigma_m = gone_s * std::sqrt(expected.velocity.variance_m2_s2);
  return expected;
}

/// Moves the map, so that the image has the pose that the readings say.
bool MetricOdometry::bridge(const FrameResult& frame, const Prediction& expected) {
  const SE3 seen = T_world_imu(*placement_, *frame.T_map_camera);
  const double sigma_m = placement_->T_world_map.scale * frame.quality.sigma_position;
  const double gate_m = std::max(options_.least_gate_m, options_.gate_sigmas * std::hypot(sigma_m, expected.sigma_m));
  if ((seen.translation - expected.T_world_imu.translation).norm() < gate_m) return false;
  const Eigen::Quaterniond turn = expected.T_world_imu.rotation * seen.rotation.conjugate();
  Sim3& T_world_map = placement_->T_world_map;
  T_world_map = Sim3(T_world_map.scale, turn * T_world_map.rotation,
                     expected.T_world_imu.translation + turn * (T_world_map.translation - seen.translation));
  bridged_s_ = frame.quality.time_s;
  drift_.position_variance_m2 += expected.sigma_m * expected.sigma_m;
  return true;
}

SE3 MetricOdometry::T_world_imu(const Placement& placement, const SE3& T_map_camera) const {
  return (placement.T_world_map * T_map_camera) * options_.imu.T_imu_camera.inverse();
}

MetricEstimate MetricOdometry::estimate(const FrameResult& frame, const std::optional<Prediction>& expected,
                                        bool is_placed) {
  const FrameQuality& quality = frame.quality;
  MetricEstimate now;
  now.time_s = quality.time_s;
  now.T_world_imu = T_world_imu(*placement_, *frame.T_map_camera);
  now.metres_per_map_unit = placement_->T_world_map.scale;
  now.saturated_share = quality.saturated_share;
  const double wandered = std::pow(quality.sigma_log_scale, 2) - placement_->wander_variance;
  now.sigma_log_scale = std::sqrt(std::pow(placement_->sigma_log_scale, 2) + std::max(0.0, wandered));
  add_drift(quality, now.sigma_log_scale, now.T_world_imu);
  const double sigma_position_m = now.metres_per_map_unit * quality.sigma_position / std::sqrt(3.0);
  const double heading_variance = drift_.heading_variance_rad2 + std::pow(quality.sigma_rotation_rad, 2) / 3.0;
  const Vec3 across_m = Vec3::UnitZ().cross(now.T_world_imu.translation);
  now.position_covariance_m2 = (drift_.position_variance_m2 + sigma_position_m * sigma_position_m) * Mat3::Identity() +
                               drift_.scale_m * drift_.scale_m.transpose() +
                               heading_variance * across_m * across_m.transpose();
  const double tilt_variance =
      0.5 * std::pow(placement_->sigma_up_rad, 2) + std::pow(quality.sigma_rotation_rad, 2) / 3.0;
  now.rotation_covariance_rad2 = Vec3(tilt_variance, tilt_variance, heading_variance).asDiagonal();
  if (!readings_.empty())
    now.angular_rate_rad_s = readings_.back().angular_rate_rad_s - placement_->bias.gyroscope_rad_s;
  const Velocity aligned{placement_->velocity_m_s, kAlignedVelocity_m_s * kAlignedVelocity_m_s};
  Velocity velocity = expected ? expected->velocity : aligned;
  if (expected && is_placed) velocity.update(aligned);
  if (const auto seen = fitted_velocity(*placement_, quality)) velocity.update(*seen);
  velocity_variance_m2_s2_ = velocity.variance_m2_s2;
  now.velocity_m_s = velocity.value_m_s;
  const Vec3 by_scale_m_s = now.sigma_log_scale * now.velocity_m_s;
  now.velocity_covariance_m2_s2 = velocity.variance_m2_s2 * Mat3::Identity() + by_scale_m_s * by_scale_m_s.transpose();
  return now;
}

/// The step since the last estimate, of this map.
void MetricOdometry::add_drift(const FrameQuality& quality, double sigma_log_scale, const SE3& T_world_imu) {
  if (last_) drift_.scale_m += sigma_log_scale * (T_world_imu.translation - last_->T_world_imu.translation);
  if (!quality.is_keyframe) return;
  const double sigma_m = kStepInflation * placement_->T_world_map.scale * quality.sigma_position;
  drift_.position_variance_m2 += sigma_m * sigma_m / 3.0;
  drift_.heading_variance_rad2 += std::pow(kTiltInflation * quality.sigma_rotation_rad, 2) / 3.0;
}

/// The unit's positions at the latest images, without what the readings say that its changes of velocity did since
/// then, lie on a line, whose slope is the velocity now.
std::optional<MetricOdometry::Velocity> MetricOdometry::fitted_velocity(const Placement& placement,
                                                                        const FrameQuality& quality) const {
  const double now_s = quality.time_s, from_s = std::max(now_s - options_.velocity_window_s, bridged_s_);
  const SE3 here = T_world_imu(placement, images_.back().T_local_camera);
  const auto motions =
      motion_before(readings_, here.rotation, now_s, placement.bias, options_.imu.gravity_m_s2, from_s);
  double times = 0.0, squares = 0.0;
  Vec3 positions = Vec3::Zero(), products = Vec3::Zero();
  int count = 0;
  for (const geometry::StampedPose& image : images_) {
    if (image.time_s < from_s) continue;
    const double t = image.time_s - now_s;
    const Vec3 p =
        T_world_imu(placement, image.T_local_camera).translation - here.translation - displacement_at(motions, t);
    ++count;
    times += t;
    squares += t * t;
    positions += p;
    products += t * p;
  }
  if (count < kFewestForVelocity) return std::nullopt;
  const double spread = squares - times * times / count;
  const double sigma_m = kCorrelatedErrors * placement.T_world_map.scale * quality.sigma_position / std::sqrt(3.0);
  // Each image is in `count` such windows, one after the other.
  return Velocity{(products - times * positions / count) / spread, count * sigma_m * sigma_m / spread};
}

void MetricOdometry::Velocity::update(const Velocity& measured) {
  const double gain = variance_m2_s2 / (variance_m2_s2 + measured.variance_m2_s2);
  value_m_s += gain * (measured.value_m_s - value_m_s);
  variance_m2_s2 *= 1.0 - gain;
}

}  // namespace tileflight::odometry
