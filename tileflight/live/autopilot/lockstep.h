#pragma once

#include <cstdint>
#include <optional>

namespace tileflight::autopilot {

/// Steps that a frame of the autopilot requests before the answer.
struct FrameRequest {
  bool restarted = false;  ///< the autopilot has started anew: first return to the start
  int steps = 0;           ///< number of steps; 0: the answer was lost, send the last one again
  double step_s = 0.0;     ///< length of each
};

/// Lockstep by frame numbers: one step of 1 / rate for each frame. The same number again is a repetition, a smaller one
/// a restart. Lost frames are made up for, up to those of a second; a greater jump counts as one step.
class FrameLockstep {
 public:
  /// Returns the steps for a frame. `rate`: steps a second, positive.
  FrameRequest receive(std::uint32_t frame, double rate);

 private:
  std::optional<std::uint32_t> last_;
};

/// Classifies a message with motor outputs by its time stamp; ControlGate gives it.
enum class ControlVerdict {
  kAnswer,      ///< it answers the sensors sent last: make the next step
  kLate,        ///< it answers earlier sensors: use the outputs, and wait on
  kRepetition,  ///< it has the last message's stamp: no step
  kStale,       ///< its stamp is before the last message's: ignore it
  kFuture,      ///< its stamp is after all sensors that were sent: ignore it
};

/// Lockstep by time stamps: each message of outputs answers the sensors that were sent before it. The autopilot's clock
/// follows the sensors' stamps, but may have its own zero. The least late message tells the difference; the first
/// message tells it within a tenth of a second.
class ControlGate {
 public:
  /// `step_us`: time from one set of sensors to the next.
  explicit ControlGate(std::int64_t step_us) : step_us_(step_us) {}

  /// Classifies a message. `control_us`: its stamp. `sensor_us`: stamp of the sensors sent last.
  ControlVerdict receive(std::uint64_t control_us, std::uint64_t sensor_us);

 private:
  std::int64_t step_us_;
  std::optional<std::uint64_t> last_us_;
  std::int64_t ahead_us_ = 0;  ///< the autopilot's clock less the sensors', by the least late message
};

}  // namespace tileflight::autopilot
