#include "tileflight/capture/vehicle/vehicle.h"

#include <cmath>

#include "tileflight/core/base/input_error.h"

namespace tileflight::vehicle {
namespace {

using geometry::Vec3;

/// Landing: at most this speed, on slopes of at most 45 degrees.
constexpr double kMaxLandingSpeed_m_s = 1.5;
constexpr double kMinLandingNormalZ = 0.7;

/// Contacts no farther apart are one that lasts: a vehicle that slides bounces a little.
constexpr double kSameContact_s = 0.1;
/// Along the surface; a vehicle that takes off or lands is slower.
constexpr double kSliding_m_s = 0.5;

bool is_setting_down(const Contact& contact, double impact_m_s) {
  return impact_m_s <= kMaxLandingSpeed_m_s && contact.normal.z() >= kMinLandingNormalZ;
}

void check(const VehicleOptions& options) {
  check(options.quadrotor);
  check(options.controller);
  const auto positive = [](double value) { return std::isfinite(value) && value > 0.0; };
  if (!positive(options.radius_m)) throw InputError("vehicle", "the radius must be more than 0");
  if (!positive(options.step_s) || options.step_s > 0.01)
    throw InputError("vehicle", "the step must be more than 0 and at most 0.01 s");
  if (!options.wind.mean_m_s.allFinite()) throw InputError("vehicle", "the wind must be finite");
  const BounceOptions& bounce = options.bounce;
  if (!(bounce.restitution >= 0.0 && bounce.restitution <= 1.0))
    throw InputError("vehicle", "the restitution must be from 0 to 1");
  if (!(bounce.friction >= 0.0)) throw InputError("vehicle", "the friction must not be negative");
}

VehicleOptions checked(const VehicleOptions& options) {
  check(options);
  return options;
}

}  // namespace

Vehicle::Vehicle(const VehicleOptions& options, ObstacleQuery obstacles, const Vec3& position_m, double yaw_rad,
                 bool landed)
    : options_(checked(options)),
      obstacles_(std::move(obstacles)),
      controller_(options.quadrotor, options.controller),
      wind_(options.wind),
      landed_(landed) {
  if (!position_m.allFinite() || !std::isfinite(yaw_rad)) throw InputError("vehicle", "its start is not finite");
  state_.body.position_m = position_m;
  state_.body.R_local_body = level_orientation(yaw_rad);
  if (!landed) state_.rotor_speeds_rad_s.setConstant(hover_rotor_speed_rad_s(options.quadrotor));
  setpoint_.yaw_rad = yaw_rad;
  guidance_ = make_stop_guidance(position_m, guidance_input());
}

GuidanceInput Vehicle::guidance_input() const {
  return {state_.body, task_ ? time_s() - task_->started_s : 0.0, options_.step_s, setpoint_.yaw_rad, touching_};
}

std::shared_ptr<const Task> Vehicle::command(const Command& command) {
  check(command);
  end_task(Outcome::kCancelled);
  const auto task = std::make_shared<Task>();
  task->started_s = task->ended_s = time_s();
  lands_ = std::holds_alternative<Land>(command);
  if (crashed_ || (landed_ && lands_)) {
    task->outcome = crashed_ ? Outcome::kCollided : Outcome::kFinished;
    return task;
  }
  landed_ = false;
  task_ = task;
  timeout_s_ = timeout_s(command);
  guidance_ = make_guidance(command, guidance_input(), options_.controller);
  return task;
}

void Vehicle::set_wind(const Vec3& mean_m_s) {
  if (!mean_m_s.allFinite()) throw InputError("vehicle", "the wind must be finite");
  options_.wind.mean_m_s = mean_m_s;
  wind_.set_mean(mean_m_s);
}

void Vehicle::cancel() {
  if (!task_) return;
  end_task(Outcome::kCancelled);
  guidance_ = make_stop_guidance({}, guidance_input());
}

void Vehicle::end_task(Outcome outcome) {
  if (!task_) return;
  task_->outcome = outcome;
  task_->ended_s = time_s();
  task_.reset();
}

void Vehicle::finish_guidance(const GuidanceOutput& guided) {
  if (guided.finished && lands_) {
    landed_ = true;
    come_to_rest();
  }
  setpoint_.yaw_rad = guided.setpoint.yaw_rad;
  end_task(guided.finished ? Outcome::kFinished : Outcome::kTimedOut);
  guidance_ = make_stop_guidance(guided.finished ? guided.hold_position : std::nullopt, guidance_input());
}

void Vehicle::step() {
  wind_.advance(options_.step_s, state_.body.velocity_m_s);
  if (!landed_ && !crashed_) step_flight();
  ++steps_;
}

/// The guidance law is called once per step, and again only when a finished task is replaced.
void Vehicle::step_flight() {
  GuidanceInput now = guidance_input();
  GuidanceOutput guided = guidance_(now);
  if (task_ && (guided.finished || now.time_s >= timeout_s_)) {
    finish_guidance(guided);
    if (landed_) return;
    now = guidance_input();
    guided = guidance_(now);
  }
  setpoint_ = guided.setpoint;
  const Vec3 from = state_.body.position_m;
  const RotorSpeeds commanded = controller_.rotor_speeds_rad_s(state_.body, setpoint_, options_.step_s);
  state_ = integrate(options_.quadrotor, state_, commanded, wind_.velocity_m_s(), options_.step_s);
  touching_ = false;
  if (obstacles_ && options_.collision != CollisionPolicy::kOff) handle_collision(from);
}

void Vehicle::handle_collision(const Vec3& from) {
  const auto contact = first_contact(obstacles_, from, state_.body.position_m, options_.radius_m);
  if (!contact) return;
  const double impact_m_s = -contact->normal.dot(state_.body.velocity_m_s);
  state_.body.position_m = contact->center;
  touching_ = true;
  const bool setting_down = is_setting_down(*contact, impact_m_s);
  if (!setting_down || lasts_or_slides(*contact))
    last_contact_ = Collision{time_s() + options_.step_s, contact->point, contact->normal, impact_m_s, contact->object};
  if (!setting_down) {
    last_collision_ = last_contact_;
    ++collisions_;
  }
  if (options_.collision == CollisionPolicy::kStop && !setting_down) {
    crashed_ = true;
    come_to_rest();
    end_task(Outcome::kCollided);
    return;
  }
  state_.body.velocity_m_s = bounce_velocity(state_.body.velocity_m_s, contact->normal, options_.bounce);
}

bool Vehicle::lasts_or_slides(const Contact& contact) const {
  const Vec3& velocity = state_.body.velocity_m_s;
  const Vec3 along = velocity - contact.normal.dot(velocity) * contact.normal;
  return along.norm() >= kSliding_m_s || (last_contact_ && time_s() - last_contact_->time_s <= kSameContact_s);
}

void Vehicle::come_to_rest() {
  state_.body.velocity_m_s.setZero();
  state_.body.angular_velocity_rad_s.setZero();
  state_.rotor_speeds_rad_s.setZero();
  controller_.reset();
}

Outcome Vehicle::run(const Command& wanted, const std::function<void(const Vehicle&)>& after_step) {
  const std::shared_ptr<const Task> task = command(wanted);
  while (task->outcome == Outcome::kRunning) {
    step();
    if (after_step) after_step(*this);
  }
  return task->outcome;
}

}  // namespace tileflight::vehicle
