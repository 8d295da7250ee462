#include "tileflight/live/simulator/flight.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/strict_section.h"
#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/world.h"

namespace tileflight::simulator {
namespace {

using geometry::Vec3;
using vehicle::Drivetrain;

constexpr double kTakeOffHeight_m = 2.0;    // AirSim's
constexpr double kAtRest_m_s = 0.05;        // AirSim's
constexpr double kHomeSpeed_m_s = 0.5;      // AirSim's
constexpr std::size_t kMaxPoints = 100000;  // per path
constexpr double kMaxSpeed_m_s = 1000.0;

/// Duration of a command within 0 to an hour; AirSim's clients send 3e38 for "no limit". Throws InputError for NaN.
double clamp_duration_s(float seconds, const char* call) {
  constexpr double kMaxDuration_s = 3600.0;
  base::require(!std::isnan(seconds), call, "the time is not a number");
  return std::clamp(static_cast<double>(seconds), 0.0, kMaxDuration_s);
}

/// Timeout of a command; at least one step.
double clamp_timeout_s(float seconds, const char* call) {
  return std::max(clamp_duration_s(seconds, call), SimulationClock::kStep_s);
}

/// Arguments of a call, checked as AirSim does: what it accepts is accepted, and clamped with a line in the log where
/// it cannot be flown. The functions throw InputError for numbers that are not finite.
class Arguments {
 public:
  Arguments(const World& world, const char* call) : world_(world), call_(call) {}

  const char* call() const { return call_; }

  double clamped(float value, double min, double max, const char* what) const {
    base::require(std::isfinite(value), call_, std::string(what) + " is not finite");
    const double taken = std::clamp(static_cast<double>(value), min, max);
    if (taken != value)
      log(std::string(what) + " of " + base::formatted("%g", static_cast<double>(value)), base::formatted("%g", taken));
    return taken;
  }

  /// A velocity of 0 reaches no goal: in AirSim, too, the vehicle stays until the timeout.
  double speed_m_s(float velocity) const {
    base::require(!(velocity < 0.0F), call_, "the velocity must not be negative");
    return clamped(velocity, kMinSpeed_m_s, kMaxSpeed_m_s, "the velocity");
  }

  Vec3 velocity_m_s(const Vec3& velocity) const {
    base::require(velocity.allFinite(), call_, "the velocity is not finite");
    if (velocity.norm() <= kMaxSpeed_m_s) return velocity;
    log("a velocity of " + base::formatted("%g", velocity.norm()) + " m/s",
        base::formatted("%g", kMaxSpeed_m_s) + " m/s");
    return velocity.normalized() * kMaxSpeed_m_s;
  }

  Drivetrain drivetrain(int drivetrain) const {
    if (drivetrain != 0 && drivetrain != 1)
      log("the drivetrain " + std::to_string(drivetrain), "0, any direction (1: forward only)");
    return drivetrain == 1 ? Drivetrain::kForwardOnly : Drivetrain::kMaxDegreeOfFreedom;
  }

  double angle_rad(float radians) const { return clamped(radians, -1000.0, 1000.0, "an angle"); }
  double rate_rad_s(float radians_s) const { return clamped(radians_s, -1000.0, 1000.0, "a rate"); }
  double yaw_deg(float degrees) const {
    base::require(std::isfinite(degrees), call_, "the yaw is not finite");
    return std::abs(degrees) <= kMaxYaw_deg ? degrees : std::remainder(degrees, 360.0);
  }

 private:
  static constexpr double kMinSpeed_m_s = 0.001;
  static constexpr double kMaxYaw_deg = 1e6;  // beyond it, a float has no whole turns

  void log(const std::string& given, const std::string& taken) const {
    world_.log_line(std::string(call_) + ": " + given + " is taken as " + taken);
  }

