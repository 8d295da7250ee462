#include "tileflight/simulator/sim_vehicle.h"

#include <utility>

#include "tileflight/simulator/frames.h"

namespace tileflight::simulator {
namespace {

using geometry::SE3;
using geometry::Vec3;

vehicle::VehicleOptions make_vehicle_options(const VehicleSettings& settings, const Vec3& wind_local_m_s) {
  vehicle::VehicleOptions options;
  options.collision = settings.enable_collisions ? vehicle::CollisionPolicy::kBounce : vehicle::CollisionPolicy::kOff;
  options.wind.mean_m_s = wind_local_m_s;
  return options;
}

}  // namespace

SimVehicle::SimVehicle(VehicleSettings settings, const SE3& T_local_ned, vehicle::ObstacleQuery obstacles,
                       const Vec3& wind_local_m_s)
    : armed(settings.armed),
      settings_(std::move(settings)),
      T_local_ned_(T_local_ned),
      obstacles_(std::move(obstacles)),
      options_(make_vehicle_options(settings_, wind_local_m_s)) {
  for (const CameraSettings& camera : settings_.cameras) cameras_.emplace_back(camera);
  set_home({settings_.R_ned_body, settings_.start_ned});
}

void SimVehicle::set_home(const SE3& T_ned_body) {
  T_ned_home_ = T_ned_body;
  teleport({T_ned_home_});
}

void SimVehicle::teleport(const VehicleState& state) {
  cancel();
  flight_.reset();
  state_ = state;
}

void SimVehicle::reset() {
  teleport({T_ned_home_});
  collision_ = {};
  api_control = false;
  armed = settings_.armed;
  cameras_.clear();
  for (const CameraSettings& camera : settings_.cameras) cameras_.emplace_back(camera);
}

void SimVehicle::sweep_to(const SE3& T_ned_body, double time_s) {
  const Vec3 from = position_local();
  const Vec3 to = T_local_ned_ * T_ned_body.translation;
  SE3 reached = T_ned_body;
  const auto contact = vehicle::first_contact(obstacles_, from, to, options_.radius_m);
  if (contact) {
    const SE3 T_ned_local = T_local_ned_.inverse();
    reached.translation = T_ned_local * contact->center;
    collision_ = {true,
                  time_s,
                  T_ned_local * contact->point,
                  T_ned_local.rotation * contact->normal,
                  reached.translation,
                  (to - contact->center).norm()};
  }
  teleport({reached});
}

double SimVehicle::yaw_local_rad() const {
  return vehicle::yaw_rad((T_local_ned_ * state_.T_ned_body * T_flu_frd().inverse()).rotation);
}

std::shared_ptr<const vehicle::Task> SimVehicle::command(const vehicle::Command& command) {
  vehicle::check(command);
  if (!flight_) {
    const bool on_ground = vehicle::touches(obstacles_, position_local(), options_.radius_m + 0.02);
    flight_ = std::make_unique<vehicle::Vehicle>(options_, obstacles_, position_local(), yaw_local_rad(), on_ground);
    contact_seen_s_ = 0.0;
  }
  task_ = flight_->command(command);
  return task_;
}

void SimVehicle::cancel() {
  if (flight_) flight_->cancel();
}

bool SimVehicle::landed() const { return flight_ ? flight_->landed() : true; }

vehicle::RotorSpeeds SimVehicle::rotor_speeds_rad_s() const {
  return flight_ ? flight_->rotor_speeds_rad_s() : vehicle::RotorSpeeds(vehicle::RotorSpeeds::Zero());
}

void SimVehicle::set_wind(const Vec3& wind_local_m_s) {
  options_.wind.mean_m_s = wind_local_m_s;
  if (flight_) flight_->set_wind(wind_local_m_s);
}

VehicleState SimVehicle::simulated_state() const {
  const vehicle::RigidBodyState& body = flight_->state();
  const SE3 T_ned_local = T_local_ned_.inverse();
  VehicleState state;
  state.T_ned_body = T_ned_local * SE3(body.R_local_body, body.position_m) * T_flu_frd();
  state.velocity_m_s = T_ned_local.rotation * body.velocity_m_s;
  state.angular_velocity_rad_s = frd_from_flu(body.angular_velocity_rad_s);
  return state;
}

void SimVehicle::step(double time_s) {
  if (!flight_) return;
  const VehicleState before = state_;
  flight_->step();
  state_ = simulated_state();
  state_.acceleration_m_s2 = (state_.velocity_m_s - before.velocity_m_s) / options_.step_s;
  state_.angular_acceleration_rad_s2 =
      (state_.angular_velocity_rad_s - before.angular_velocity_rad_s) / options_.step_s;
  const auto& contact = flight_->last_contact();
  if (contact && contact->time_s > contact_seen_s_) record_contact(*contact, time_s);
}

void SimVehicle::record_contact(const vehicle::Collision& last, double time_s) {
  contact_seen_s_ = last.time_s;
  const SE3 T_ned_local = T_local_ned_.inverse();
  collision_ = {
      true, time_s, T_ned_local * last.point, T_ned_local.rotation * last.normal, state_.T_ned_body.translation, 0.0};
}

}  // namespace tileflight::simulator
