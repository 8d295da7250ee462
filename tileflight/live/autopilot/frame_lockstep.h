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

}  // namespace tileflight::autopilot
