#include "terminal_progress.h"

#include <unistd.h>

#include <cstdio>

namespace tileflight::app {

TerminalProgress::TerminalProgress(bool enabled) : enabled_(enabled && isatty(STDERR_FILENO) == 1) {}

TerminalProgress::~TerminalProgress() { clear(); }

void TerminalProgress::update(std::int64_t done, std::int64_t total, std::string_view what) {
  if (!enabled_) return;
  const std::lock_guard lock(mutex_);
  const auto now = std::chrono::steady_clock::now();
  const bool new_step = what != last_what_;
  if (!new_step && now - last_ < std::chrono::milliseconds(100)) return;
  last_ = now;
  last_what_ = what;
  shown_ = true;
  if (total > 0) {
    const int percent = static_cast<int>(100 * done / total);
    std::fprintf(stderr, "\r\033[K%3d %%  %.*s", percent, static_cast<int>(what.size()), what.data());
  } else {
    std::fprintf(stderr, "\r\033[K%.*s (%lld)", static_cast<int>(what.size()), what.data(),
                 static_cast<long long>(done));
  }
  std::fflush(stderr);
}

void TerminalProgress::clear() {
  if (!shown_) return;
  std::fprintf(stderr, "\r\033[K");
  std::fflush(stderr);
  shown_ = false;
}

}  // namespace tileflight::app
