#pragma once

#include <cstdint>
#include <optional>

namespace tileflight::autopilot {

/// What a message with outputs means for lockstep.
enum class ControlVerdict {
  kAnswer,      ///< to the sensors sent last: make the next step
  kRepetition,  ///< stamped as the last one: no step
  kStale,       ///< stamped before the last one: ignored
  kFuture,      ///< stamped after all sensors that were sent: ignored
};

/// Lockstep by time stamps: each message of outputs answers the sensors that were sent before it. The autopilot's clock
/// follows the sensors' stamps, but may have its own zero: the first message tells the difference, within a tenth of a
/// second.
class ControlGate {
 public:
  /// `control_us`: the message's stamp. `sensor_us`: that of the sensors sent last.
  ControlVerdict receive(std::uint64_t control_us, std::uint64_t sensor_us);

 private:
  std::optional<std::uint64_t> last_us_;
  std::int64_t ahead_us_ = 0;  ///< the autopilot's clock less the sensors', by the first message
};

}  // namespace tileflight::autopilot
