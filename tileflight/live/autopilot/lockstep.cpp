#include "tileflight/live/autopilot/lockstep.h"

#include <algorithm>

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

ControlVerdict ControlGate::receive(std::uint64_t control_us, std::uint64_t sensor_us) {
  const auto ahead_us = static_cast<std::int64_t>(control_us - sensor_us);
  if (!last_us_) {
    last_us_ = control_us;
    ahead_us_ = ahead_us;
    return ControlVerdict::kAnswer;
  }
  if (control_us < *last_us_) return ControlVerdict::kStale;
  if (control_us == *last_us_) return ControlVerdict::kRepetition;
  constexpr std::int64_t kMaxEarlierLag_us = 100'000;  // by which the first message may have been late
  if (ahead_us > ahead_us_ + kMaxEarlierLag_us) return ControlVerdict::kFuture;
  last_us_ = control_us;
  ahead_us_ = std::max(ahead_us_, ahead_us);
  return ahead_us > ahead_us_ - step_us_ ? ControlVerdict::kAnswer : ControlVerdict::kLate;
}

}  // namespace tileflight::autopilot
