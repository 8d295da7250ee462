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

/// Lockstep by frame numbers: one step of 1 / rate for each frame. The same frame again is a repetition, a smaller
/// number a restart. Frames that were lost are made up for, up to those of a second; a greater jump counts as one step.
class FrameLockstep {
 public:
  /// `rate`: steps a second, positive.
  FrameRequest receive(std::uint32_t frame, double rate);

 private:
  std::optional<std::uint32_t> last_;
};

/// Meaning of a message with outputs for lockstep.
enum class ControlVerdict {
  kAnswer,      ///< to the sensors sent last: make the next step
  kLate,        ///< to earlier sensors: outputs to use, but no answer
  kRepetition,  ///< stamped as the last one: no step
  kStale,       ///< stamped before the last one: ignored
  kFuture,      ///< stamped after all sensors that were sent: ignored
};

/// Lockstep by time stamps: each message of outputs answers the sensors that were sent before it. The autopilot's clock
/// follows the sensors' stamps, but may have its own zero: the least late message tells the difference, the first one
/// within a tenth of a second.
class ControlGate {
 public:
  /// `step_us`: from one set of sensors to the next.
  explicit ControlGate(std::int64_t step_us) : step_us_(step_us) {}

  /// `control_us`: the message's stamp. `sensor_us`: that of the sensors sent last.
  ControlVerdict receive(std::uint64_t control_us, std::uint64_t sensor_us);

 private:
  std::int64_t step_us_;
  std::optional<std::uint64_t> last_us_;
  std::int64_t ahead_us_ = 0;  ///< the autopilot's clock less the sensors', by the least late message
};

}  // namespace tileflight::autopilot
