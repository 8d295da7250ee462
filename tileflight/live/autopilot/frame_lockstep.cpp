#include "tileflight/live/autopilot/frame_lockstep.h"

namespace tileflight::autopilot {

FrameRequest FrameLockstep::receive(std::uint32_t frame, double rate) {
  const double step_s = 1.0 / rate;
  if (!last_ || frame < *last_) {
    last_ = frame;
    return {true, 1, step_s};
  }
  const std::uint32_t ahead = frame - *last_;
  last_ = frame;
  return {false, ahead <= rate ? static_cast<int>(ahead) : 1, step_s};
}

}  // namespace tileflight::autopilot
