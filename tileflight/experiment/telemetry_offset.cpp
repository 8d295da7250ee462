#include "tileflight/experiment/telemetry_offset.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <optional>

#include "tileflight/flight/path.h"
#include "tileflight/flight/smooth_path.h"
#include "tileflight/geometry/geodesy.h"

namespace tileflight::experiment {
namespace {

using alignment::TimedVector;
using flight::TelemetryFix;
using geometry::Trajectory;
using geometry::Vec3;
using Signal = std::vector<TimedVector>;

/// Log likelihood by which a path must bend more than its spline has parameters.
constexpr double kLeastGain = 20.0;

/// Whether a fitted spline says more than a straight line in time would: by Akaike's criterion and a margin, so that
/// two splines that only bend with their noise are not compared.
bool is_uneven(const std::vector<double>& times_s, const std::vector<Vec3>& values, const flight::SplineFit& fit) {
  const auto n = static_cast<double>(values.size());
  double time_mean_s = 0.0, time_square = 0.0;
  Vec3 mean = Vec3::Zero(), slope = Vec3::Zero();
  for (std::size_t i = 0; i < values.size(); ++i) time_mean_s += times_s[i] / n, mean += values[i] / n;
  for (std::size_t i = 0; i < values.size(); ++i) {
    time_square += (times_s[i] - time_mean_s) * (times_s[i] - time_mean_s);
    slope += (times_s[i] - time_mean_s) * (values[i] - mean);
  }
  slope /= time_square;
  double left = 0.0;
  for (std::size_t i = 0; i < values.size(); ++i)
    left += (values[i] - mean - (times_s[i] - time_mean_s) * slope).squaredNorm();
  const double gain = 1.5 * n * std::log(left / std::max(3.0 * n * fit.rms * fit.rms, 1e-12 * left));
  return left > 0.0 && gain > 3.0 * static_cast<double>(fit.controls - 2) + kLeastGain;
}

/// Zero throughout where nothing but noise turns the camera.
Signal turning_rates(const Trajectory& trajectory) {
  if (trajectory.size() < flight::kLeastPosesToSmooth) return {};
  const flight::SmoothPath smooth = flight::smooth_path(trajectory);
  std::vector<double> times_s;
  std::vector<Vec3> turned;
  for (const geometry::StampedPose& pose : trajectory.poses) {
    const Eigen::Quaterniond from_first =
        trajectory.poses.front().T_local_camera.rotation.conjugate() * pose.T_local_camera.rotation;
    times_s.push_back(pose.time_s);
    turned.push_back(geometry::so3_log(from_first));
  }
  const bool turns = is_uneven(times_s, turned, smooth.rotation);
  Signal rates;
  for (const double time_s : times_s)
    rates.push_back({time_s, turns ? smooth.path.angular_velocity(time_s) : Vec3(Vec3::Zero())});
  return rates;
}

/// Zero throughout where nothing but noise changes the course.
Signal velocities(const std::vector<double>& times_s, const std::vector<Vec3>& positions_m) {
  if (times_s.size() < flight::kLeastPosesToSmooth) return {};
  const flight::SmoothPositions smooth = flight::smooth_positions(times_s, positions_m);
  const bool bends = is_uneven(times_s, positions_m, smooth.fit);
  Signal result;
  for (const double time_s : times_s)
    result.push_back({time_s, bends ? smooth.spline.first_derivative(time_s) : Vec3(Vec3::Zero())});
  return result;
}

Signal velocities(const Trajectory& trajectory) {
  std::vector<double> times_s;
  std::vector<Vec3> positions_m;
  for (const geometry::StampedPose& pose : trajectory.poses) {
    times_s.push_back(pose.time_s);
    positions_m.push_back(pose.T_local_camera.translation);
  }
  return velocities(times_s, positions_m);
}

Signal gyroscope(const flight::Telemetry& telemetry) {
  Signal rates;
  for (const flight::BodyRate& rate : telemetry.body_rates) rates.push_back({rate.time_s, rate.rate_rad_s});
  return rates;
}

using Angle = std::optional<double> TelemetryFix::*;

/// Turning rates of what has these angles; empty where the log does not have all three.
Signal rates_of_angles(const flight::Telemetry& telemetry, Angle yaw_deg, Angle pitch_deg, Angle roll_deg) {
  Trajectory orientations;
  for (const TelemetryFix& fix : telemetry.fixes) {
    if (!(fix.*yaw_deg) || !(fix.*pitch_deg) || !(fix.*roll_deg)) continue;
    const Eigen::Quaterniond rotation =
        flight::camera_orientation(*(fix.*yaw_deg), *(fix.*pitch_deg), *(fix.*roll_deg));
    orientations.poses.push_back({fix.time_s, geometry::SE3(rotation, Vec3::Zero())});
  }
  return turning_rates(orientations);
}

/// Velocity along the track, east, north, up. Heights are of one kind or none.
Signal track(const flight::Telemetry& telemetry) {
  const std::vector<TelemetryFix> fixes = flight::distinct_fixes(telemetry);
  if (fixes.empty()) return {};
  const auto height_m = [](const TelemetryFix& fix) {
    return fix.absolute_height_m.value_or(fix.height_above_takeoff_m.value_or(0.0));
  };
  const TelemetryFix& first = fixes.front();
  const geometry::LocalFrame frame({first.latitude_deg, first.longitude_deg, {height_m(first)}});
  std::vector<double> times_s;
  std::vector<Vec3> positions_m;
  for (const TelemetryFix& fix : fixes) {
    times_s.push_back(fix.time_s);
    positions_m.push_back(frame.local_from_geodetic({fix.latitude_deg, fix.longitude_deg, {height_m(fix)}}));
  }
  return velocities(times_s, positions_m);
}

/// Gimbals often write a roll of 0 whatever the camera does. Rates about the optical axis are then left out.
bool knows_roll(const flight::Telemetry& telemetry) {
  const auto& first = telemetry.fixes.front().gimbal_roll_deg;
  return std::ranges::any_of(telemetry.fixes, [&](const TelemetryFix& fix) { return fix.gimbal_roll_deg != first; });
}

Signal without_roll(Signal rates) {
  for (TimedVector& rate : rates) rate.value.z() = 0.0;
  return rates;
}

struct Source {
  std::string name;
  Signal camera, log;
  bool by_velocity = false;
};

Source gimbal(const Signal& camera_rates, const flight::Telemetry& telemetry) {
  Signal log = rates_of_angles(telemetry, &TelemetryFix::gimbal_yaw_deg, &TelemetryFix::gimbal_pitch_deg,
                               &TelemetryFix::gimbal_roll_deg);
  if (log.empty() || knows_roll(telemetry)) return {"gimbal", camera_rates, std::move(log)};
  return {"gimbal", without_roll(camera_rates), without_roll(std::move(log))};
}

Source attitude(const Signal& camera_rates, const flight::Telemetry& telemetry) {
  return {"attitude", camera_rates,
          rates_of_angles(telemetry, &TelemetryFix::body_yaw_deg, &TelemetryFix::body_pitch_deg,
                          &TelemetryFix::body_roll_deg)};
}

}  // namespace

TelemetryOffset telemetry_offset(const Trajectory& T_map_camera, const flight::Telemetry& telemetry) {
  const Signal rates = turning_rates(T_map_camera);
  const std::array<std::function<Source()>, 4> sources = {
      [&] {
        return Source{"gyroscope", rates, gyroscope(telemetry)};
      },
      [&] { return gimbal(rates, telemetry); },
      [&] { return attitude(rates, telemetry); },
      [&] {
        return Source{"track", velocities(T_map_camera), track(telemetry), true};
      },
  };
  TelemetryOffset result;
  for (const auto& make : sources) {
    const Source source = make();
    if (source.log.empty()) continue;
    const alignment::TimeOffset offset =
        alignment::estimate_time_offset(source.camera, source.log, {.estimate_scale = source.by_velocity});
    if (offset.determined) return {offset, source.name};
    result.offset.reason += (result.offset.reason.empty() ? "" : "; ") + source.name + ": " + offset.reason;
  }
  if (result.offset.reason.empty()) result.offset.reason = "the log has neither rates, angles nor a track";
  return result;
}

}  // namespace tileflight::experiment
