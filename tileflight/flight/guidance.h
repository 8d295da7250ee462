#pragma once

#include <functional>
#include <optional>

#include "tileflight/flight/vehicle_command.h"

namespace tileflight::flight {

/// What a command's guide is told each step.
struct Moment {
  RigidBodyState state;
  double time_s = 0.0;  ///< since the command
  double step_s = 0.0;
  double yaw_rad = 0.0;   ///< that was asked for last
  bool touching = false;  ///< something stopped or bounced the craft in the last step
};

struct Guided {
  Setpoint setpoint;
  bool finished = false;
  std::optional<geometry::Vec3> rest;  ///< where to stay when finished; none: where it can stop
};

/// Says what to do now. Called once a step, in order.
using Guide = std::function<Guided(const Moment& now)>;

/// A guide for the command that is given now.
Guide guide_of(const Command& command, const Moment& start, const ControllerOptions& limits);

/// Stops and stays; at a place, if that is given.
Guide guide_to_rest(const std::optional<geometry::Vec3>& place, const Moment& start);

/// When the command is given up; endless for those that end by themselves.
double timeout_s(const Command& command);

/// A path of straight lines, and how far along it something is.
class PathProgress {
 public:
  explicit PathProgress(std::vector<geometry::Vec3> points);

  double length_m() const { return starts_m_.back(); }
  double progress_m() const { return progress_m_; }
  /// The point so far along; beyond the ends the ends.
  geometry::Vec3 at(double along_m) const;
  /// Moves on to the nearest point of the next `reach_m` of the path, never back.
  void follow(const geometry::Vec3& position, double reach_m);

 private:
  std::vector<geometry::Vec3> points_;
  std::vector<double> starts_m_;  ///< along the path, of each point
  double progress_m_ = 0.0;
};

}  // namespace tileflight::flight
