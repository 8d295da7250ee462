#include "tileflight/capture/vehicle/vehicle_flight.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <numbers>

#include "tileflight/core/base/input_error.h"

namespace tileflight::vehicle {
namespace {

using geometry::SE3;
using geometry::Vec3;

/// Hovering time before the flight, until the integral compensates the wind.
constexpr double kSettling_s = 12.0;
constexpr int kStepsPerSample = 3;
/// Factor on the plan's limits: the plan's speeds are the reference, and corrections need a reserve.
constexpr double kReserve = 1.5;
/// Smallest horizontal part of the camera's right axis that defines a heading: a roll of 60 degrees.
constexpr double kMinLevelRight = 0.5;

/// The heading of a level image: 90 degrees to the left of the camera's right axis. Also defined when looking straight
/// down.
double camera_yaw_rad(const Eigen::Quaterniond& R_local_camera) {
  const Vec3 right = R_local_camera * Vec3::UnitX();
  if (right.head<2>().norm() < kMinLevelRight)
    throw InputError("vehicle", "a camera rolled by more than 60 degrees has no heading that a vehicle could fly");
  return std::atan2(right.x(), -right.y());
}

/// Orientation of a fixed camera on the body.
Eigen::Quaterniond fixed_R_body_camera(const CameraMount& mount) {
  return flight_path::camera_orientation(90.0, mount.pitch_deg, 0.0);  // body x, y, z as east, north, up
}

Vec3 camera_position(const RigidBodyState& state, const CameraMount& mount) {
  return state.position_m + state.R_local_body * mount.offset_m;
}

/// `R_level_camera`: the gimbal's orientation in axes that follow only the vehicle's yaw.
SE3 camera_pose(const RigidBodyState& state, const CameraMount& mount, const Eigen::Quaterniond& R_level_camera) {
  const Eigen::Quaterniond rotation = mount.gimbal ? level_orientation(yaw_rad(state.R_local_body)) * R_level_camera
                                                   : state.R_local_body * fixed_R_body_camera(mount);
  return {rotation, camera_position(state, mount)};
}

/// The setpoint at which the camera follows a path.
Setpoint make_setpoint(const flight_path::Path& planned, const CameraMount& mount, double time_s) {
  const SE3 camera = planned.pose(time_s);
  Setpoint setpoint;
  setpoint.yaw_rad = camera_yaw_rad(camera.rotation);
  setpoint.yaw_rate_rad_s = (camera.rotation * planned.angular_velocity(time_s)).z();
  setpoint.position_m = camera.translation - level_orientation(setpoint.yaw_rad) * mount.offset_m;
  setpoint.holds_position = {true, true, true};
  setpoint.velocity_m_s = planned.velocity(time_s);
  setpoint.acceleration_m_s2 = planned.acceleration(time_s);
  return setpoint;
}

VehicleOptions vehicle_options_for(const VehiclePlan& vehicle, const flight_path::SpeedLimits& limits) {
  VehicleOptions options = vehicle.options;
  ControllerOptions& c = options.controller;
  for (double* speed : {&c.max_speed_m_s, &c.max_climb_m_s, &c.max_descent_m_s})
    *speed = std::max(*speed, kReserve * limits.speed_m_s);
  c.max_acceleration_m_s2 = std::max(c.max_acceleration_m_s2, kReserve * limits.acceleration_m_s2);
  c.max_yaw_rate_rad_s = std::max(c.max_yaw_rate_rad_s, kReserve * limits.yaw_rate_deg_s * std::numbers::pi / 180.0);
  return options;
}

/// Records the camera's poses at every third step.
class CameraPathRecorder {
 public:
  using CameraPoseFunction = std::function<SE3(const RigidBodyState& state, double time_s)>;
  CameraPathRecorder(CameraPoseFunction pose_of, const Vehicle& vehicle)
      : camera_pose_(std::move(pose_of)), start_s_(vehicle.time_s()) {
    add(vehicle);
  }

  double time_s(const Vehicle& vehicle) const { return vehicle.time_s() - start_s_; }
  void after_step(const Vehicle& vehicle) {
    if (++steps_ % kStepsPerSample == 0) add(vehicle);
  }
  /// Adds the final pose even if no sample is due.
  flight_path::Path finish(const Vehicle& vehicle) {
    if (steps_ == 0 || steps_ % kStepsPerSample != 0) {
      if (steps_ == 0)
        throw InputError("vehicle", "the plan ends before the first simulation step; check its commands");
      add(vehicle);
    }
    return flight_path::path_through_poses(samples_);
  }

 private:
  void add(const Vehicle& vehicle) {
    const double now_s = time_s(vehicle);
    samples_.poses.push_back({now_s, camera_pose_(vehicle.state(), now_s)});
  }

  CameraPoseFunction camera_pose_;
  double start_s_;
  std::int64_t steps_ = 0;
  geometry::Trajectory samples_;
};

std::optional<Collision> shift_time(std::optional<Collision> collision, double start_s) {
  if (collision) collision->time_s -= start_s;
  return collision;
}

void settle(Vehicle& vehicle, const Setpoint& place, const ObstacleQuery& obstacles) {
  const bool collides = obstacles && vehicle.options().collision != CollisionPolicy::kOff;
  const bool inside = collides && touches(obstacles, place.position_m, vehicle.options().radius_m);
  const auto stay = [place](double) { return place; };
  if (inside || vehicle.run(TrackReference{stay, kSettling_s}) == Outcome::kCollided || vehicle.collisions() > 0)
    throw InputError("vehicle", "collides at its start position; move the start, or set 'collision: off'");
}

/// Accumulates the camera's distance from the plan.
class TrackingErrorAccumulator {
 public:
  TrackingErrorAccumulator(const flight_path::Path& planned, const std::vector<flight_path::Waypoint>& waypoints)
      : planned_(planned),
        waypoints_(waypoints),
        nearest_m_(waypoints.size(), std::numeric_limits<double>::infinity()) {}

