#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <string>

namespace tileflight::autopilot {

/// Passes on at most one line of each kind in `interval`. The next line says how many were left out. Memory grows only
/// with the number of kinds.
class LimitedLog {
 public:
  using Clock = std::chrono::steady_clock;
  using Sink = std::function<void(const std::string& line)>;

  explicit LimitedLog(Sink sink, std::chrono::milliseconds interval = std::chrono::seconds(5),
                      std::function<Clock::time_point()> now = Clock::now)
      : sink_(std::move(sink)), interval_(interval), now_(std::move(now)) {}

  /// Passes a line on, or counts it as left out.
  void line(const std::string& kind, const std::string& text) {
    Kind& one = kinds_[kind];
    const Clock::time_point now = now_();
    if (one.written && now < one.last + interval_) {
      ++one.left_out;
      return;
    }
    if (sink_) sink_(one.left_out > 0 ? text + " (and " + std::to_string(one.left_out) + " such before)" : text);
    one = {true, now, 0};
  }

 private:
  struct Kind {
    bool written = false;
    Clock::time_point last;
    std::int64_t left_out = 0;
  };

  Sink sink_;
  std::chrono::milliseconds interval_;
  std::function<Clock::time_point()> now_;
  std::map<std::string, Kind> kinds_;
};

}  // namespace tileflight::autopilot
