#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <string_view>

namespace tileflight {

/// Progress report of a stage: `done` of `total` units of work (total 0: unknown), and a few words on the current step.
/// A stage never prints; its caller decides how progress is shown. May be called from any thread that runs the stage,
/// one call at a time. An empty function is allowed: nothing is reported.
using Progress = std::function<void(std::int64_t done, std::int64_t total, std::string_view what)>;

/// Calls `progress` unless it is empty.
inline void report_progress(const Progress& progress, std::int64_t done, std::int64_t total, std::string_view what) {
  if (progress) progress(done, total, what);
}

}  // namespace tileflight

namespace tileflight::base {

/// Returns the wall-clock time since `start`, in seconds.
inline double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace tileflight::base
