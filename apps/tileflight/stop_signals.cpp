#include "stop_signals.h"

namespace tileflight::app {
namespace {

sigset_t stopping_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  return signals;
}

void wait_for_signal(const std::stop_token& end, std::stop_source& source) {
  const sigset_t signals = stopping_signals();
  const timespec a_moment{0, 50'000'000};
  while (!end.stop_requested()) {
    if (sigtimedwait(&signals, nullptr, &a_moment) > 0) source.request_stop();
  }
}

}  // namespace

StopSignals::StopSignals() {
  const sigset_t signals = stopping_signals();
  pthread_sigmask(SIG_BLOCK, &signals, &before_);
  thread_ = std::jthread([this](const std::stop_token& end) { wait_for_signal(end, source_); });
}

StopSignals::~StopSignals() {
  thread_ = {};
  pthread_sigmask(SIG_SETMASK, &before_, nullptr);
}

}  // namespace tileflight::app
