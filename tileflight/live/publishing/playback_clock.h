#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

namespace tileflight::publishing {

/// When the messages of a recording are due: recorded time against the wall clock, at a rate that may change, and with
/// pauses. The wall clock's time is passed in. Not thread-safe.
class PlaybackClock {
 public:
  using WallTime = std::chrono::steady_clock::time_point;

  PlaybackClock(double rate, bool is_paused) : rate_(rate), is_paused_(is_paused) {}

  /// From `now` on it is this recorded time.
  void set_time(std::int64_t time_ns, WallTime now);
  /// Recorded seconds per second; above zero.
  void set_rate(double rate, WallTime now);
  void set_paused(bool is_paused, WallTime now);
  double rate() const { return rate_; }
  bool is_paused() const { return is_paused_; }

  std::int64_t time_ns(WallTime now) const;
  /// When it will be this recorded time; nullopt: it is paused.
  std::optional<WallTime> due(std::int64_t time_ns) const;

 private:
  double rate_;
  bool is_paused_;
  std::int64_t anchor_ns_ = 0;  ///< recorded time at `anchor_`
  WallTime anchor_{};
};

}  // namespace tileflight::publishing
