#pragma once

#include <functional>
#include <limits>
#include <optional>
#include <variant>
#include <vector>

#include "tileflight/capture/vehicle/quadrotor_controller.h"

namespace tileflight::vehicle {

inline constexpr double kNoTimeout_s = std::numeric_limits<double>::infinity();

/// Whether the vehicle may fly sideways or always points in its direction of flight (AirSim's DrivetrainType).
enum class Drivetrain { kMaxDegreeOfFreedom, kForwardOnly };

/// Heading control during a command.
struct YawMode {
  enum class Kind {
    kKeep,   ///< keeps the heading at the start of the command
    kAngle,  ///< yaw, radians counter-clockwise from east; with kForwardOnly: relative to the direction of flight
    kRate,   ///< radians per second, counter-clockwise; not with kForwardOnly
  };
  Kind kind = Kind::kKeep;
  double value = 0.0;
};

/// Climbs vertically.
struct TakeOff {
  double height_m = 2.0;   ///< AirSim's
  double speed_m_s = 0.5;  ///< AirSim's
  double timeout_s = kNoTimeout_s;
};

/// Descends vertically until touchdown, then stops the rotors.
struct Land {
  double speed_m_s = 0.2;  ///< AirSim's
  double timeout_s = kNoTimeout_s;
};

/// Stops and hovers for a duration.
struct Hover {
  double duration_s = 0.0;
};

/// Follows the polyline from the current position through the points by pure pursuit: flies towards the point
/// `lookahead_m` ahead on the path (Coulter, The pure pursuit path tracking algorithm, CMU-RI-TR-92-01) and decelerates
/// to rest at the last point. Corners are cut by about the lookahead. Finished within `arrival_m` of the end, which it
/// then holds.
struct FollowPath {
  std::vector<geometry::Vec3> points;  ///< local frame; empty: finished at once
  double speed_m_s = 5.0;
  YawMode yaw;
  Drivetrain drivetrain = Drivetrain::kMaxDegreeOfFreedom;
  /// Default: AirSim's, the distance flown in 0.8 s (adaptive: 0.6 s), at least 0.75 m.
  std::optional<double> lookahead_m;
  bool adaptive_lookahead = true;
  double arrival_m = 0.5;    ///< AirSim's
  bool turns_first = false;  ///< finished only once the yaw is reached, too
  double timeout_s = kNoTimeout_s;
};

enum class VelocityFrame { kLocal, kHeading };  ///< east, north, up; or forward, left, up of the levelled body

/// Flies at a velocity for a duration.
struct FlyVelocity {
  geometry::Vec3 velocity_m_s = geometry::Vec3::Zero();
  double duration_s = 1.0;
  VelocityFrame frame = VelocityFrame::kLocal;
  std::optional<double> height_m;  ///< hold this z; the velocity's vertical component is ignored
  YawMode yaw;
  Drivetrain drivetrain = Drivetrain::kMaxDegreeOfFreedom;
};

/// Turns on the spot to a yaw.
struct TurnToYaw {
  double yaw_rad = 0.0;
  double margin_rad = 0.0873;  ///< AirSim's rotateToYaw: 5 degrees
  double timeout_s = kNoTimeout_s;
};

/// Turns on the spot at a rate for a duration.
struct TurnAtRate {
  double yaw_rate_rad_s = 0.0;
  double duration_s = 1.0;
};

/// Holds a tilt for a duration, with a height or a throttle; the tilt is limited to the controller's maximum.
struct FlyAttitude {
  double roll_rad = 0.0;   ///< right side down
  double pitch_rad = 0.0;  ///< nose up
  YawMode yaw;
  std::optional<double> height_m;  ///< hold this z, or
  std::optional<double> throttle;  ///< this share of the rotors' total thrust: exactly one of the two
  double duration_s = 1.0;
};

/// Holds angular rates about the body's axes (x forward, y left, z up) for a duration; height or throttle as in
/// FlyAttitude.
struct FlyRates {
  geometry::Vec3 rates_rad_s = geometry::Vec3::Zero();
  std::optional<double> height_m;
  std::optional<double> throttle;
  double duration_s = 1.0;
};

/// Tracks a reference over time, in seconds since the command; velocity and acceleration are fed forward.
struct TrackReference {
  std::function<Setpoint(double time_s)> reference;
  double duration_s = 0.0;
};

using Command = std::variant<TakeOff, Land, Hover, FollowPath, FlyVelocity, TurnToYaw, TurnAtRate, FlyAttitude,
                             FlyRates, TrackReference>;

/// Throws InputError for a command that cannot be flown: speeds that are not positive, numbers that are not finite, a
/// lookahead of 0, a yaw rate with kForwardOnly.
void check(const Command& command);

}  // namespace tileflight::vehicle