  void add(const Vec3& camera, double time_s) {
    const double error_m = (camera - planned_.pose(time_s).translation).norm();
    squares_ += error_m * error_m;
    max_m_ = std::max(max_m_, error_m);
    ++count_;
    for (std::size_t i = 0; i < waypoints_.size(); ++i)
      nearest_m_[i] = std::min(nearest_m_[i], (camera - waypoints_[i].position).norm());
  }
  TrackingError result() const { return {std::sqrt(squares_ / static_cast<double>(count_)), max_m_, nearest_m_}; }

 private:
  const flight_path::Path& planned_;
  const std::vector<flight_path::Waypoint>& waypoints_;
  std::vector<double> nearest_m_;
  double squares_ = 0.0, max_m_ = 0.0;
  std::int64_t count_ = 0;
};

}  // namespace

SE3 mounted_camera_pose(const SE3& T_local_body, const CameraMount& mount) {
  RigidBodyState state;
  state.R_local_body = T_local_body.rotation;
  state.position_m = T_local_body.translation;
  return camera_pose(state, mount, fixed_R_body_camera(mount));
}

VehicleFlight fly_along(const flight_path::Path& planned, const std::vector<flight_path::Waypoint>& waypoints,
                        const flight_path::SpeedLimits& limits, const VehiclePlan& plan, const ObstacleQuery& obstacles,
                        const FlightClock& clock) {
  const CameraMount& mount = plan.mount;
  const double begin_s = planned.start_s();
  Setpoint start = make_setpoint(planned, mount, begin_s);
  start.velocity_m_s.setZero();
  start.acceleration_m_s2.setZero();
  start.yaw_rate_rad_s = 0.0;
  if (clock) clock(0.0);
  Vehicle vehicle(vehicle_options_for(plan, limits), obstacles, start.position_m, start.yaw_rad);
  settle(vehicle, start, obstacles);

  const auto pose_of = [&](const RigidBodyState& state, double time_s) {
    const Eigen::Quaterniond wanted = planned.pose(begin_s + time_s).rotation;
    return camera_pose(state, mount, level_orientation(camera_yaw_rad(wanted)).conjugate() * wanted);
  };
  CameraPathRecorder recorder(pose_of, vehicle);
  TrackingErrorAccumulator tracking(planned, waypoints);
  const double settled_s = vehicle.time_s();
  const auto reference = [&](double time_s) { return make_setpoint(planned, mount, begin_s + time_s); };
  const Outcome outcome = vehicle.run(TrackReference{reference, planned.end_s() - begin_s}, [&](const Vehicle& v) {
    recorder.after_step(v);
    if (clock) clock(recorder.time_s(v));
    tracking.add(camera_position(v.state(), mount), begin_s + recorder.time_s(v));
  });
  return {recorder.finish(vehicle), outcome,
          tracking.result(),        {},
          vehicle.collisions(),     shift_time(vehicle.last_collision(), settled_s)};
}

VehicleFlight fly_mission(const std::vector<MissionStep>& mission, const VehiclePlan& plan,
                          const ObstacleQuery& obstacles, const FlightClock& clock) {
  if (mission.empty()) throw InputError("mission", "has no commands");
  const CameraMount& mount = plan.mount;
  Setpoint start;
  start.yaw_rad = plan.start_yaw_rad;
  start.position_m = plan.start_m - level_orientation(start.yaw_rad) * mount.offset_m;
  start.holds_position = {true, true, true};
  if (clock) clock(0.0);
  Vehicle vehicle(plan.options, obstacles, start.position_m, start.yaw_rad, plan.landed);
  if (!plan.landed) settle(vehicle, start, obstacles);

  const auto pose_of = [&](const RigidBodyState& s, double) {
    return mounted_camera_pose({s.R_local_body, s.position_m}, mount);
  };
  CameraPathRecorder recorder(pose_of, vehicle);
  const double settled_s = vehicle.time_s();
  Outcome outcome = Outcome::kFinished;
  std::vector<MissionResult> results;
  for (const MissionStep& step : mission) {
    const double started_s = recorder.time_s(vehicle);
    const Outcome ended = vehicle.run(step.command, [&](const Vehicle& v) {
      recorder.after_step(v);
      if (clock) clock(recorder.time_s(v));
    });
    results.push_back({step.name, ended, started_s, recorder.time_s(vehicle)});
    if (ended == Outcome::kCollided || outcome == Outcome::kFinished) outcome = ended;
    if (ended == Outcome::kCollided) break;
  }
  return {recorder.finish(vehicle),
          outcome,
          {},
          results,
          vehicle.collisions(),
          shift_time(vehicle.last_collision(), settled_s)};
}

VehicleFlight fly(const FlightPlan& plan, const ObstacleQuery& obstacles, const FlightClock& clock) {
  assert(plan.vehicle);
  if (!plan.mission.empty()) return fly_mission(plan.mission, *plan.vehicle, obstacles, clock);
  return fly_along(flight_path::path_through_waypoints(plan.waypoints, plan.limits), plan.waypoints, plan.limits,
                   *plan.vehicle, obstacles, clock);
}

}  // namespace tileflight::vehicle