  const World& world_;
  const char* call_;
};

/// NED turns clockwise from north, the local frame counter-clockwise from east.
double heading_to_local_yaw_rad(double heading_deg) { return vehicle::heading_to_yaw_rad(heading_deg); }

vehicle::YawMode to_yaw_mode(const YawMode& yaw, Drivetrain drivetrain, const Arguments& arguments) {
  using Kind = vehicle::YawMode::Kind;
  constexpr double kMaxRate_deg_s = 1e6;
  if (yaw.is_rate) {
    const double rate_deg_s = arguments.clamped(yaw.yaw_or_rate, -kMaxRate_deg_s, kMaxRate_deg_s, "the yaw rate");
    return rate_deg_s == 0.0 ? vehicle::YawMode{} : vehicle::YawMode{Kind::kRate, -radians(rate_deg_s)};
  }
  const double yaw_deg = arguments.yaw_deg(yaw.yaw_or_rate);
  if (drivetrain == Drivetrain::kForwardOnly) return {Kind::kAngle, -radians(yaw_deg)};
  return {Kind::kAngle, heading_to_local_yaw_rad(yaw_deg)};
}

/// Arguments of a path call other than the path.
struct PathCall {
  const char* name;
  float velocity, timeout_s;
  int drivetrain;
  YawMode yaw_mode;
  float lookahead, adaptive_lookahead;
};

vehicle::FollowPath make_follow_path(const World& world, const PathCall& call, std::vector<Vec3> points_local) {
  vehicle::FollowPath path;
  if (points_local.empty()) return path;  // AirSim checks nothing then
  const Arguments arguments(world, call.name);
  path.points = std::move(points_local);
  path.speed_m_s = arguments.speed_m_s(call.velocity);
  path.drivetrain = arguments.drivetrain(call.drivetrain);
  base::require(path.drivetrain != Drivetrain::kForwardOnly || !call.yaw_mode.is_rate, call.name,
                "a yaw rate is not possible with the drivetrain forward only: give YawMode(is_rate=False, "
                "yaw_or_rate=0), an angle from the direction of flight");
  path.yaw = to_yaw_mode(call.yaw_mode, path.drivetrain, arguments);
  base::require(call.lookahead != 0.0F, call.name, "the lookahead must not be 0; -1 chooses it automatically");
  if (call.lookahead > 0.0F) path.lookahead_m = std::min(static_cast<double>(call.lookahead), 1e6);
  path.adaptive_lookahead = call.adaptive_lookahead > 0.0F;
  path.timeout_s = clamp_timeout_s(call.timeout_s, call.name);
  return path;
}

/// A yaw rate overrides the drivetrain forward only, as in AirSim, which refuses both together only along a path.
/// `velocity`: in the axes of the call, which the caller turns.
vehicle::FlyVelocity make_fly_velocity(const Arguments& arguments, const Vec3& velocity, float duration_s,
                                       int drivetrain, const YawMode& yaw_mode) {
  vehicle::FlyVelocity command;
  command.velocity_m_s = arguments.velocity_m_s(velocity);
  command.duration_s = clamp_duration_s(duration_s, arguments.call());
  command.drivetrain = arguments.drivetrain(drivetrain);
  if (yaw_mode.is_rate) command.drivetrain = Drivetrain::kMaxDegreeOfFreedom;
  command.yaw = to_yaw_mode(yaw_mode, command.drivetrain, arguments);
  return command;
}

/// Converts a position in a vehicle's own NED to the local frame.
Vec3 to_local(const SimVehicle& sim_vehicle, const geometry::SE3& T_local_ned, const Vector3r& position,
              const char* call) {
  return T_local_ned * (checked_position(position, call) + sim_vehicle.start_ned());
}

/// Vertical control during the command.
struct VerticalCommand {
  std::optional<float> z;
  std::optional<float> throttle;
};

template <class Command>
void apply_vertical_command(const VerticalCommand& lift, const SimVehicle& sim_vehicle,
                            const geometry::SE3& T_local_ned, const Arguments& arguments, Command& command) {
  if (lift.throttle) command.throttle = arguments.clamped(*lift.throttle, 0.0, 1.0, "the throttle");
  if (!lift.z) return;
  const Vec3 place_ned = checked_position({0.0F, 0.0F, *lift.z}, arguments.call()) + sim_vehicle.start_ned();
  command.height_m = (T_local_ned * place_ned).z();
}

bool command_attitude(World& world, const Arguments& arguments, float roll, float pitch, const vehicle::YawMode& yaw,
                      const VerticalCommand& lift, float duration_s, const std::string& vehicle) {
  return world.run_command(vehicle, arguments.call(), [&](SimVehicle& sim_vehicle) -> vehicle::Command {
    vehicle::FlyAttitude command{
        .roll_rad = arguments.angle_rad(roll), .pitch_rad = arguments.angle_rad(pitch), .yaw = yaw};
    command.duration_s = clamp_duration_s(duration_s, arguments.call());
    apply_vertical_command(lift, sim_vehicle, world.T_local_ned, arguments, command);
    return command;
  });
}

bool command_rates(World& world, const char* call, float roll_rate, float pitch_rate, float yaw_rate,
                   const VerticalCommand& lift, float duration_s, const std::string& vehicle) {
  return world.run_command(vehicle, call, [&](SimVehicle& sim_vehicle) -> vehicle::Command {
    const Arguments arguments(world, call);
    vehicle::FlyRates command;
    command.rates_rad_s = frd_from_flu(
        {arguments.rate_rad_s(roll_rate), arguments.rate_rad_s(pitch_rate), arguments.rate_rad_s(yaw_rate)});
    command.duration_s = clamp_duration_s(duration_s, call);
    apply_vertical_command(lift, sim_vehicle, world.T_local_ned, arguments, command);
    return command;
  });
}

vehicle::YawMode absolute_yaw(float yaw, const Arguments& arguments) {
  return {vehicle::YawMode::Kind::kAngle, vehicle::heading_to_yaw_rad(degrees(arguments.angle_rad(yaw)))};
}

vehicle::YawMode yaw_rate_mode(float yaw_rate, const Arguments& arguments) {
  return {vehicle::YawMode::Kind::kRate, -arguments.rate_rad_s(yaw_rate)};
}

constexpr double kMaxNodeSpeed_m_s = 1000.0, kMaxTurn_rad_s = 100.0, kGoalSpeed_m_s = 5.0;
constexpr double kMaxGoalDistance_m = 1e6;

/// Yaw of a pose in the local frame, counter-clockwise from east.
double goal_yaw_rad(const geometry::SE3& T_local_body) {
  const geometry::Vec3 forward = T_local_body.rotation * geometry::Vec3::UnitX();
  return std::atan2(forward.y(), forward.x());
}

/// Lets a vehicle that flies begin with a command.
void begin_command(World& world, SimVehicle& sim_vehicle, const vehicle::Command& command) {
  if (world.clock.stopped()) return;
  if (sim_vehicle.has_autopilot()) throw InputError(sim_vehicle.name(), "is flown by its autopilot");
  if (!sim_vehicle.settings().flies)
    throw InputError(sim_vehicle.name(), "is a camera by itself, which has no velocity");
  sim_vehicle.api_control = true;
  sim_vehicle.armed = true;
  sim_vehicle.command(command);
  world.clock.wake();
}

}  // namespace

/// Blocks until the task has ended. Returns false at once if the vehicle is not armed or not under API control.
bool World::run_command(const std::string& name, const char* call,
                        const std::function<vehicle::Command(SimVehicle&)>& command) {
  std::unique_lock lock(state_mutex);
  const std::shared_ptr<const vehicle::Task> task = begin_task(name, call, command);
  if (!task) return false;
  clock.wait(lock, [&] { return task->outcome != vehicle::Outcome::kRunning; });
  return task->outcome == vehicle::Outcome::kFinished;
}

/// Returns nullptr where the command is ignored. The state must be locked.
std::shared_ptr<const vehicle::Task> World::begin_task(const std::string& name, const char* call,
                                                       const std::function<vehicle::Command(SimVehicle&)>& command) {
  SimVehicle& sim_vehicle = require_multirotor(name, call);
  if (clock.stopped()) return nullptr;
  const vehicle::Command requested = command(sim_vehicle);
  if (!sim_vehicle.api_control && !sim_vehicle.settings().allow_api_always) {
    log_line(std::string(call) + ": ignored, '" + sim_vehicle.name() + "' is not under API control (enableApiControl)");
    return nullptr;
  }
  if (!sim_vehicle.armed) {
    log_line(std::string(call) + ": ignored, '" + sim_vehicle.name() + "' is not armed (armDisarm)");
    return nullptr;
  }
  return sim_vehicle.command(requested);
}

void Flight::cancel_last_task(const std::string& vehicle) {
  const std::lock_guard lock(world_.state_mutex);
  world_.require_multirotor(vehicle, "cancelLastTask").cancel();
  world_.clock.wake();
}

bool Flight::takeoff(float timeout_s, const std::string& vehicle) {
  return world_.run_command(vehicle, "takeoff", [&](SimVehicle& sim_vehicle) -> vehicle::Command {
    base::require(sim_vehicle.state().velocity_m_s.norm() <= kAtRest_m_s, "takeoff", "the vehicle is moving");
    return vehicle::TakeOff{.height_m = kTakeOffHeight_m, .timeout_s = clamp_timeout_s(timeout_s, "takeoff")};
  });
}

bool Flight::land(float timeout_s, const std::string& vehicle) {
  return world_.run_command(vehicle, "land", [&](SimVehicle&) -> vehicle::Command {
    return vehicle::Land{.timeout_s = clamp_timeout_s(timeout_s, "land")};
  });
}

bool Flight::go_home(float timeout_s, const std::string& vehicle) {
  return world_.run_command(vehicle, "goHome", [&](SimVehicle& sim_vehicle) -> vehicle::Command {
    vehicle::FollowPath path;
    path.points = {world_.T_local_ned * sim_vehicle.home().translation};
    path.speed_m_s = kHomeSpeed_m_s;
    path.timeout_s = clamp_timeout_s(timeout_s, "goHome");
    return path;
  });
}

bool Flight::hover(const std::string& vehicle) {
  return world_.run_command(vehicle, "hover", [](SimVehicle&) -> vehicle::Command { return vehicle::Hover{}; });
}

bool Flight::move_to_position(float x, float y, float z, float velocity, float timeout_s, int drivetrain,
                              const YawMode& yaw_mode, float lookahead, float adaptive_lookahead,
                              const std::string& vehicle) {
  const PathCall call{"moveToPosition", velocity, timeout_s, drivetrain, yaw_mode, lookahead, adaptive_lookahead};
  return world_.run_command(vehicle, call.name, [&](SimVehicle& sim_vehicle) -> vehicle::Command {
    return make_follow_path(world_, call, {to_local(sim_vehicle, world_.T_local_ned, {x, y, z}, call.name)});
  });
}

bool Flight::move_on_path(const std::vector<Vector3r>& path, float velocity, float timeout_s, int drivetrain,
                          const YawMode& yaw_mode, float lookahead, float adaptive_lookahead,
                          const std::string& vehicle) {
  const PathCall call{"moveOnPath", velocity, timeout_s, drivetrain, yaw_mode, lookahead, adaptive_lookahead};
  base::require(path.size() <= kMaxPoints, call.name, "more than 100000 points");
  return world_.run_command(vehicle, call.name, [&](SimVehicle& sim_vehicle) -> vehicle::Command {
    std::vector<Vec3> points;
    for (const Vector3r& point : path) points.push_back(to_local(sim_vehicle, world_.T_local_ned, point, call.name));
    return make_follow_path(world_, call, std::move(points));
  });
}

bool Flight::move_to_z(float z, float velocity, float timeout_s, const YawMode& yaw_mode, float lookahead,
                       float adaptive_lookahead, const std::string& vehicle) {
  const PathCall call{"moveToZ", velocity, timeout_s, 0, yaw_mode, lookahead, adaptive_lookahead};
  return world_.run_command(vehicle, call.name, [&](SimVehicle& sim_vehicle) -> vehicle::Command {
    Vec3 goal = sim_vehicle.position_local();
    goal.z() = to_local(sim_vehicle, world_.T_local_ned, {0.0F, 0.0F, z}, call.name).z();
    return make_follow_path(world_, call, {goal});
  });
}

bool Flight::move_to_gps(float latitude, float longitude, float altitude, float velocity, float timeout_s,
                         int drivetrain, const YawMode& yaw_mode, float lookahead, float adaptive_lookahead,
                         const std::string& vehicle) {
  const PathCall call{"moveToGPS", velocity, timeout_s, drivetrain, yaw_mode, lookahead, adaptive_lookahead};
  const Vec3 goal = world_.T_local_ned * world_.geodetic_frame.to_ned({latitude, longitude, altitude});
  return world_.run_command(vehicle, call.name,
                            [&](SimVehicle&) -> vehicle::Command { return make_follow_path(world_, call, {goal}); });
}

bool Flight::move_by_velocity(float vx, float vy, float vz, float duration_s, int drivetrain, const YawMode& yaw_mode,
                              const std::string& vehicle) {
  const Arguments arguments(world_, "moveByVelocity");
  return world_.run_command(vehicle, arguments.call(), [&](SimVehicle&) -> vehicle::Command {
    vehicle::FlyVelocity command = make_fly_velocity(arguments, {vx, vy, vz}, duration_s, drivetrain, yaw_mode);
    command.velocity_m_s = enu_from_ned(command.velocity_m_s);
    return command;
  });
}

bool Flight::move_by_velocity_z(float vx, float vy, float z, float duration_s, int drivetrain, const YawMode& yaw_mode,
                                const std::string& vehicle) {
  const Arguments arguments(world_, "moveByVelocityZ");
  if (duration_s <= 0.0F) return false;
  return world_.run_command(vehicle, arguments.call(), [&](SimVehicle& sim_vehicle) -> vehicle::Command {
    vehicle::FlyVelocity command = make_fly_velocity(arguments, {vx, vy, 0.0}, duration_s, drivetrain, yaw_mode);
    command.velocity_m_s = enu_from_ned(command.velocity_m_s);
    command.height_m = to_local(sim_vehicle, world_.T_local_ned, {0.0F, 0.0F, z}, arguments.call()).z();
    return command;
  });
}

bool Flight::move_by_velocity_body_frame(float vx, float vy, float vz, float duration_s, int drivetrain,
                                         const YawMode& yaw_mode, const std::string& vehicle) {
  const Arguments arguments(world_, "moveByVelocityBodyFrame");
  return world_.run_command(vehicle, arguments.call(), [&](SimVehicle&) -> vehicle::Command {
    vehicle::FlyVelocity command = make_fly_velocity(arguments, {vx, vy, vz}, duration_s, drivetrain, yaw_mode);
    command.velocity_m_s = frd_from_flu(command.velocity_m_s);
    command.frame = vehicle::VelocityFrame::kHeading;
    return command;
  });
}

bool Flight::move_by_velocity_z_body_frame(float vx, float vy, float z, float duration_s, int drivetrain,
                                           const YawMode& yaw_mode, const std::string& vehicle) {
  const Arguments arguments(world_, "moveByVelocityZBodyFrame");
  return world_.run_command(vehicle, arguments.call(), [&](SimVehicle& sim_vehicle) -> vehicle::Command {
    vehicle::FlyVelocity command = make_fly_velocity(arguments, {vx, vy, 0.0}, duration_s, drivetrain, yaw_mode);
    command.velocity_m_s = frd_from_flu(command.velocity_m_s);
    command.frame = vehicle::VelocityFrame::kHeading;
    command.height_m = to_local(sim_vehicle, world_.T_local_ned, {0.0F, 0.0F, z}, arguments.call()).z();
    return command;
  });
}

bool Flight::rotate_to_yaw(float yaw_degrees, float timeout_s, float margin_degrees, const std::string& vehicle) {
  const Arguments arguments(world_, "rotateToYaw");
  return world_.run_command(vehicle, arguments.call(), [&](SimVehicle&) -> vehicle::Command {
    if (timeout_s <= 0.0F) return vehicle::TurnAtRate{0.0, 0.0};  // no time: done, as in AirSim
    constexpr double kMinMargin_deg = 0.01;
    const double margin_deg = arguments.clamped(margin_degrees, kMinMargin_deg, 180.0, "the margin");
    return vehicle::TurnToYaw{heading_to_local_yaw_rad(arguments.yaw_deg(yaw_degrees)), radians(margin_deg),
                              clamp_timeout_s(timeout_s, arguments.call())};
  });
}

bool Flight::rotate_by_yaw_rate(float yaw_rate_degrees_s, float duration_s, const std::string& vehicle) {
  const Arguments arguments(world_, "rotateByYawRate");
  return world_.run_command(vehicle, arguments.call(), [&](SimVehicle&) -> vehicle::Command {
    const double rate_deg_s = arguments.clamped(yaw_rate_degrees_s, -1e5, 1e5, "the rate");
    return vehicle::TurnAtRate{-radians(rate_deg_s), clamp_duration_s(duration_s, arguments.call())};
  });
}

bool Flight::move_by_roll_pitch_yaw_z(float roll, float pitch, float yaw, float z, float duration_s,
                                      const std::string& vehicle) {
  const Arguments arguments(world_, "moveByRollPitchYawZ");
  return command_attitude(world_, arguments, roll, pitch, absolute_yaw(yaw, arguments), {.z = z}, duration_s, vehicle);
}

bool Flight::move_by_roll_pitch_yaw_throttle(float roll, float pitch, float yaw, float throttle, float duration_s,
                                             const std::string& vehicle) {
  const Arguments arguments(world_, "moveByRollPitchYawThrottle");
  return command_attitude(world_, arguments, roll, pitch, absolute_yaw(yaw, arguments), {.throttle = throttle},
                          duration_s, vehicle);
}

bool Flight::move_by_roll_pitch_yawrate_z(float roll, float pitch, float yaw_rate, float z, float duration_s,
                                          const std::string& vehicle) {
  const Arguments arguments(world_, "moveByRollPitchYawrateZ");
  return command_attitude(world_, arguments, roll, pitch, yaw_rate_mode(yaw_rate, arguments), {.z = z}, duration_s,
                          vehicle);
}

bool Flight::move_by_roll_pitch_yawrate_throttle(float roll, float pitch, float yaw_rate, float throttle,
                                                 float duration_s, const std::string& vehicle) {
  const Arguments arguments(world_, "moveByRollPitchYawrateThrottle");
  return command_attitude(world_, arguments, roll, pitch, yaw_rate_mode(yaw_rate, arguments), {.throttle = throttle},
                          duration_s, vehicle);
}

bool Flight::move_by_angle_rates_z(float roll_rate, float pitch_rate, float yaw_rate, float z, float duration_s,
                                   const std::string& vehicle) {
  const char* call = "moveByAngleRatesZ";
  return command_rates(world_, call, roll_rate, pitch_rate, yaw_rate, {.z = z}, duration_s, vehicle);
}

bool Flight::move_by_angle_rates_throttle(float roll_rate, float pitch_rate, float yaw_rate, float throttle,
                                          float duration_s, const std::string& vehicle) {
  const char* call = "moveByAngleRatesThrottle";
  return command_rates(world_, call, roll_rate, pitch_rate, yaw_rate, {.throttle = throttle}, duration_s, vehicle);
}

void Flight::start_velocity(const geometry::Vec3& velocity_m_s, double yaw_rate_rad_s, double duration_s,
                            const std::string& vehicle) {
  if (!(velocity_m_s.norm() <= kMaxNodeSpeed_m_s)) throw InputError(vehicle, "a velocity of more than 1000 m/s");
  if (!(std::abs(yaw_rate_rad_s) <= kMaxTurn_rad_s)) throw InputError(vehicle, "a turn of more than 100 rad/s");
  vehicle::FlyVelocity command;
  command.velocity_m_s = velocity_m_s;
  command.duration_s = duration_s;
  command.frame = vehicle::VelocityFrame::kHeading;
  if (yaw_rate_rad_s != 0.0) command.yaw = {vehicle::YawMode::Kind::kRate, yaw_rate_rad_s};
  const std::lock_guard lock(world_.state_mutex);
  begin_command(world_, *world_.slot(vehicle).vehicle, command);
}

void Flight::start_pose(const geometry::SE3& T_local_body, const std::string& vehicle) {
  if (!(T_local_body.translation.norm() <= kMaxGoalDistance_m))
    throw InputError(vehicle, "a goal more than 1000 km away");
  const std::lock_guard lock(world_.state_mutex);
  SimVehicle& sim_vehicle = *world_.slot(vehicle).vehicle;
  if (sim_vehicle.settings().flies) {
    vehicle::FollowPath path;
    path.points = {T_local_body.translation};
    path.speed_m_s = kGoalSpeed_m_s;
    path.turns_first = true;
    path.yaw = {vehicle::YawMode::Kind::kAngle, goal_yaw_rad(T_local_body)};
    return begin_command(world_, sim_vehicle, path);
  }
  VehicleState state;
  state.T_ned_body = world_.T_local_ned.inverse() * T_local_body * T_flu_frd();
  sim_vehicle.teleport(state);
  world_.clock.wake();
}

}  // namespace tileflight::simulator
