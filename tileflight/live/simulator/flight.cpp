#include "tileflight/live/simulator/flight.h"

#include <algorithm>
#include <cmath>

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

double check_speed(float velocity, const char* call) {
  base::require(velocity > 0.0F && velocity <= kMaxSpeed_m_s, call,
                "the velocity must be above 0 and at most 1000 m/s");
  return velocity;
}

Drivetrain to_drivetrain(int drivetrain, const char* call) {
  base::require(drivetrain == 0 || drivetrain == 1, call, "the drivetrain is 0 (any direction) or 1 (forward only)");
  return drivetrain == 1 ? Drivetrain::kForwardOnly : Drivetrain::kMaxDegreeOfFreedom;
}

/// NED turns clockwise from north, the local frame counter-clockwise from east.
double heading_to_local_yaw_rad(double heading_deg) { return vehicle::heading_to_yaw_rad(heading_deg); }

vehicle::YawMode to_yaw_mode(const YawMode& yaw, Drivetrain drivetrain, const char* call) {
  using Kind = vehicle::YawMode::Kind;
  base::require(std::isfinite(yaw.yaw_or_rate) && std::abs(yaw.yaw_or_rate) <= 1e6F, call, "the yaw is out of range");
  if (yaw.is_rate)
    return yaw.yaw_or_rate == 0.0F ? vehicle::YawMode{} : vehicle::YawMode{Kind::kRate, -radians(yaw.yaw_or_rate)};
  if (drivetrain == Drivetrain::kForwardOnly) return {Kind::kAngle, -radians(yaw.yaw_or_rate)};
  return {Kind::kAngle, heading_to_local_yaw_rad(yaw.yaw_or_rate)};
}

/// Arguments of a path call other than the path.
struct PathCall {
  const char* name;
  float velocity, timeout_s;
  int drivetrain;
  YawMode yaw_mode;
  float lookahead, adaptive_lookahead;
};

vehicle::FollowPath make_follow_path(const PathCall& call, std::vector<Vec3> points_local) {
  vehicle::FollowPath path;
  path.points = std::move(points_local);
  path.speed_m_s = check_speed(call.velocity, call.name);
  path.drivetrain = to_drivetrain(call.drivetrain, call.name);
  base::require(path.drivetrain != Drivetrain::kForwardOnly || !call.yaw_mode.is_rate, call.name,
                "a yaw rate is not possible with the drivetrain forward only: give YawMode(is_rate=False, "
                "yaw_or_rate=0), an angle from the direction of flight");
  path.yaw = to_yaw_mode(call.yaw_mode, path.drivetrain, call.name);
  base::require(call.lookahead != 0.0F && !std::isnan(call.lookahead), call.name,
                "the lookahead must not be 0; -1 chooses it automatically");
  if (call.lookahead > 0.0F) path.lookahead_m = std::min(static_cast<double>(call.lookahead), 1e6);
  path.adaptive_lookahead = call.adaptive_lookahead > 0.0F;
  path.timeout_s = clamp_timeout_s(call.timeout_s, call.name);
  return path;
}

/// A yaw rate overrides the drivetrain forward only, as in AirSim, which refuses both together only along a path.
vehicle::FlyVelocity make_fly_velocity(const char* call, const Vec3& velocity, float duration_s, int drivetrain,
                                       const YawMode& yaw_mode) {
  base::require(velocity.allFinite() && velocity.norm() <= kMaxSpeed_m_s, call, "the velocity is out of range");
  vehicle::FlyVelocity command;
  command.duration_s = clamp_duration_s(duration_s, call);
  command.drivetrain = to_drivetrain(drivetrain, call);
  if (yaw_mode.is_rate) command.drivetrain = Drivetrain::kMaxDegreeOfFreedom;
  command.yaw = to_yaw_mode(yaw_mode, command.drivetrain, call);
  return command;
}

/// Converts a position in a vehicle's own NED to the local frame.
Vec3 to_local(const SimVehicle& sim_vehicle, const geometry::SE3& T_local_ned, const Vector3r& position,
              const char* call) {
  return T_local_ned * (checked_position(position, call) + sim_vehicle.start_ned());
}

double check_range(float value, float max, const char* call, const char* what) {
  if (!(std::abs(value) <= max)) throw InputError(call, std::string(what) + " is out of range");
  return value;
}

double check_angle(float radians, const char* call) { return check_range(radians, 1000.0F, call, "an angle"); }
double check_rate(float radians_s, const char* call) { return check_range(radians_s, 1000.0F, call, "a rate"); }

/// Vertical control during the command.
struct VerticalCommand {
  std::optional<float> z;
  std::optional<float> throttle;
};

template <class Command>
void apply_vertical_command(const VerticalCommand& lift, const SimVehicle& sim_vehicle,
                            const geometry::SE3& T_local_ned, const char* call, Command& command) {
  if (lift.throttle) command.throttle = *lift.throttle;
  if (!lift.z) return;
  const Vec3 place_ned = checked_position({0.0F, 0.0F, *lift.z}, call) + sim_vehicle.start_ned();
  command.height_m = (T_local_ned * place_ned).z();
}

