#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::autopilot {

/// An action of an autopilot on its vehicle; a recorded session holds all of them in the order in which they took
/// effect.
struct AutopilotEvent {
  enum class Kind : std::uint8_t {
    kRestart = 0,  ///< the vehicle was put back to its start
    kStep = 1,     ///< the vehicle moved
    kSensors = 2,  ///< the sensors of PX4 were read
  };
  Kind kind = Kind::kRestart;
  std::string vehicle;
  std::int64_t tick = 0;        ///< steps that the clock had made
  double time_s = 0.0;          ///< simulation time of the vehicle afterwards
  double step_s = 0.0;          ///< kStep
  std::vector<double> outputs;  ///< kStep: commands of the motors, 0 to 1
  std::uint64_t number = 0;     ///< kSensors: number of the message
  std::string bytes;            ///< kSensors: the bytes sent
  /// Pose of the vehicle afterwards, body x forward, y left, z up; not part of a session's file.
  geometry::SE3 T_local_body;
  bool touches = false;  ///< the vehicle touches a surface
};

/// Receives each event as it takes effect, with the simulator's mutex held.
using AutopilotJournal = std::function<void(const AutopilotEvent&)>;

}  // namespace tileflight::autopilot
