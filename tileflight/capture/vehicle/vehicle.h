#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>

#include "tileflight/capture/vehicle/collision.h"
#include "tileflight/capture/vehicle/guidance.h"
#include "tileflight/capture/vehicle/wind.h"

namespace tileflight::vehicle {

/// Reaction to obstacles.
enum class CollisionPolicy {
  kOff,     ///< obstacles are ignored
  kStop,    ///< stops where it touched an obstacle; a slow landing on level ground is no collision
  kBounce,  ///< bounces and flies on
};

/// Parameters of a vehicle and its simulation.
struct VehicleOptions {
  MultirotorOptions quadrotor;
  ControllerOptions controller;
  WindOptions wind;
  CollisionPolicy collision = CollisionPolicy::kStop;
  BounceOptions bounce;
  double radius_m = 0.35;  ///< radius of the collision sphere: arms and propellers of the default vehicle
  double step_s = 0.003;   ///< of physics and control; AirSim's
};

/// State of a task: running, or how it ended.
enum class Outcome { kRunning, kFinished, kTimedOut, kCancelled, kCollided };

/// A command and its state. The outcome stays available after later commands.
struct Task {
  Outcome outcome = Outcome::kRunning;
  double started_s = 0.0;
  double ended_s = 0.0;  ///< set once it has ended
};

/// A collision of the vehicle with a surface.
struct Collision {
  double time_s = 0.0;
  geometry::Vec3 point;   ///< on the surface
  geometry::Vec3 normal;  ///< unit length, towards the vehicle
  double impact_m_s = 0.0;
  std::string object{};  ///< SurfaceHit::object
};

/// A quadrotor under command, in wind and among obstacles, with its own clock. It moves only in step(); the same
/// commands at the same steps give bit-identical flights. There is one task at a time: a new command cancels the
/// running one, and after a task the vehicle holds its position.
class Vehicle {
 public:
  /// Starts hovering at the position, or on the ground with its rotors off. Throws InputError for options with which it
  /// cannot fly.
  Vehicle(const VehicleOptions& options, ObstacleQuery obstacles, const geometry::Vec3& position_m, double yaw_rad,
          bool landed = false);

  /// Starts a command. Throws InputError for a command that cannot be flown.
  std::shared_ptr<const Task> command(const Command& command);
  /// Cancels the running task, if any; the vehicle then stops and hovers.
  void cancel();
  /// Sets the mean wind. Throws InputError if it is not finite.
  void set_wind(const geometry::Vec3& mean_m_s);
  /// Advances by `options.step_s`.
  void step();
  /// Starts a command and steps until it has ended; calls `after_step` after each step.
  Outcome run(const Command& command, const std::function<void(const Vehicle&)>& after_step = {});

  double time_s() const { return static_cast<double>(steps_) * options_.step_s; }
  const RigidBodyState& state() const { return state_.body; }
  const RotorSpeeds& rotor_speeds_rad_s() const { return state_.rotor_speeds_rad_s; }
  geometry::Vec3 wind_m_s() const { return wind_.velocity_m_s(); }
  bool landed() const { return landed_; }
  const std::optional<Collision>& last_collision() const { return last_collision_; }
  std::int64_t collisions() const { return collisions_; }
  /// The latest contact: a collision, or one that lasts or slides where each touch alone would be soft. A vehicle that
  /// sets down or takes off makes none.
  const std::optional<Collision>& last_contact() const { return last_contact_; }
  const VehicleOptions& options() const { return options_; }

 private:
  GuidanceInput guidance_input() const;
  void step_flight();
  void handle_collision(const geometry::Vec3& from);
  bool lasts_or_slides(const Contact& contact) const;
  void come_to_rest();
  void end_task(Outcome outcome);
  void finish_guidance(const GuidanceOutput& guided);

  VehicleOptions options_;
  ObstacleQuery obstacles_;
  QuadrotorController controller_;
  Wind wind_;
  QuadrotorState state_;
  Setpoint setpoint_;
  GuidanceLaw guidance_;
  std::shared_ptr<Task> task_;
  double timeout_s_ = kNoTimeout_s;
  bool lands_ = false;  ///< the task is a landing
  std::int64_t steps_ = 0;
  bool touching_ = false;
  bool landed_ = false;
  bool crashed_ = false;
  std::optional<Collision> last_collision_, last_contact_;
  std::int64_t collisions_ = 0;
};

}  // namespace tileflight::vehicle
