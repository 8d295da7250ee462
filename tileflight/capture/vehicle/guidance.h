#pragma once

#include <functional>
#include <optional>

#include "tileflight/capture/vehicle/vehicle_command.h"

namespace tileflight::vehicle {

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
