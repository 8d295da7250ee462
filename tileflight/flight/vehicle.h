#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>

#include "tileflight/flight/collision.h"
#include "tileflight/flight/guidance.h"
#include "tileflight/flight/wind.h"

namespace tileflight::flight {

enum class CollisionPolicy {
  kOff,     ///< flies through everything
  kStop,    ///< stays where it touched; only setting down slowly on level ground is none
  kBounce,  ///< and flies on
};

struct VehicleOptions {
  QuadrotorOptions craft;
  ControllerOptions controller;
  WindOptions wind;
  CollisionPolicy collision = CollisionPolicy::kStop;
  BounceOptions bounce;
  double radius_m = 0.35;  ///< of the ball that collides: the arms and the propellers of the default craft
  double step_s = 0.003;   ///< of physics and control; AirSim's
};

enum class Outcome { kRunning, kFinished, kTimedOut, kCancelled, kCollided };

/// A command that was given. Its outcome stays when others have been given since.
struct Task {
  Outcome outcome = Outcome::kRunning;
  double started_s = 0.0;
  double ended_s = 0.0;  ///< once it does not run any more
};

struct Collision {
  double time_s = 0.0;
  geometry::Vec3 point;   ///< of the surface
  geometry::Vec3 normal;  ///< unit, to the craft
  double impact_m_s = 0.0;
};

/// A quadrotor in wind and among obstacles, under command, on a clock of its own: nothing moves but in step(), and the
/// same commands at the same steps give the same flight to the last bit. One task at a time: a new command cancels the
/// one that runs; after the end of a task it holds its place.
class Vehicle {
 public:
  /// Hovers at the place, or stands there with its rotors off. Throws InputError for options that cannot fly.
  Vehicle(const VehicleOptions& options, Obstacles obstacles, const geometry::Vec3& position_m, double yaw_rad,
          bool landed = false);

  /// Throws InputError for a command that cannot be flown.
  std::shared_ptr<const Task> command(const Command& command);
  /// The running task, if any; it then stops and holds.
  void cancel();
  /// The mean wind from now on. Throws InputError where it is not finite.
  void set_wind(const geometry::Vec3& mean_m_s);
  /// `options.step_s` further.
  void step();
  /// Gives a command and steps until it has ended; `after_step` is told each step.
  Outcome run(const Command& command, const std::function<void(const Vehicle&)>& after_step = {});

  double time_s() const { return static_cast<double>(steps_) * options_.step_s; }
  const RigidBodyState& state() const { return state_.body; }
  const RotorSpeeds& rotor_speeds_rad_s() const { return state_.rotor_speeds_rad_s; }
  geometry::Vec3 wind_m_s() const { return wind_.velocity_m_s(); }
  /// What it is asked to do in this step.
  const Setpoint& setpoint() const { return setpoint_; }
  bool landed() const { return landed_; }
  bool stopped_by_collision() const { return crashed_; }
  const std::optional<Collision>& last_collision() const { return last_collision_; }
  std::int64_t collisions() const { return collisions_; }
  const VehicleOptions& options() const { return options_; }

 private:
  Moment moment() const;
  void fly();
  void collide(const geometry::Vec3& from);
  void note(const Contact& contact, double impact_m_s);
  void come_to_rest();
  void end_task(Outcome outcome);
  void end_guided(const Guided& guided);

  VehicleOptions options_;
  Obstacles obstacles_;
  QuadrotorController controller_;
  Wind wind_;
  QuadrotorState state_;
  Setpoint setpoint_;
  Guide guide_;
  std::shared_ptr<Task> task_;
  double timeout_s_ = kNoTimeout_s;
  bool lands_ = false;  ///< the task is to land
  std::int64_t steps_ = 0;
  bool touching_ = false;
  bool landed_ = false;
  bool crashed_ = false;
  std::optional<Collision> last_collision_;
  std::int64_t collisions_ = 0;
};

}  // namespace tileflight::flight
