#include "tileflight/live/simulator/vision_input.h"

#include <algorithm>
#include <cmath>
#include <variant>

#include "tileflight/capture/vehicle/vehicle.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/settings.h"
#include "tileflight/live/simulator/simulation_clock.h"

namespace tileflight::simulator {
namespace {

using geometry::Mat3;
using geometry::SE3;
using geometry::Vec3;

constexpr double kHourPerSecond = 1.0 / 3600.0;
constexpr double kMicroGravity = 1e-6 * vehicle::kStandardGravity_m_s2;
/// Standard deviations of the biases that are left after a calibration at rest.
constexpr double kGyroscopeBias_rad_s = 0.005, kAccelerometerBias_m_s2 = 0.05;
/// The settings' mounting is exact.
constexpr double kMounting_rad = 0.001;
/// Least noise that an estimator assumes, so that its weights stay finite.
constexpr double kLeastDensity = 1e-6;
constexpr std::uint8_t kLocalNed = 1, kLocalFrd = 20;  ///< MAV_FRAME_LOCAL_NED, MAV_FRAME_LOCAL_FRD

/// Converts axes x forward, y left, z up to x forward, y right, z down; its own inverse.
const Vec3 kDownwards(1.0, -1.0, -1.0);

Mat3 turned(const Mat3& covariance) { return kDownwards.asDiagonal() * covariance * kDownwards.asDiagonal(); }

/// Upper triangle, row by row, of a covariance of two blocks.
std::array<float, 21> upper_triangle(const Mat3& first, const Mat3& second) {
  geometry::Mat3 blocks[2] = {first, second};
  std::array<float, 21> values{};
  std::size_t at = 0;
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column) {
      const bool same_block = row / 3 == column / 3;
      values[at++] = same_block ? static_cast<float>(blocks[row / 3](row % 3, column % 3)) : 0.0F;
    }
  }
  return values;
}

std::array<float, 3> float_triple(const Vec3& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}

Vec3 vector(const std::array<float, 3>& v) { return {v[0], v[1], v[2]}; }

ImuSettings first_imu(const VehicleSettings& vehicle) {
  for (const SensorSettings& sensor : vehicle.sensors) {
    if (const auto* imu = std::get_if<ImuSettings>(&sensor.kind)) return *imu;
  }
  return {};
}

const CameraSettings& camera_of(const VehicleSettings& vehicle) {
  return *std::ranges::find(vehicle.cameras, vehicle.autopilot->vision.camera, &CameraSettings::name);
}

std::uint64_t whole_steps(double duration_s, double step_s) {
  return static_cast<std::uint64_t>(std::max(1L, std::lround(duration_s / step_s)));
}

}  // namespace

inertial::ImuModel imu_model(const ImuSettings& settings, double interval_s, const SE3& T_body_camera) {
  // A reading's noise is that of a clock's step, however often it is read.
  const double density_per_setting = std::sqrt(kHourPerSecond * interval_s / SimulationClock::kStep_s);
  // A first-order Gauss-Markov process is a random walk for times that are short against its own.
  const auto walk = [](double stability, double tau_s) { return stability * std::sqrt(2.0 / tau_s); };
  inertial::ImuModel model;
  model.noise.gyroscope_noise_density = radians(settings.angular_random_walk_deg_sqrt_h) * density_per_setting;
  model.noise.accelerometer_noise_density = settings.velocity_random_walk_m_s_sqrt_h * density_per_setting;
  model.noise.gyroscope_random_walk =
      walk(radians(settings.gyro_bias_stability_deg_h) * kHourPerSecond, settings.gyro_bias_tau_s);
  model.noise.accelerometer_random_walk =
      walk(settings.accel_bias_stability_ug * kMicroGravity, settings.accel_bias_tau_s);
  for (double* density : {&model.noise.gyroscope_noise_density, &model.noise.accelerometer_noise_density,
                          &model.noise.gyroscope_random_walk, &model.noise.accelerometer_random_walk})
    *density = std::max(*density, kLeastDensity);
  model.T_imu_camera = T_body_camera * T_frd_optical();
  model.gravity_m_s2 = vehicle::kStandardGravity_m_s2;
  model.mounting_sigma_rad = kMounting_rad;
  model.gyroscope_bias_sigma = kGyroscopeBias_rad_s;
  model.accelerometer_bias_sigma = kAccelerometerBias_m_s2;
  return model;
}

