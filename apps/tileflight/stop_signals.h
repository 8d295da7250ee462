#pragma once

#include <csignal>
#include <stop_token>
#include <thread>

namespace tileflight::app {

/// For as long as it lives, SIGINT and SIGTERM request a stop instead of ending the process. To be made before any
/// other thread: threads inherit which signals they leave to this one.
class StopSignals {
 public:
  StopSignals();
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

  std::stop_token token() const { return source_.get_token(); }

 private:
  sigset_t before_{};
  std::stop_source source_;
  std::jthread thread_;
};

}  // namespace tileflight::app
