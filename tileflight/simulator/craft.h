#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/flight/vehicle.h"
#include "tileflight/simulator/settings.h"
#include "tileflight/simulator/sim_camera.h"

namespace tileflight::simulator {

/// How a vehicle moves, global NED.
struct CraftState {
  geometry::SE3 T_ned_body;  ///< body x forward, y right, z down
  geometry::Vec3 velocity_m_s = geometry::Vec3::Zero();
  geometry::Vec3 angular_velocity_rad_s = geometry::Vec3::Zero();  ///< body axes
  geometry::Vec3 acceleration_m_s2 = geometry::Vec3::Zero();       ///< without gravity
  geometry::Vec3 angular_acceleration_rad_s2 = geometry::Vec3::Zero();
};

/// What it ran into last.
struct CraftCollision {
  bool unread = false;  ///< nobody has asked since
  double time_s = 0.0;  ///< of the simulation
  geometry::Vec3 point_ned = geometry::Vec3::Zero();
  geometry::Vec3 normal_ned = geometry::Vec3::Zero();
  geometry::Vec3 position_ned = geometry::Vec3::Zero();
  double depth_m = 0.0;
};

/// A vehicle: one that flies by flight::Vehicle once a command has been given, or one that is where it is put. Not
/// thread-safe: the simulator's state.
class Craft {
 public:
  /// `T_local_ned`: where NED lies in the scene. `obstacles`: of the scene, in its local frame.
  Craft(VehicleSettings settings, const geometry::SE3& T_local_ned, flight::Obstacles obstacles,
        const geometry::Vec3& wind_local_m_s);

  const VehicleSettings& settings() const { return settings_; }
  const std::string& name() const { return settings_.name; }
  /// Where local NED of this vehicle has its origin, global NED.
  const geometry::Vec3& start_ned() const { return settings_.start_ned; }
  /// Where it stands at the start, global NED; of one that flies above `start_ned` or the ground there.
  void set_home(const geometry::SE3& T_ned_body);
  const geometry::SE3& home() const { return T_ned_home_; }
  /// The radius of the ball that collides, metres.
  double radius_m() const { return options_.radius_m; }

  const CraftState& state() const { return state_; }
  /// Puts it there, at rest. It stays until the next command, whatever it did before.
  void place(const CraftState& state);
  /// Moves it towards a place as far as nothing is in the way.
  void sweep_to(const geometry::SE3& T_ned_body, double time_s);

  /// Throws InputError for a command that cannot be flown.
  std::shared_ptr<const flight::Task> command(const flight::Command& command);
  void cancel();
  bool busy() const { return task_ && task_->outcome == flight::Outcome::kRunning; }
  /// On the ground with its rotors off.
  bool landed() const;
  /// Moved by physics; else it is where it was put.
  bool flying() const { return flight_ != nullptr; }
  double yaw_local_rad() const;  ///< counter-clockwise from east
  geometry::Vec3 position_local() const { return T_local_ned_ * state_.T_ned_body.translation; }
  const flight::VehicleOptions& options() const { return options_; }
  /// Zero where it does not fly.
  flight::RotorSpeeds rotor_speeds_rad_s() const;
  /// From now on, also in the air.
  void set_wind(const geometry::Vec3& wind_local_m_s);

  /// One step of physics; `time_s`: of the simulation after it.
  void step(double time_s);
  /// Back to the start, disarmed, without API control.
  void reset();

  CraftCollision& collision() { return collision_; }
  const CraftCollision& collision() const { return collision_; }
  std::vector<SimCamera>& cameras() { return cameras_; }
  const std::vector<SimCamera>& cameras() const { return cameras_; }

  bool api_control = false;
  bool armed = false;

 private:
  CraftState state_of_flight() const;
  void note_collision(double time_s);

  VehicleSettings settings_;
  geometry::SE3 T_local_ned_;
  flight::Obstacles obstacles_;
  flight::VehicleOptions options_;
  geometry::SE3 T_ned_home_;
  CraftState state_;
  std::unique_ptr<flight::Vehicle> flight_;  ///< none: it stands where it was put
  std::int64_t collisions_seen_ = 0;
  std::shared_ptr<const flight::Task> task_;
  CraftCollision collision_;
  std::vector<SimCamera> cameras_;
};

}  // namespace tileflight::simulator
