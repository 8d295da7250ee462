#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>

#include "tileflight/live/rpc/server.h"

namespace tileflight::rpc {

/// Thread-safe counters of the server.
class ServerCounters {
 public:
  std::atomic<std::uint64_t> connections{0}, accepted{0}, refused{0}, cut{0}, requests{0}, answers{0}, running{0},
      held_bytes{0};

  /// `method`: one of the table's names (arbitrary names chosen by clients would grow the map without bound).
  void add_call(const std::string& method, bool failed, double seconds) {
    const std::lock_guard lock(mutex_);
    MethodStatistics& entry = methods_[method];
    ++entry.calls;
    entry.errors += failed ? 1 : 0;
    entry.seconds += seconds;
  }

  ServerStatistics snapshot() const {
    ServerStatistics result{.connections = connections,
                            .connections_accepted = accepted,
                            .connections_refused = refused,
                            .connections_cut = cut,
                            .requests = requests,
                            .answers = answers,
                            .running = running,
                            .held_bytes = held_bytes};
    const std::lock_guard lock(mutex_);
    result.methods = methods_;
    return result;
  }

 private:
  mutable std::mutex mutex_;
  std::map<std::string, MethodStatistics> methods_;
};

}  // namespace tileflight::rpc
