#include "tileflight/slam/odometry/inertial_guide.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/base/input_error.h"

namespace tileflight::odometry {
namespace {

using geometry::SE3;

// Chosen by hand.
constexpr std::size_t kLatestKeyframes = 40;   ///< from which scale and vertical are estimated
constexpr std::size_t kFewest = 5;             ///< keyframes
constexpr double kSettled = 0.03;              ///< change of the scale's logarithm between two estimates in a row
constexpr double kContradiction = 9.0 * 36.0;  ///< squared normalised residual of the readings, of nine numbers

geometry::Trajectory images_since(double from_s, const TrackingLog& log, const mapping::Mapper& mapper) {
  geometry::Trajectory images = trajectory_so_far(log, mapper);
  std::erase_if(images.poses, [from_s](const geometry::StampedPose& pose) { return pose.time_s < from_s; });
  return images;
}

}  // namespace

InertialGuide::InertialGuide(inertial::InertialInput readings, bool is_tight)
    : readings_(std::move(readings)),
      is_tight_(is_tight),
      check_(inertial::check_readings(readings_.samples, readings_.model.noise, readings_.where)),
      T_imu_camera_(readings_.model.T_imu_camera) {}

std::optional<inertial::Preintegration> InertialGuide::between(double from_s, double to_s,
                                                               const mapping::Mapper& mapper) const {
  const double from_imu_s = from_s + time_offset_s_, to_imu_s = to_s + time_offset_s_;
  if (!check_.covers(from_imu_s, to_imu_s)) return std::nullopt;
  const mapping::InertialWindow* const coupled = mapper.inertial();
  return inertial::preintegrate(readings_.samples, from_imu_s, to_imu_s,
                                coupled != nullptr ? coupled->newest_state(mapper.window()).bias : bias_,
                                readings_.model.noise);
}

std::optional<SE3> InertialGuide::predict(const TrackingState& state, const mapping::Mapper& mapper,
                                          double time_s) const {
  if (const mapping::InertialWindow* const coupled = mapper.inertial()) {
    const auto since = between(mapper.window().keyframes.back().time_s, time_s, mapper);
    if (!since) return std::nullopt;
    return coupled->T_camera_map(
        inertial::predicted(*since, coupled->newest_state(mapper.window()), readings_.model.gravity_m_s2));
  }
  const LastFrame& last = state.last;
  const auto since = between(last.time_s, time_s, mapper);
  if (!since) return std::nullopt;
  const Eigen::Quaterniond& R_imu_camera = T_imu_camera_.rotation;
  const Eigen::Quaterniond R_camera_last =
      R_imu_camera.conjugate() * since->increment.rotation.conjugate() * R_imu_camera;
  const double share = last.interval_s > 0.0 ? (time_s - last.time_s) / last.interval_s : 1.0;
  return SE3(R_camera_last, share * last.T_last_before_last.translation) * last.T_camera_map;
}

/// Smoothing takes time in proportion to the keyframes, so that it is done less often the more there are, and for a
/// window that is coupled only where twice the keyframes may tell much more.
bool InertialGuide::is_due(std::size_t keyframes, bool is_coupled) const {
  if (keyframes < kFewest) return false;
  return is_coupled ? keyframes >= 2 * tried_at_ : 10 * keyframes >= 13 * tried_at_;
}

/// Returns the readings that a live recording would have: up to the latest image, by a clock that may differ.
inertial::InertialInput InertialGuide::readings_of(double from_s, double to_s) const {
  constexpr double kClocks_s = 0.25;
  inertial::InertialInput part{.samples = {}, .model = readings_.model, .where = readings_.where};
  const auto& all = readings_.samples;
  const auto time_of = [](const geometry::ImuSample& one) { return one.time_s; };
  const auto first = std::ranges::lower_bound(all, from_s - kClocks_s, {}, time_of);
  const auto last = std::ranges::upper_bound(all, to_s + kClocks_s, {}, time_of);
  part.samples.assign(first, last);
  return part;
}

void InertialGuide::couple(const inertial::InertialAlignment& found, const SE3& T_map_keyframe,
                           mapping::Mapper& mapper) {
  const auto& model = readings_.model;
  mapper.couple({.R_world_map = found.T_world_camera.back().rotation * T_map_keyframe.rotation.conjugate(),
                 .log_scale = std::log(found.scale.back()),
                 .velocity_m_s = found.velocity_m_s.back(),
                 .bias = found.bias.back(),
                 .covariance = found.latest_covariance},
                {T_imu_camera_, model.noise, model.gravity_m_s2});
  sigma_log_scale_ = found.sigma_log_scale;
}

void InertialGuide::update(const TrackingLog& log, mapping::Mapper& mapper) {
  if (!is_tight_) return;
  if (mapper.inertial() != nullptr && mapper.inertial()->newest_residual(mapper.window()) > kContradiction)
    mapper.uncouple();
  const std::size_t all = mapper.step_uncertainties().size() + log.earlier.keyframes.size();
  if (!is_due(all, mapper.inertial() != nullptr)) return;
  tried_at_ = all;
  const std::vector<inertial::VisualKeyframe> keyframes = latest_keyframes_so_far(log, mapper, kLatestKeyframes);
  inertial::InertialAlignment found;
  try {
    found = inertial::align_to_gravity(keyframes, images_since(keyframes.front().time_s, log, mapper),
                                       readings_of(keyframes.front().time_s, keyframes.back().time_s));
  } catch (const InputError&) {
    return;  // too few readings yet
  }
  if (!found.metric || !found.latest_covariance.allFinite()) {
    guessed_scale_ = 0.0;
    return;
  }
  const bool is_settled = guessed_scale_ > 0.0 && std::abs(std::log(found.scale.back() / guessed_scale_)) < kSettled;
  guessed_scale_ = found.scale.back();
  time_offset_s_ = found.time_offset_s;
  T_imu_camera_ = found.T_imu_camera;
  bias_ = found.bias.back();
  const bool is_better = mapper.inertial() == nullptr || found.sigma_log_scale < 0.5 * sigma_log_scale_;
  if (!is_settled || !is_better) return;
  couple(found, keyframes.back().T_map_camera, mapper);
  if (!coupled_since_s_) coupled_since_s_ = keyframes.back().time_s;
}

}  // namespace tileflight::odometry