autopilot::Odometry vision_message(const odometry::MetricEstimate& estimate, std::uint64_t time_us, int resets,
                                   double sigma_rate_rad_s, VisionSource source) {
  const Eigen::Quaterniond& R_up_body = estimate.T_world_imu.rotation;
  const Eigen::Quaterniond R_down_body = Eigen::Quaterniond(0, 1, 0, 0) * R_up_body;
  const Mat3 R_body_up = R_up_body.conjugate().toRotationMatrix();
  autopilot::Odometry message;
  message.time_us = time_us;
  message.position_m = float_triple(kDownwards.cwiseProduct(estimate.T_world_imu.translation));
  message.attitude_wxyz = {static_cast<float>(R_down_body.w()), static_cast<float>(R_down_body.x()),
                           static_cast<float>(R_down_body.y()), static_cast<float>(R_down_body.z())};
  message.velocity_m_s = float_triple(R_body_up * estimate.velocity_m_s);
  message.rates_rad_s = float_triple(estimate.angular_rate_rad_s);
  message.pose_covariance =
      upper_triangle(turned(estimate.position_covariance_m2), turned(estimate.rotation_covariance_rad2));
  message.velocity_covariance = upper_triangle(R_body_up * estimate.velocity_covariance_m2_s2 * R_body_up.transpose(),
                                               sigma_rate_rad_s * sigma_rate_rad_s * Mat3::Identity());
  message.frame = source == VisionSource::kPlace ? kLocalNed : kLocalFrd;
  message.resets = static_cast<std::uint8_t>(resets);
  message.quality =
      static_cast<std::int8_t>(std::clamp(std::lround(100.0 * (1.0 - estimate.saturated_share)), 1L, 100L));
  return message;
}

VisionInput::VisionInput(const VehicleSettings& vehicle, double step_s, std::shared_ptr<WorkingSet> tiles,
                         SimulatorLog log)
    : settings_(vehicle.autopilot->vision),
      vehicle_(vehicle.name),
      log_(std::move(log)),
      calibration_{make_lens(camera_of(vehicle).captures[0], "camera '" + settings_.camera + "'"), {}, 0.0},
      imu_(imu_model(first_imu(vehicle), step_s, camera_of(vehicle).T_body_camera)),
      sigma_rate_rad_s_(imu_.noise.gyroscope_noise_density / std::sqrt(step_s)),
      exposure_steps_(whole_steps(1.0 / settings_.rate_hz, step_s)),
      latency_steps_(whole_steps(settings_.latency_s, step_s)),
      tiles_(std::move(tiles)),
      estimator_(make_estimator()) {}

VisionInput::Estimator VisionInput::make_estimator() const {
  if (tiles_) return PlaceVision(tiles_, calibration_.camera, imu_);
  odometry::MetricOdometryOptions options;
  options.imu = imu_;
  return odometry::MetricOdometry(calibration_, options);
}

void VisionInput::restart() {
  estimator_ = make_estimator();
  waiting_.clear();
  latest_.reset();
  first_us_.reset();
  was_known_ = told_lost_ = false;
}

void VisionInput::add_reading(const autopilot::HilSensor& reading) {
  const geometry::ImuSample sample{1e-6 * static_cast<double>(reading.time_us), vector(reading.gyro_rad_s),
                                   vector(reading.accelerometer_m_s2)};
  std::visit([&](auto& estimator) { estimator.add_reading(sample); }, estimator_);
}

void VisionInput::add_picture(imaging::RgbImage picture, std::uint64_t step, std::uint64_t time_us,
                              const SE3& T_local_body) {
  if (!first_us_) first_us_ = time_us;
  if (auto* place = std::get_if<PlaceVision>(&estimator_); place != nullptr && !place->is_started())
    place->start(T_local_body);
  odometry::MetricResult result;
  try {
    const double time_s = 1e-6 * static_cast<double>(time_us);
    result = std::visit([&](auto& estimator) { return estimator.add(std::move(picture), time_s); }, estimator_);
  } catch (const InputError& error) {  // a client has changed the size of its pictures
    result = {odometry::MetricStatus::kNotAligned, {}, error.what()};
  }
  latest_ = result.estimate;
  tell(result, 1e-6 * static_cast<double>(time_us - *first_us_));
  const int resets = std::visit([](const auto& estimator) { return estimator.restarts(); }, estimator_);
  if (result.estimate)
    waiting_.emplace_back(step + latency_steps_,
                          vision_message(*result.estimate, time_us, resets, sigma_rate_rad_s_, settings_.source));
}

/// Logs a line when the pose begins to be known, and when it is lost. Tiles in which no picture is ever found are
/// named, too.
void VisionInput::tell(const odometry::MetricResult& result, double time_s) {
  const bool is_lost = result.status == odometry::MetricStatus::kLost;
  const bool begins = result.estimate && !was_known_;
  const bool loses = is_lost && (was_known_ || (tiles_ && !told_lost_));
  if (log_ && (begins || loses)) {
    const std::string when = base::rounded_text(time_s, 1) + " s after its start";
    const std::string begun =
        tiles_ ? "is located in the place " + when
               : "is metric " + when + ", scale to " +
                     base::rounded_text(result.estimate ? 100.0 * result.estimate->sigma_log_scale : 0.0, 1) + " %";
    const std::string lost = "is lost " + when + " (" + result.reason + "); ODOMETRY stops until " +
                             (tiles_ ? "it is located again" : "a new map is metric");
    log_("vehicle '" + vehicle_ + "': its vision, camera " + settings_.camera + ", " + (begins ? begun : lost));
  }
  if (begins) was_known_ = true;
  if (is_lost) was_known_ = false;
  told_lost_ = is_lost || (told_lost_ && !begins);
}

std::optional<autopilot::Odometry> VisionInput::message_at(std::uint64_t step) {
  if (waiting_.empty() || waiting_.front().first > step) return std::nullopt;
  const autopilot::Odometry message = waiting_.front().second;
  waiting_.pop_front();
  return message;
}

}  // namespace tileflight::simulator
