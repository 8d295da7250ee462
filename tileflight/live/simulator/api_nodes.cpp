#include <cmath>

#include "tileflight/core/base/input_error.h"
#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/simulator_impl.h"

namespace tileflight::simulator {
namespace {

constexpr double kMaxNodeSpeed_m_s = 1000.0, kMaxTurn_rad_s = 100.0, kGoalSpeed_m_s = 5.0;
constexpr double kMaxGoalDistance_m = 1e6;

/// Yaw of a pose in the local frame, counter-clockwise from east.
double goal_yaw_rad(const geometry::SE3& T_local_body) {
  const geometry::Vec3 forward = T_local_body.rotation * geometry::Vec3::UnitX();
  return std::atan2(forward.y(), forward.x());
}

/// Lets a vehicle that flies begin with a command.
void begin_command(Simulator::Impl& impl, SimVehicle& sim_vehicle, const vehicle::Command& command) {
  if (impl.clock.stopped()) return;
  if (sim_vehicle.has_autopilot()) throw InputError(sim_vehicle.name(), "is flown by its autopilot");
  if (!sim_vehicle.settings().flies)
    throw InputError(sim_vehicle.name(), "is a camera by itself, which has no velocity");
  sim_vehicle.api_control = true;
  sim_vehicle.armed = true;
  sim_vehicle.command(command);
  impl.clock.wake();
}

}  // namespace

void Simulator::start_velocity(const geometry::Vec3& velocity_m_s, double yaw_rate_rad_s, double duration_s,
                               const std::string& vehicle) {
  if (!(velocity_m_s.norm() <= kMaxNodeSpeed_m_s)) throw InputError(vehicle, "a velocity of more than 1000 m/s");
  if (!(std::abs(yaw_rate_rad_s) <= kMaxTurn_rad_s)) throw InputError(vehicle, "a turn of more than 100 rad/s");
  vehicle::FlyVelocity command;
  command.velocity_m_s = velocity_m_s;
  command.duration_s = duration_s;
  command.frame = vehicle::VelocityFrame::kHeading;
  if (yaw_rate_rad_s != 0.0) command.yaw = {vehicle::YawMode::Kind::kRate, yaw_rate_rad_s};
  const std::lock_guard lock(impl_->state_mutex);
  begin_command(*impl_, *impl_->slot(vehicle).vehicle, command);
}

void Simulator::start_pose(const geometry::SE3& T_local_body, const std::string& vehicle) {
  if (!(T_local_body.translation.norm() <= kMaxGoalDistance_m))
    throw InputError(vehicle, "a goal more than 1000 km away");
  const std::lock_guard lock(impl_->state_mutex);
  SimVehicle& sim_vehicle = *impl_->slot(vehicle).vehicle;
  if (sim_vehicle.settings().flies) {
    vehicle::FollowPath path;
    path.points = {T_local_body.translation};
    path.speed_m_s = kGoalSpeed_m_s;
    path.turns_first = true;
    path.yaw = {vehicle::YawMode::Kind::kAngle, goal_yaw_rad(T_local_body)};
    return begin_command(*impl_, sim_vehicle, path);
  }
  VehicleState state;
  state.T_ned_body = impl_->T_local_ned.inverse() * T_local_body * T_flu_frd();
  sim_vehicle.teleport(state);
  impl_->clock.wake();
}

}  // namespace tileflight::simulator
