#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/live/autopilot/ardupilot_packet.h"
#include "tileflight/live/autopilot/mavlink.h"
#include "tileflight/live/simulator/sensor_readings.h"
#include "tileflight/live/simulator/simulator_options.h"

namespace tileflight::simulator {

/// Reads inertial unit, magnetometer and barometer: the vehicle's first sensors of these kinds, or AirSim's defaults.
/// `slow`: includes new readings of magnetometer and barometer.
autopilot::HilSensor hil_sensor(const SensorContext& now, SensorNoises& noises, std::uint64_t time_us, bool slow);

/// Reads the vehicle's first satellite receiver; nullopt until it has started, or without one.
std::optional<autopilot::HilGps> hil_gps(const SensorContext& now, SensorNoises& noises, std::uint64_t time_us);

/// Reads one distance sensor. `distance_m`: distance to the nearest surface along its axis. `id`: number of the sensor
/// on the vehicle.
autopilot::DistanceSensor hil_distance(const SensorContext& now, SensorNoises& noises, const SensorSettings& sensor,
                                       double distance_m, std::uint8_t id, std::uint64_t time_us);

/// Image motion and turning of a camera at the vehicle's centre that looks along its z axis, summed up step by step.
struct FlowIntegral {
  Eigen::Vector2d flow_rad = Eigen::Vector2d::Zero();
  geometry::Vec3 gyro_rad = geometry::Vec3::Zero();
  double duration_s = 0.0;
  bool sees_surface = true;  ///< at each step

  /// Adds a step. `distance_m`: distance along the axis to the surface; nullopt: none is in sight.
  void add(const VehicleState& state, std::optional<double> distance_m, double step_s);
};

/// Adds white noise of 0.02 rad/s to an optical flow. The quality is 0 where no surface was in sight.
autopilot::HilOpticalFlow hil_flow(const SensorContext& now, SensorNoises& noises, const FlowIntegral& flow,
                                   std::optional<double> distance_m, std::uint64_t time_us);

/// Makes a substitute for odometry: the true pose relative to the start and the true velocity, with white noise (5 cm,
/// 0.01 rad, 5 cm/s) and matching covariances.
autopilot::Odometry hil_odometry(const SensorContext& now, SensorNoises& noises, std::uint64_t time_us);

/// Converts the true state to its message.
autopilot::HilStateQuaternion hil_state(const SensorContext& now, std::uint64_t time_us);

/// Other vehicles stop waiting for an autopilot that has been silent for this long.
inline constexpr std::chrono::milliseconds kAutopilotSilence{5000};
/// Interval at which a thread that waits for an autopilot checks for a stop request.
inline constexpr std::chrono::milliseconds kAutopilotPoll{100};

/// Length of PX4's steps, and the time stamp of the sensors sent for a step.
inline constexpr std::int64_t kPx4Step_us = 4000;
inline constexpr double kPx4Step_s = 1e-6 * kPx4Step_us;
constexpr std::uint64_t px4_stamp_us(std::uint64_t step) { return 1'000'000 + step * kPx4Step_us; }

struct PlannedImages;
struct VehicleSlot;
struct World;

/// Simulation time that each connected autopilot has reached. The clock follows the earliest.
/// Guarded by the simulator's mutex.
class LockstepTimes {
 public:
  void set(const VehicleSlot* vehicle, double time_s) { times_s_[vehicle] = time_s; }
  void remove(const VehicleSlot* vehicle) { times_s_.erase(vehicle); }
  bool contains(const VehicleSlot* vehicle) const { return times_s_.contains(vehicle); }
  /// Returns the earliest time; infinity if no autopilot is connected.
  double least_s() const;

 private:
  std::map<const VehicleSlot*, double> times_s_;
};

/// A vehicle in lockstep with its autopilot: the autopilot's steps advance the vehicle, and the simulation's clock
/// follows them. No such vehicle is ahead of another by more than a step. For one thread.
class LockstepVehicle {
 public:
  LockstepVehicle(World& world, VehicleSlot& vehicle) : world_(world), slot_(vehicle) {}

  /// Returns to the start, for an autopilot that restarts.
  void restart();
  /// Advances by a step, then waits for the clock and all that it drives (tiles, recordings). Waits first while the
  /// simulation is paused or another vehicle is behind. `outputs`: of the motors, 0 to 1. False if the simulator stops.
  bool step(std::span<const double> outputs, double step_s);
  /// Repeats an event of a recorded session; returns what is sent.
  std::string apply(const AutopilotEvent& event);
  /// Leaves the lockstep while the autopilot is silent: the vehicle stays as it is, and others no longer wait for it.
  void leave();

  /// Returns the vehicle's true state, relative to its start.
  autopilot::ArduPilotState ardupilot_state() const;
  /// Returns the MAVLink frames that are sent to PX4 for a step of 4 ms: the readings of the sensors that are due, and
  /// the true state. Frames are numbered by `sequence`, which is advanced. If vision takes an image at this step, the
  /// image is rendered and tracked first.
  std::string px4_sensors(std::uint64_t step, std::uint8_t& sequence);
  const std::string& name() const;
  /// Returns the number of motors.
  std::size_t motors() const;
  GeoPoint home() const;
  double home_heading_deg() const;

 private:
  void join();
  void put_at_start();
  void move(std::span<const double> outputs, double step_s);
  std::string read_px4_sensors(std::uint64_t step, std::uint8_t& sequence);
  std::optional<autopilot::Odometry> vision_at(std::uint64_t step, const SensorContext& now);
  /// Plans the image that vision takes at this step; nullopt: none. The mutex must be held.
  std::optional<PlannedImages> exposure_at(std::uint64_t step) const;
  /// Renders and tracks the image. The mutex must not be held.
  void look(const std::optional<PlannedImages>& exposure, std::uint64_t step);
  void note(AutopilotEvent event) const;
  /// Measures the distance along the body's z axis; nullopt: no surface within the range of a flow sensor.
  std::optional<double> distance_below_m() const;
  SensorContext sensor_context() const;
  /// Measures the true distances along the axes of the distance sensors, clamped to their maximum.
  std::vector<std::pair<const SensorSettings*, double>> distances_m() const;

  World& world_;
  VehicleSlot& slot_;
  double time_s_ = 0.0;                 ///< simulation time of the vehicle
  double elapsed_s_ = 0.0;              ///< since the autopilot's start
  FlowIntegral flow_;                   ///< since it was sent last
  std::uint8_t repeated_sequence_ = 0;  ///< of frames, in a session that is repeated
};

}  // namespace tileflight::simulator
