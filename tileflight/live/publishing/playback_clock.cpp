#include "tileflight/live/publishing/playback_clock.h"

#include <cmath>

namespace tileflight::publishing {

void PlaybackClock::set_time(std::int64_t time_ns, WallTime now) {
  anchor_ns_ = time_ns;
  anchor_ = now;
}

void PlaybackClock::set_rate(double rate, WallTime now) {
  set_time(time_ns(now), now);
  rate_ = rate;
}

void PlaybackClock::set_paused(bool is_paused, WallTime now) {
  set_time(time_ns(now), now);
  is_paused_ = is_paused;
}

std::int64_t PlaybackClock::time_ns(WallTime now) const {
  if (is_paused_) return anchor_ns_;
  const std::chrono::duration<double, std::nano> passed = now - anchor_;
  return anchor_ns_ + std::llround(passed.count() * rate_);
}

std::optional<PlaybackClock::WallTime> PlaybackClock::due(std::int64_t time_ns) const {
  if (is_paused_) return std::nullopt;
  const double wall_ns = static_cast<double>(time_ns - anchor_ns_) / rate_;
  return anchor_ + std::chrono::nanoseconds(std::llround(wall_ns));
}

}  // namespace tileflight::publishing
