#include <algorithm>
#include <cmath>

#include "tileflight/geometry/input_error.h"
#include "tileflight/simulator/frames.h"
#include "tileflight/simulator/simulator_impl.h"

// Commands that say how a vehicle lies or turns.
namespace tileflight::simulator {
namespace {

using geometry::Vec3;

constexpr double kLongest_s = 3600.0;

double checked(float value, float most, const char* call, const char* what) {
  if (!(std::abs(value) <= most)) throw InputError(call, std::string(what) + " is out of range");
  return value;
}

double angle_of(float radians, const char* call) { return checked(radians, 1000.0F, call, "an angle"); }
double rate_of(float radians_s, const char* call) { return checked(radians_s, 1000.0F, call, "a rate"); }

double duration_of(float seconds, const char* call) {
  if (std::isnan(seconds)) throw InputError(call, "the time is not a number");
  return std::clamp(static_cast<double>(seconds), 0.0, kLongest_s);
}

/// What carries the craft meanwhile.
struct Lift {
  std::optional<float> z;
  std::optional<float> throttle;
};

template <class Command>
void set_lift(const Lift& lift, const Craft& craft, const geometry::SE3& T_local_ned, const char* call,
              Command& command) {
  if (lift.throttle) command.throttle = *lift.throttle;
  if (!lift.z) return;
  const Vec3 place_ned = checked_position({0.0F, 0.0F, *lift.z}, call) + craft.start_ned();
  command.height_m = (T_local_ned * place_ned).z();
}

bool lie(Simulator::Impl& world, const char* call, float roll, float pitch, const flight::YawMode& yaw,
         const Lift& lift, float duration_s, const std::string& vehicle) {
  return world.fly(vehicle, call, [&](Craft& craft) -> flight::Command {
    flight::FlyAttitude command{.roll_rad = angle_of(roll, call), .pitch_rad = angle_of(pitch, call), .yaw = yaw};
    command.duration_s = duration_of(duration_s, call);
    set_lift(lift, craft, world.T_local_ned, call, command);
    return command;
  });
}

bool turn(Simulator::Impl& world, const char* call, const Vec3& rates_frd_rad_s, const Lift& lift, float duration_s,
          const std::string& vehicle) {
  return world.fly(vehicle, call, [&](Craft& craft) -> flight::Command {
    flight::FlyRates command;
    command.rates_rad_s = frd_of_flu(rates_frd_rad_s);
    command.duration_s = duration_of(duration_s, call);
    set_lift(lift, craft, world.T_local_ned, call, command);
    return command;
  });
}

flight::YawMode heading(float yaw, const char* call) {
  return {flight::YawMode::Kind::kAngle, flight::yaw_of_heading_rad(degrees(angle_of(yaw, call)))};
}

flight::YawMode turning(float yaw_rate, const char* call) {
  return {flight::YawMode::Kind::kRate, -rate_of(yaw_rate, call)};
}

Vec3 rates_of(float roll, float pitch, float yaw, const char* call) {
  return {rate_of(roll, call), rate_of(pitch, call), rate_of(yaw, call)};
}

}  // namespace

bool Simulator::move_by_roll_pitch_yaw_z(float roll, float pitch, float yaw, float z, float duration_s,
                                         const std::string& vehicle) {
  const char* call = "moveByRollPitchYawZ";
  return lie(*impl_, call, roll, pitch, heading(yaw, call), {.z = z}, duration_s, vehicle);
}

bool Simulator::move_by_roll_pitch_yaw_throttle(float roll, float pitch, float yaw, float throttle, float duration_s,
                                                const std::string& vehicle) {
  const char* call = "moveByRollPitchYawThrottle";
  return lie(*impl_, call, roll, pitch, heading(yaw, call), {.throttle = throttle}, duration_s, vehicle);
}

bool Simulator::move_by_roll_pitch_yawrate_z(float roll, float pitch, float yaw_rate, float z, float duration_s,
                                             const std::string& vehicle) {
  const char* call = "moveByRollPitchYawrateZ";
  return lie(*impl_, call, roll, pitch, turning(yaw_rate, call), {.z = z}, duration_s, vehicle);
}

bool Simulator::move_by_roll_pitch_yawrate_throttle(float roll, float pitch, float yaw_rate, float throttle,
                                                    float duration_s, const std::string& vehicle) {
  const char* call = "moveByRollPitchYawrateThrottle";
  return lie(*impl_, call, roll, pitch, turning(yaw_rate, call), {.throttle = throttle}, duration_s, vehicle);
}

bool Simulator::move_by_angle_rates_z(float roll_rate, float pitch_rate, float yaw_rate, float z, float duration_s,
                                      const std::string& vehicle) {
  const char* call = "moveByAngleRatesZ";
  return turn(*impl_, call, rates_of(roll_rate, pitch_rate, yaw_rate, call), {.z = z}, duration_s, vehicle);
}

bool Simulator::move_by_angle_rates_throttle(float roll_rate, float pitch_rate, float yaw_rate, float throttle,
                                             float duration_s, const std::string& vehicle) {
  const char* call = "moveByAngleRatesThrottle";
  return turn(*impl_, call, rates_of(roll_rate, pitch_rate, yaw_rate, call), {.throttle = throttle}, duration_s,
              vehicle);
}

}  // namespace tileflight::simulator
