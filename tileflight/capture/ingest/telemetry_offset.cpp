#include "tileflight/capture/ingest/telemetry_offset.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <optional>

#include "tileflight/capture/flight_path/path.h"
#include "tileflight/capture/flight_path/smooth_path.h"
#include "tileflight/core/geometry/geodesy.h"

namespace tileflight::ingest {
namespace {

using alignment::TimedVector;
using flight_logs::TelemetryFix;
using geometry::Trajectory;
using geometry::Vec3;
using Signal = std::vector<TimedVector>;

/// Minimum gain in log likelihood beyond the number of the spline's parameters for a path to count as curved.
constexpr double kMinGain = 20.0;

/// Whether a fitted spline is significantly better than a straight line in time, by Akaike's criterion plus a margin;
/// otherwise two splines that only follow noise would be compared.
bool is_spline_significant(const std::vector<double>& times_s, const std::vector<Vec3>& values,
                           const flight_path::SplineFit& fit) {
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
  return left > 0.0 && gain > 3.0 * static_cast<double>(fit.control_count - 2) + kMinGain;
}

/// All zero if the rotation is not significant against noise.
Signal angular_rates(const Trajectory& trajectory) {
  if (trajectory.size() < flight_path::kMinPosesToSmooth) return {};
  const flight_path::SmoothPath smooth = flight_path::smooth_path(trajectory);
  std::vector<double> times_s;
  std::vector<Vec3> turned;
  for (const geometry::StampedPose& pose : trajectory.poses) {
    const Eigen::Quaterniond from_first =
        trajectory.poses.front().T_local_camera.rotation.conjugate() * pose.T_local_camera.rotation;
    times_s.push_back(pose.time_s);
    turned.push_back(geometry::so3_log(from_first));
  }
  const bool turns = is_spline_significant(times_s, turned, smooth.rotation);
  Signal rates;
  for (const double time_s : times_s)
    rates.push_back({time_s, turns ? smooth.path.angular_velocity(time_s) : Vec3(Vec3::Zero())});
  return rates;
}

/// All zero if the change of course is not significant against noise.
Signal velocities(const std::vector<double>& times_s, const std::vector<Vec3>& positions_m) {
  if (times_s.size() < flight_path::kMinPosesToSmooth) return {};
  const flight_path::SmoothPositions smooth = flight_path::smooth_positions(times_s, positions_m);
  const bool bends = is_spline_significant(times_s, positions_m, smooth.fit);
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

Signal gyroscope_rates(const flight_logs::Telemetry& telemetry) {
  Signal rates;
  for (const flight_logs::BodyRate& rate : telemetry.body_rates) rates.push_back({rate.time_s, rate.rate_rad_s});
  return rates;
}

using Angle = std::optional<double> TelemetryFix::*;

/// Angular rates from a set of angles; empty if the log does not have all three.
Signal angular_rates_from_angles(const flight_logs::Telemetry& telemetry, Angle yaw_deg, Angle pitch_deg,
                                 Angle roll_deg) {
  Trajectory orientations;
  for (const TelemetryFix& fix : telemetry.fixes) {
    if (!(fix.*yaw_deg) || !(fix.*pitch_deg) || !(fix.*roll_deg)) continue;
    const Eigen::Quaterniond rotation =
        flight_path::camera_orientation(*(fix.*yaw_deg), *(fix.*pitch_deg), *(fix.*roll_deg));
    orientations.poses.push_back({fix.time_s, geometry::SE3(rotation, Vec3::Zero())});
  }
  return angular_rates(orientations);
}

/// Velocity along the track, east, north, up. Heights are all of one kind, or ignored.
Signal track_velocities(const flight_logs::Telemetry& telemetry) {
  const std::vector<TelemetryFix> fixes = flight_logs::distinct_fixes(telemetry);
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

/// Whether the log has a real roll angle: gimbals often write 0 whatever the camera does. Rates about the optical axis
/// are ignored then.
bool has_roll(const flight_logs::Telemetry& telemetry) {
  const auto& first = telemetry.fixes.front().gimbal_roll_deg;
  return std::ranges::any_of(telemetry.fixes, [&](const TelemetryFix& fix) { return fix.gimbal_roll_deg != first; });
}

Signal zero_roll_rates(Signal rates) {
  for (TimedVector& rate : rates) rate.value.z() = 0.0;
  return rates;
}

struct SignalPair {
  std::string name;
  Signal camera, log;
  bool by_velocity = false;
};

SignalPair gimbal_signals(const Signal& camera_rates, const flight_logs::Telemetry& telemetry) {
  Signal log = angular_rates_from_angles(telemetry, &TelemetryFix::gimbal_yaw_deg, &TelemetryFix::gimbal_pitch_deg,
                                         &TelemetryFix::gimbal_roll_deg);
  if (log.empty() || has_roll(telemetry)) return {"gimbal", camera_rates, std::move(log)};
  return {"gimbal", zero_roll_rates(camera_rates), zero_roll_rates(std::move(log))};
}

SignalPair attitude_signals(const Signal& camera_rates, const flight_logs::Telemetry& telemetry) {
  return {"attitude", camera_rates,
          angular_rates_from_angles(telemetry, &TelemetryFix::body_yaw_deg, &TelemetryFix::body_pitch_deg,
                                    &TelemetryFix::body_roll_deg)};
}

}  // namespace

TelemetryOffset estimate_telemetry_offset(const Trajectory& T_map_camera, const flight_logs::Telemetry& telemetry) {
  const Signal rates = angular_rates(T_map_camera);
  const std::array<std::function<SignalPair()>, 4> sources = {
      [&] {
        return SignalPair{"gyroscope", rates, gyroscope_rates(telemetry)};
      },
      [&] { return gimbal_signals(rates, telemetry); },
      [&] { return attitude_signals(rates, telemetry); },
      [&] {
        return SignalPair{"track", velocities(T_map_camera), track_velocities(telemetry), true};
      },
  };
  TelemetryOffset result;
  for (const auto& make : sources) {
    const SignalPair source = make();
    if (source.log.empty()) continue;
    const alignment::TimeOffset offset =
        alignment::estimate_time_offset(source.camera, source.log, {.estimate_scale = source.by_velocity});
    if (offset.determined) return {offset, source.name};
    result.offset.reason += (result.offset.reason.empty() ? "" : "; ") + source.name + ": " + offset.reason;
  }
  if (result.offset.reason.empty()) result.offset.reason = "the log has no rates, no angles and no track";
  return result;
}

}  // namespace tileflight::ingest
