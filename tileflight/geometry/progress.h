#pragma once

#include <cstdint>
#include <functional>
#include <string_view>

namespace tileflight {

/// Told by a stage how far it is: `done` of `total` units of work (total 0: unknown), and a few words on what it
/// is at. A stage never prints; whoever calls it decides what becomes of this. May be called from any thread
/// that runs the stage, one call at a time. An empty function is allowed and means silence.
using Progress = std::function<void(std::int64_t done, std::int64_t total, std::string_view what)>;

/// Calls `progress` if there is one.
inline void report_progress(const Progress& progress, std::int64_t done, std::int64_t total, std::string_view what) {
  if (progress) progress(done, total, what);
}

}  // namespace tileflight
