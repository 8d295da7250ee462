#include <cmath>

#include "tileflight/core/base/input_error.h"
#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/simulator_impl.h"

// Commands that set a vehicle's attitude or angular rates.
namespace tileflight::simulator {
namespace {

using geometry::Vec3;

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

bool command_attitude(Simulator::Impl& world, const char* call, float roll, float pitch, const vehicle::YawMode& yaw,
                      const VerticalCommand& lift, float duration_s, const std::string& vehicle) {
  return world.run_command(vehicle, call, [&](SimVehicle& sim_vehicle) -> vehicle::Command {
    vehicle::FlyAttitude command{
        .roll_rad = check_angle(roll, call), .pitch_rad = check_angle(pitch, call), .yaw = yaw};
    command.duration_s = clamp_duration_s(duration_s, call);
    apply_vertical_command(lift, sim_vehicle, world.T_local_ned, call, command);
    return command;
  });
}

bool command_rates(Simulator::Impl& world, const char* call, const Vec3& rates_frd_rad_s, const VerticalCommand& lift,
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

}  // namespace

bool Simulator::move_by_roll_pitch_yaw_z(float roll, float pitch, float yaw, float z, float duration_s,
                                         const std::string& vehicle) {
  const char* call = "moveByRollPitchYawZ";
  return command_attitude(*impl_, call, roll, pitch, absolute_yaw(yaw, call), {.z = z}, duration_s, vehicle);
}

bool Simulator::move_by_roll_pitch_yaw_throttle(float roll, float pitch, float yaw, float throttle, float duration_s,
                                                const std::string& vehicle) {
  const char* call = "moveByRollPitchYawThrottle";
  return command_attitude(*impl_, call, roll, pitch, absolute_yaw(yaw, call), {.throttle = throttle}, duration_s,
                          vehicle);
}

bool Simulator::move_by_roll_pitch_yawrate_z(float roll, float pitch, float yaw_rate, float z, float duration_s,
                                             const std::string& vehicle) {
  const char* call = "moveByRollPitchYawrateZ";
  return command_attitude(*impl_, call, roll, pitch, yaw_rate_mode(yaw_rate, call), {.z = z}, duration_s, vehicle);
}

bool Simulator::move_by_roll_pitch_yawrate_throttle(float roll, float pitch, float yaw_rate, float throttle,
                                                    float duration_s, const std::string& vehicle) {
  const char* call = "moveByRollPitchYawrateThrottle";
  return command_attitude(*impl_, call, roll, pitch, yaw_rate_mode(yaw_rate, call), {.throttle = throttle}, duration_s,
                          vehicle);
}

bool Simulator::move_by_angle_rates_z(float roll_rate, float pitch_rate, float yaw_rate, float z, float duration_s,
                                      const std::string& vehicle) {
  const char* call = "moveByAngleRatesZ";
  return command_rates(*impl_, call, check_rates(roll_rate, pitch_rate, yaw_rate, call), {.z = z}, duration_s, vehicle);
}

bool Simulator::move_by_angle_rates_throttle(float roll_rate, float pitch_rate, float yaw_rate, float throttle,
                                             float duration_s, const std::string& vehicle) {
  const char* call = "moveByAngleRatesThrottle";
  return command_rates(*impl_, call, check_rates(roll_rate, pitch_rate, yaw_rate, call), {.throttle = throttle},
                       duration_s, vehicle);
}

}  // namespace tileflight::simulator