bool command_attitude(World& world, const char* call, float roll, float pitch, const vehicle::YawMode& yaw,
                      const VerticalCommand& lift, float duration_s, const std::string& vehicle) {
  return world.run_command(vehicle, call, [&](SimVehicle& sim_vehicle) -> vehicle::Command {
    vehicle::FlyAttitude command{
        .roll_rad = check_angle(roll, call), .pitch_rad = check_angle(pitch, call), .yaw = yaw};
    command.duration_s = clamp_duration_s(duration_s, call);
    apply_vertical_command(lift, sim_vehicle, world.T_local_ned, call, command);
    return command;
  });
}

bool command_rates(World& world, const char* call, const Vec3& rates_frd_rad_s, const VerticalCommand& lift,
                   float duration_s, const std::string& vehicle) {
  return world.run_command(vehicle, call, [&](SimVehicle& sim_vehicle) -> vehicle::Command {
    vehicle::FlyRates command;
    command.rates_rad_s = frd_from_flu(rates_frd_rad_s);
    command.duration_s = clamp_duration_s(duration_s, call);
    apply_vertical_command(lift, sim_vehicle, world.T_local_ned, call, command);
    return command;
  });
}

vehicle::YawMode absolute_yaw(float yaw, const char* call) {
  return {vehicle::YawMode::Kind::kAngle, vehicle::heading_to_yaw_rad(degrees(check_angle(yaw, call)))};
}

vehicle::YawMode yaw_rate_mode(float yaw_rate, const char* call) {
  return {vehicle::YawMode::Kind::kRate, -check_rate(yaw_rate, call)};
}

Vec3 check_rates(float roll, float pitch, float yaw, const char* call) {
  return {check_rate(roll, call), check_rate(pitch, call), check_rate(yaw, call)};
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

/// Returns nullptr where the command is ignored. Logs what it throws, because AirSim's clients do not show an error of
/// an asynchronous call. The state must be locked.
std::shared_ptr<const vehicle::Task> World::begin_task(
    const std::string& name, const char* call, const std::function<vehicle::Command(SimVehicle&)>& command) try {
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
} catch (const std::exception& fault) {
  log_line(std::string(call) + " is refused: " + fault.what());
  throw;
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
    return make_follow_path(call, {to_local(sim_vehicle, world_.T_local_ned, {x, y, z}, call.name)});
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
    return make_follow_path(call, std::move(points));
  });
}

bool Flight::move_to_z(float z, float velocity, float timeout_s, const YawMode& yaw_mode, float lookahead,
                       float adaptive_lookahead, const std::string& vehicle) {
  const PathCall call{"moveToZ", velocity, timeout_s, 0, yaw_mode, lookahead, adaptive_lookahead};
  return world_.run_command(vehicle, call.name, [&](SimVehicle& sim_vehicle) -> vehicle::Command {
    Vec3 goal = sim_vehicle.position_local();
    goal.z() = to_local(sim_vehicle, world_.T_local_ned, {0.0F, 0.0F, z}, call.name).z();
    return make_follow_path(call, {goal});
  });
}

bool Flight::move_to_gps(float latitude, float longitude, float altitude, float velocity, float timeout_s,
                         int drivetrain, const YawMode& yaw_mode, float lookahead, float adaptive_lookahead,
                         const std::string& vehicle) {
  const PathCall call{"moveToGPS", velocity, timeout_s, drivetrain, yaw_mode, lookahead, adaptive_lookahead};
  const Vec3 goal = world_.T_local_ned * world_.geodetic_frame.to_ned({latitude, longitude, altitude});
  return world_.run_command(vehicle, call.name,
                            [&](SimVehicle&) -> vehicle::Command { return make_follow_path(call, {goal}); });
}

bool Flight::move_by_velocity(float vx, float vy, float vz, float duration_s, int drivetrain, const YawMode& yaw_mode,
                              const std::string& vehicle) {
  const char* call = "moveByVelocity";
  return world_.run_command(vehicle, call, [&](SimVehicle&) -> vehicle::Command {
    vehicle::FlyVelocity command = make_fly_velocity(call, {vx, vy, vz}, duration_s, drivetrain, yaw_mode);
    command.velocity_m_s = enu_from_ned({vx, vy, vz});
    return command;
  });
}

bool Flight::move_by_velocity_z(float vx, float vy, float z, float duration_s, int drivetrain, const YawMode& yaw_mode,
                                const std::string& vehicle) {
  const char* call = "moveByVelocityZ";
  if (duration_s <= 0.0F) return false;
  return world_.run_command(vehicle, call, [&](SimVehicle& sim_vehicle) -> vehicle::Command {
    vehicle::FlyVelocity command = make_fly_velocity(call, {vx, vy, 0.0}, duration_s, drivetrain, yaw_mode);
    command.velocity_m_s = enu_from_ned({vx, vy, 0.0});
    command.height_m = to_local(sim_vehicle, world_.T_local_ned, {0.0F, 0.0F, z}, call).z();
    return command;
  });
}

