#include "tileflight/simulator/craft.h"

#include <utility>

#include "tileflight/simulator/frames.h"

namespace tileflight::simulator {
namespace {

using geometry::SE3;
using geometry::Vec3;

flight::VehicleOptions options_of(const VehicleSettings& settings, const Vec3& wind_local_m_s) {
  flight::VehicleOptions options;
  options.collision = settings.collides ? flight::CollisionPolicy::kBounce : flight::CollisionPolicy::kOff;
  options.wind.mean_m_s = wind_local_m_s;
  return options;
}

}  // namespace

Craft::Craft(VehicleSettings settings, const SE3& T_local_ned, flight::Obstacles obstacles, const Vec3& wind_local_m_s)
    : armed(settings.armed),
      settings_(std::move(settings)),
      T_local_ned_(T_local_ned),
      obstacles_(std::move(obstacles)),
      options_(options_of(settings_, wind_local_m_s)) {
  for (const CameraSettings& camera : settings_.cameras) cameras_.emplace_back(camera);
  set_home({settings_.R_ned_body, settings_.start_ned});
}

void Craft::set_home(const SE3& T_ned_body) {
  T_ned_home_ = T_ned_body;
  place({T_ned_home_});
}

void Craft::place(const CraftState& state) {
  cancel();
  flight_.reset();
  state_ = state;
}

void Craft::reset() {
  place({T_ned_home_});
  collision_ = {};
  api_control = false;
  armed = settings_.armed;
  cameras_.clear();
  for (const CameraSettings& camera : settings_.cameras) cameras_.emplace_back(camera);
}

void Craft::sweep_to(const SE3& T_ned_body, double time_s) {
  const Vec3 from = position_local();
  const Vec3 to = T_local_ned_ * T_ned_body.translation;
  SE3 reached = T_ned_body;
  const auto contact = flight::first_contact(obstacles_, from, to, options_.radius_m);
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
  place({reached});
}

double Craft::yaw_local_rad() const {
  return flight::yaw_rad((T_local_ned_ * state_.T_ned_body * T_flu_frd().inverse()).rotation);
}

std::shared_ptr<const flight::Task> Craft::command(const flight::Command& command) {
  flight::check(command);
  if (!flight_) {
    const bool on_ground = flight::touches(obstacles_, position_local(), options_.radius_m + 0.02);
    flight_ = std::make_unique<flight::Vehicle>(options_, obstacles_, position_local(), yaw_local_rad(), on_ground);
    collisions_seen_ = 0;
  }
  task_ = flight_->command(command);
  return task_;
}

void Craft::cancel() {
  if (flight_) flight_->cancel();
}

bool Craft::landed() const { return flight_ ? flight_->landed() : true; }

flight::RotorSpeeds Craft::rotor_speeds_rad_s() const {
  return flight_ ? flight_->rotor_speeds_rad_s() : flight::RotorSpeeds(flight::RotorSpeeds::Zero());
}

void Craft::set_wind(const Vec3& wind_local_m_s) {
  options_.wind.mean_m_s = wind_local_m_s;
  if (flight_) flight_->set_wind(wind_local_m_s);
}

CraftState Craft::state_of_flight() const {
  const flight::RigidBodyState& body = flight_->state();
  const SE3 T_ned_local = T_local_ned_.inverse();
  CraftState state;
  state.T_ned_body = T_ned_local * SE3(body.R_local_body, body.position_m) * T_flu_frd();
  state.velocity_m_s = T_ned_local.rotation * body.velocity_m_s;
  state.angular_velocity_rad_s = frd_of_flu(body.angular_velocity_rad_s);
  return state;
}

void Craft::step(double time_s) {
  if (!flight_) return;
  const CraftState before = state_;
  flight_->step();
  state_ = state_of_flight();
  state_.acceleration_m_s2 = (state_.velocity_m_s - before.velocity_m_s) / options_.step_s;
  state_.angular_acceleration_rad_s2 =
      (state_.angular_velocity_rad_s - before.angular_velocity_rad_s) / options_.step_s;
  if (flight_->collisions() > collisions_seen_) note_collision(time_s);
}

void Craft::note_collision(double time_s) {
  collisions_seen_ = flight_->collisions();
  const flight::Collision& last = *flight_->last_collision();
  const SE3 T_ned_local = T_local_ned_.inverse();
  collision_ = {
      true, time_s, T_ned_local * last.point, T_ned_local.rotation * last.normal, state_.T_ned_body.translation, 0.0};
}

}  // namespace tileflight::simulator
