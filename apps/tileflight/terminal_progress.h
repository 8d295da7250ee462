#pragma once

#include <chrono>
#include <cstdint>
#include <mutex>
#include <string>
#include <string_view>

namespace tileflight::app {

/// One line on stderr that says how far the work is, rewritten in place. Silent where stderr is no terminal.
class TerminalProgress {
 public:
  explicit TerminalProgress(bool enabled);
  ~TerminalProgress();
  void update(std::int64_t done, std::int64_t total, std::string_view what);
  /// Leaves the line empty.
  void clear();

 private:
  std::mutex mutex_;
  bool enabled_;
  bool shown_ = false;
  std::string last_what_;
  std::chrono::steady_clock::time_point last_{};
};

}  // namespace tileflight::app
