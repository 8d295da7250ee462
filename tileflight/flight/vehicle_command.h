#pragma once

#include <functional>
#include <limits>
#include <optional>
#include <variant>
#include <vector>

#include "tileflight/flight/quadrotor_controller.h"

namespace tileflight::flight {

inline constexpr double kNoTimeout_s = std::numeric_limits<double>::infinity();

/// Whether the craft may fly sideways, or points to where it flies (AirSim's DrivetrainType).
enum class Drivetrain { kMaxDegreeOfFreedom, kForwardOnly };

/// Where it points meanwhile.
struct YawMode {
  enum class Kind {
    kKeep,   ///< as when the command came
    kAngle,  ///< yaw, radians counter-clockwise from east; forward only: from the direction of flight
    kRate,   ///< radians per second, counter-clockwise; not with forward only
  };
  Kind kind = Kind::kKeep;
  double value = 0.0;
};

/// Straight up from where it is.
struct TakeOff {
  double height_m = 2.0;   ///< AirSim's
  double speed_m_s = 0.5;  ///< AirSim's
  double timeout_s = kNoTimeout_s;
};

/// Straight down until it rests on something, then the rotors stop.
struct Land {
  double speed_m_s = 0.2;  ///< AirSim's
  double timeout_s = kNoTimeout_s;
};

/// Stops, and stays there so long.
struct Hover {
  double duration_s = 0.0;
};

/// From where it is along straight lines through the points: towards what lies `lookahead_m` ahead on the line of where
/// it is (Coulter, The pure pursuit path tracking algorithm, CMU-RI-TR-92-01), slowing down to rest at the last point.
/// Corners are cut by about the lookahead. Finished within `arrival_m` of the end; then it holds the end.
struct FollowPath {
  std::vector<geometry::Vec3> points;  ///< local frame; none: finished at once
  double speed_m_s = 5.0;
  YawMode yaw;
  Drivetrain drivetrain = Drivetrain::kMaxDegreeOfFreedom;
  /// Not given: AirSim's, the way of 0.8 s (adaptive: 0.6 s), at least 0.75 m.
  std::optional<double> lookahead_m;
  bool adaptive_lookahead = true;
  double arrival_m = 0.5;  ///< AirSim's
  double timeout_s = kNoTimeout_s;
};

enum class VelocityFrame { kLocal, kHeading };  ///< east, north, up; or forward, left, up of the level craft

/// So fast, so long.
struct FlyVelocity {
  geometry::Vec3 velocity_m_s = geometry::Vec3::Zero();
  double duration_s = 1.0;
  VelocityFrame frame = VelocityFrame::kLocal;
  std::optional<double> height_m;  ///< hold this z instead of climbing by the velocity
  YawMode yaw;
  Drivetrain drivetrain = Drivetrain::kMaxDegreeOfFreedom;
};

/// On the spot, until it points there.
struct Turn {
  double yaw_rad = 0.0;
  double margin_rad = 0.0873;  ///< AirSim's rotateToYaw: 5 degrees
  double timeout_s = kNoTimeout_s;
};

/// On the spot, so long.
struct TurnAtRate {
  double yaw_rate_rad_s = 0.0;
  double duration_s = 1.0;
};

/// Leans so far, so long, and holds a height or a thrust; never farther than the controller's greatest tilt.
struct FlyAttitude {
  double roll_rad = 0.0;   ///< the right side down
  double pitch_rad = 0.0;  ///< the nose up
  YawMode yaw;
  std::optional<double> height_m;  ///< this z, or
  std::optional<double> throttle;  ///< this share of what all rotors give: one of the two
  double duration_s = 1.0;
};

/// Turns so fast about the body's axes (x forward, y left, z up), so long; height or thrust as FlyAttitude.
struct FlyRates {
  geometry::Vec3 rates_rad_s = geometry::Vec3::Zero();
  std::optional<double> height_m;
  std::optional<double> throttle;
  double duration_s = 1.0;
};

/// Keeps to a reference in time, seconds since the command; velocity and acceleration are fed forward.
struct Track {
  std::function<Setpoint(double time_s)> reference;
  double duration_s = 0.0;
};

using Command =
    std::variant<TakeOff, Land, Hover, FollowPath, FlyVelocity, Turn, TurnAtRate, FlyAttitude, FlyRates, Track>;

/// Throws InputError where a command cannot be flown: speeds that are not positive, numbers that are not finite, a
/// lookahead of 0, a yaw rate together with forward only.
void check(const Command& command);

}  // namespace tileflight::flight