bool Flight::move_by_velocity_body_frame(float vx, float vy, float vz, float duration_s, int drivetrain,
                                         const YawMode& yaw_mode, const std::string& vehicle) {
  const char* call = "moveByVelocityBodyFrame";
  return world_.run_command(vehicle, call, [&](SimVehicle&) -> vehicle::Command {
    vehicle::FlyVelocity command = make_fly_velocity(call, {vx, vy, vz}, duration_s, drivetrain, yaw_mode);
    command.velocity_m_s = frd_from_flu({vx, vy, vz});
    command.frame = vehicle::VelocityFrame::kHeading;
    return command;
  });
}

bool Flight::move_by_velocity_z_body_frame(float vx, float vy, float z, float duration_s, int drivetrain,
                                           const YawMode& yaw_mode, const std::string& vehicle) {
  const char* call = "moveByVelocityZBodyFrame";
  return world_.run_command(vehicle, call, [&](SimVehicle& sim_vehicle) -> vehicle::Command {
    vehicle::FlyVelocity command = make_fly_velocity(call, {vx, vy, 0.0}, duration_s, drivetrain, yaw_mode);
    command.velocity_m_s = frd_from_flu({vx, vy, 0.0});
    command.frame = vehicle::VelocityFrame::kHeading;
    command.height_m = to_local(sim_vehicle, world_.T_local_ned, {0.0F, 0.0F, z}, call).z();
    return command;
  });
}

bool Flight::rotate_to_yaw(float yaw_degrees, float timeout_s, float margin_degrees, const std::string& vehicle) {
  return world_.run_command(vehicle, "rotateToYaw", [&](SimVehicle&) -> vehicle::Command {
    base::require(std::isfinite(yaw_degrees) && std::abs(yaw_degrees) <= 1e6F, "rotateToYaw",
                  "the yaw is out of range");
    base::require(margin_degrees > 0.0F && margin_degrees <= 180.0F, "rotateToYaw",
                  "the margin must be above 0 degrees");
    return vehicle::TurnToYaw{heading_to_local_yaw_rad(yaw_degrees), radians(margin_degrees),
                              clamp_timeout_s(timeout_s, "rotateToYaw")};
  });
}

bool Flight::rotate_by_yaw_rate(float yaw_rate_degrees_s, float duration_s, const std::string& vehicle) {
  return world_.run_command(vehicle, "rotateByYawRate", [&](SimVehicle&) -> vehicle::Command {
    base::require(std::isfinite(yaw_rate_degrees_s) && std::abs(yaw_rate_degrees_s) <= 1e5F, "rotateByYawRate",
                  "the rate is out of range");
    return vehicle::TurnAtRate{-radians(yaw_rate_degrees_s), clamp_duration_s(duration_s, "rotateByYawRate")};
  });
}

bool Flight::move_by_roll_pitch_yaw_z(float roll, float pitch, float yaw, float z, float duration_s,
                                      const std::string& vehicle) {
  const char* call = "moveByRollPitchYawZ";
  return command_attitude(world_, call, roll, pitch, absolute_yaw(yaw, call), {.z = z}, duration_s, vehicle);
}

bool Flight::move_by_roll_pitch_yaw_throttle(float roll, float pitch, float yaw, float throttle, float duration_s,
                                             const std::string& vehicle) {
  const char* call = "moveByRollPitchYawThrottle";
  return command_attitude(world_, call, roll, pitch, absolute_yaw(yaw, call), {.throttle = throttle}, duration_s,
                          vehicle);
}

bool Flight::move_by_roll_pitch_yawrate_z(float roll, float pitch, float yaw_rate, float z, float duration_s,
                                          const std::string& vehicle) {
  const char* call = "moveByRollPitchYawrateZ";
  return command_attitude(world_, call, roll, pitch, yaw_rate_mode(yaw_rate, call), {.z = z}, duration_s, vehicle);
}

bool Flight::move_by_roll_pitch_yawrate_throttle(float roll, float pitch, float yaw_rate, float throttle,
                                                 float duration_s, const std::string& vehicle) {
  const char* call = "moveByRollPitchYawrateThrottle";
  return command_attitude(world_, call, roll, pitch, yaw_rate_mode(yaw_rate, call), {.throttle = throttle}, duration_s,
                          vehicle);
}

bool Flight::move_by_angle_rates_z(float roll_rate, float pitch_rate, float yaw_rate, float z, float duration_s,
                                   const std::string& vehicle) {
  const char* call = "moveByAngleRatesZ";
  return command_rates(world_, call, check_rates(roll_rate, pitch_rate, yaw_rate, call), {.z = z}, duration_s, vehicle);
}

bool Flight::move_by_angle_rates_throttle(float roll_rate, float pitch_rate, float yaw_rate, float throttle,
                                          float duration_s, const std::string& vehicle) {
  const char* call = "moveByAngleRatesThrottle";
  return command_rates(world_, call, check_rates(roll_rate, pitch_rate, yaw_rate, call), {.throttle = throttle},
                       duration_s, vehicle);
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
