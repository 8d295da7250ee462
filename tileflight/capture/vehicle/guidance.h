#pragma once

#include <functional>
#include <limits>
#include <optional>
#include <variant>
#include <vector>

#include "tileflight/capture/vehicle/quadrotor.h"

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

/// Input of a guidance law at each step.
struct GuidanceInput {
  RigidBodyState state;
  double time_s = 0.0;  ///< since the start of the command
  double step_s = 0.0;
  double yaw_rad = 0.0;   ///< last commanded yaw
  bool touching = false;  ///< the vehicle was stopped or bounced by an obstacle in the last step
};

/// Output of a guidance law at each step.
struct GuidanceOutput {
  Setpoint setpoint;
  bool finished = false;
  std::optional<geometry::Vec3> hold_position;  ///< where to stay when finished; without it: where the vehicle can stop
};

/// Computes the setpoint of a step. Called once per step, in order.
using GuidanceLaw = std::function<GuidanceOutput(const GuidanceInput& now)>;

/// The guidance law of a command that starts at `start`.
GuidanceLaw make_guidance(const Command& command, const GuidanceInput& start, const ControllerOptions& limits);

/// Guidance that stops and hovers, at `place` if it is given.
GuidanceLaw make_stop_guidance(const std::optional<geometry::Vec3>& place, const GuidanceInput& start);

/// Time after which a command is abandoned; infinite for commands that end by themselves.
double timeout_s(const Command& command);

/// A polyline and the progress along it.
class PathProgress {
 public:
  explicit PathProgress(std::vector<geometry::Vec3> points);

  double length_m() const { return starts_m_.back(); }
  double progress_m() const { return progress_m_; }
  /// The point at this distance along the path; clamped to its ends.
  geometry::Vec3 at(double along_m) const;
  /// Advances to the nearest point within the next `reach_m` of the path, never backwards.
  void advance_to_nearest(const geometry::Vec3& position, double reach_m);

 private:
  std::vector<geometry::Vec3> points_;
  std::vector<double> starts_m_;  ///< distance of each point along the path
  double progress_m_ = 0.0;
};

}  // namespace tileflight::vehicle
