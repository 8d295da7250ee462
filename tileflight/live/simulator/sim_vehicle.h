#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tileflight/capture/vehicle/multirotor.h"
#include "tileflight/capture/vehicle/vehicle.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/live/simulator/settings.h"

namespace tileflight::simulator {

/// A camera with the changes made by clients. Not thread-safe: part of the simulator's state.
class SimCamera {
 public:
  explicit SimCamera(CameraSettings settings) : settings_(std::move(settings)) {}

  const std::string& name() const { return settings_.name; }
  /// Camera axes forward, right, down, relative to the vehicle's body; for external cameras to global NED.
  const geometry::SE3& T_body_camera() const { return settings_.T_body_camera; }
  void set_pose(const geometry::SE3& T_body_camera) { settings_.T_body_camera = T_body_camera; }

  /// Sets the field of view of all image types, degrees; replaces another lens. Throws InputError outside 0.1 to 179.9.
  void set_fov(double fov_deg);
  double fov_deg() const { return settings_.captures[0].fov_deg; }
  /// Sets one of Brown's coefficients K1, K2, K3, P1, P2 of pinhole lenses. Throws InputError for another name, or a
  /// value that is not finite.
  void set_distortion(const std::string& name, double value);
  const std::array<double, 5>& distortion() const { return distortion_; }
  /// Sets the lens of all image types. Throws InputError for an invalid lens.
  void set_lens(const LensDescription& lens);

  int width(int image_type) const { return capture(image_type).width; }
  int height(int image_type) const { return capture(image_type).height; }
  imaging::Camera lens(int image_type) const;
  /// Returns the focal length of the Scene image at its middle, pixels.
  double focal_px() const;
  /// Returns the vertical field of view of the Scene image along its middle column, degrees.
  double vertical_fov_deg() const;
  CameraInfo info(const geometry::SE3& T_ned_camera) const;
  /// Returns the highest angular resolution of any of its images.
  double pixels_per_rad() const;

 private:
  const CaptureSettings& capture(int image_type) const {
    return settings_.captures[static_cast<std::size_t>(image_type)];
  }

  CameraSettings settings_;
  std::array<double, 5> distortion_{};
  mutable double pixels_per_rad_ = 0.0;  ///< 0: not computed yet
};

/// Pose and velocities of a vehicle, global NED.
struct VehicleState {
  geometry::SE3 T_ned_body;  ///< body x forward, y right, z down
  geometry::Vec3 velocity_m_s = geometry::Vec3::Zero();
  geometry::Vec3 angular_velocity_rad_s = geometry::Vec3::Zero();  ///< body axes
  geometry::Vec3 acceleration_m_s2 = geometry::Vec3::Zero();       ///< without gravity
  geometry::Vec3 angular_acceleration_rad_s2 = geometry::Vec3::Zero();
};

/// The latest collision of a vehicle; a contact that lasts is one at each step, as AirSim reports it.
struct VehicleCollision {
  bool unread = false;  ///< not read by a client since
  double time_s = 0.0;  ///< simulation time
  geometry::Vec3 point_ned = geometry::Vec3::Zero();
  geometry::Vec3 normal_ned = geometry::Vec3::Zero();
  geometry::Vec3 position_ned = geometry::Vec3::Zero();
  double depth_m = 0.0;
  std::string object{};  ///< name of the object that was hit; empty: the place
};

/// A simulated vehicle: flown by vehicle::Vehicle after the first command, or by an autopilot that drives its motors,
/// or kept where it is placed. Not thread-safe: part of the simulator's state.
class SimVehicle {
 public:
  /// `T_local_ned`: pose of NED in the scene. `obstacles`: of the scene, in its local frame.
  SimVehicle(VehicleSettings settings, const geometry::SE3& T_local_ned, vehicle::ObstacleQuery obstacles,
             const geometry::Vec3& wind_local_m_s);

  const VehicleSettings& settings() const { return settings_; }
  const std::string& name() const { return settings_.name; }
  /// Origin of the vehicle's local NED, in global NED.
  const geometry::Vec3& start_ned() const { return settings_.start_ned; }
  /// Start pose, global NED; for flying vehicles above `start_ned` or on the ground there.
  void set_home(const geometry::SE3& T_ned_body);
  const geometry::SE3& home() const { return T_ned_home_; }
  /// Lets a vehicle with an autopilot settle on the ground below its home, which moves there. Requires the obstacles.
  void settle_at_home();
  bool has_autopilot() const { return settings_.autopilot.has_value(); }
  /// Radius of the collision sphere, metres.
  double radius_m() const { return options_.radius_m; }

  const VehicleState& state() const { return state_; }
  /// Places the vehicle at rest. It stays there until the next command.
  void teleport(const VehicleState& state);
  /// Moves the vehicle towards a pose until it meets an obstacle.
  void sweep_to(const geometry::SE3& T_ned_body, double time_s);

  /// Starts a command. Throws InputError for a command that cannot be flown.
  std::shared_ptr<const vehicle::Task> command(const vehicle::Command& command);
  void cancel();
  bool busy() const { return task_ && task_->outcome == vehicle::Outcome::kRunning; }
  /// Returns whether the vehicle is on the ground with its rotors off.
  bool landed() const;
  /// Returns whether physics moves the vehicle; otherwise it stays where it was placed.
  bool is_flying() const { return flight_ || multirotor_; }
  double yaw_local_rad() const;  ///< counter-clockwise from east
  geometry::Vec3 position_local() const { return T_local_ned_ * state_.T_ned_body.translation; }
  const vehicle::VehicleOptions& options() const { return options_; }
  std::vector<vehicle::Rotor> rotors() const;
  /// Returns the speed of each rotor; zero if the vehicle does not fly.
  std::vector<double> rotor_speeds_rad_s() const;
  /// Returns the air's velocity at the vehicle, global NED.
  geometry::Vec3 wind_ned_m_s() const;
  /// Sets the mean wind, also in flight.
  void set_wind(const geometry::Vec3& wind_local_m_s);

  /// Makes one physics step; `time_s`: simulation time after it. A vehicle with an autopilot does not move.
  void step(double time_s);
  /// Makes one physics step of a vehicle with an autopilot. `outputs`: commands of the motors, 0 to 1.
  void step_motors(std::span<const double> outputs, double step_s, double time_s);
  /// Returns to the start pose, at rest.
  void return_to_start();
  /// Returns to the start pose, without API control, armed and with the cameras as in the settings.
  void reset();

  VehicleCollision& collision() { return collision_; }
  const VehicleCollision& collision() const { return collision_; }
  std::vector<SimCamera>& cameras() { return cameras_; }
  const std::vector<SimCamera>& cameras() const { return cameras_; }

  bool api_control = false;
  bool armed = false;

 private:
  VehicleState simulated_state(const vehicle::RigidBodyState& body) const;
  void record_contact(const vehicle::Collision& last, double time_s);
  void record_impact(double time_s);
  void place_multirotor();

  VehicleSettings settings_;
  geometry::SE3 T_local_ned_;
  vehicle::ObstacleQuery obstacles_;
  vehicle::VehicleOptions options_;
  geometry::SE3 T_ned_home_;
  VehicleState state_;
  std::unique_ptr<vehicle::Vehicle> flight_;         ///< null: it stays where it was placed
  std::unique_ptr<vehicle::Multirotor> multirotor_;  ///< of a vehicle with an autopilot, once settled
  double contact_seen_s_ = 0.0;                      ///< of the flight's clock
  std::shared_ptr<const vehicle::Task> task_;
  VehicleCollision collision_;
  std::vector<SimCamera> cameras_;
};

}  // namespace tileflight::simulator
