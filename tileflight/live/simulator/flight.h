#pragma once

#include <string>
#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/live/simulator/airsim_types.h"

namespace tileflight::simulator {

struct World;

/// Commands that move a vehicle. Except for start_velocity() and start_pose() they block until the task has finished
/// (true), or was cancelled or timed out (false). They return false at once for a vehicle that is not armed or not
/// under API control. Lengths are metres, speeds m/s, times seconds of the simulation, in the vehicle's own NED; angles
/// are radians unless the name says degrees. A `drivetrain` is 0 (any direction) or 1 (forward only).
class Flight {
 public:
  explicit Flight(World& world) : world_(world) {}

  /// Cancels the task that runs; the vehicle then hovers.
  void cancel_last_task(const std::string& vehicle);
  /// Climbs to 2 m above the start of the climb. Throws InputError for a vehicle that moves.
  bool takeoff(float timeout_s, const std::string& vehicle);
  bool land(float timeout_s, const std::string& vehicle);
  /// Flies to the start position at 0.5 m/s.
  bool go_home(float timeout_s, const std::string& vehicle);
  bool hover(const std::string& vehicle);
  bool move_to_position(float x, float y, float z, float velocity, float timeout_s, int drivetrain,
                        const YawMode& yaw_mode, float lookahead, float adaptive_lookahead, const std::string& vehicle);
  bool move_on_path(const std::vector<Vector3r>& path, float velocity, float timeout_s, int drivetrain,
                    const YawMode& yaw_mode, float lookahead, float adaptive_lookahead, const std::string& vehicle);
  /// Flies with a velocity in NED axes.
  bool move_by_velocity(float vx, float vy, float vz, float duration_s, int drivetrain, const YawMode& yaw_mode,
                        const std::string& vehicle);
  /// Flies with a horizontal velocity in NED axes at a fixed `z`.
  bool move_by_velocity_z(float vx, float vy, float z, float duration_s, int drivetrain, const YawMode& yaw_mode,
                          const std::string& vehicle);
  /// Flies with a velocity in axes that turn with the heading: forward, right, down.
  bool move_by_velocity_body_frame(float vx, float vy, float vz, float duration_s, int drivetrain,
                                   const YawMode& yaw_mode, const std::string& vehicle);
  bool move_by_velocity_z_body_frame(float vx, float vy, float z, float duration_s, int drivetrain,
                                     const YawMode& yaw_mode, const std::string& vehicle);
  bool move_to_z(float z, float velocity, float timeout_s, const YawMode& yaw_mode, float lookahead,
                 float adaptive_lookahead, const std::string& vehicle);
  bool move_to_gps(float latitude, float longitude, float altitude, float velocity, float timeout_s, int drivetrain,
                   const YawMode& yaw_mode, float lookahead, float adaptive_lookahead, const std::string& vehicle);
  /// Holds an attitude at a fixed `z`. Positive roll lowers the right side, positive pitch raises the nose, and yaw is
  /// clockwise from north. The variants below take a yaw rate instead of a yaw, rates instead of angles, or a throttle
  /// instead of a height; a throttle of 1 is the full thrust of the rotors.
  bool move_by_roll_pitch_yaw_z(float roll, float pitch, float yaw, float z, float duration_s,
                                const std::string& vehicle);
  bool move_by_roll_pitch_yaw_throttle(float roll, float pitch, float yaw, float throttle, float duration_s,
                                       const std::string& vehicle);
  bool move_by_roll_pitch_yawrate_z(float roll, float pitch, float yaw_rate, float z, float duration_s,
                                    const std::string& vehicle);
  bool move_by_roll_pitch_yawrate_throttle(float roll, float pitch, float yaw_rate, float throttle, float duration_s,
                                           const std::string& vehicle);
  bool move_by_angle_rates_z(float roll_rate, float pitch_rate, float yaw_rate, float z, float duration_s,
                             const std::string& vehicle);
  bool move_by_angle_rates_throttle(float roll_rate, float pitch_rate, float yaw_rate, float throttle, float duration_s,
                                    const std::string& vehicle);
  /// Turns to a heading in degrees clockwise from north, within `margin_degrees`.
  bool rotate_to_yaw(float yaw_degrees, float timeout_s, float margin_degrees, const std::string& vehicle);
  /// Turns clockwise at a rate.
  bool rotate_by_yaw_rate(float yaw_rate_degrees_s, float duration_s, const std::string& vehicle);

  // The following return at once. They put the vehicle under API control, arm it and cancel its current task. They
  // throw InputError for a vehicle that cannot do that, or for values out of range.

  /// Starts to fly with a velocity (x along the heading, y left, z up) and a counter-clockwise yaw rate; after
  /// `duration_s` of the simulation the vehicle hovers.
  void start_velocity(const geometry::Vec3& velocity_m_s, double yaw_rate_rad_s, double duration_s,
                      const std::string& vehicle);
  /// Starts to fly to a position at 5 m/s at most, and turns to the pose's heading; moves a camera without a vehicle at
  /// once. Body axes: x forward, y left, z up.
  void start_pose(const geometry::SE3& T_local_body, const std::string& vehicle);

 private:
  World& world_;
};

}  // namespace tileflight::simulator
