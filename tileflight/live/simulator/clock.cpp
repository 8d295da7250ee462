#include "tileflight/live/simulator/clock.h"

#include <cmath>

#include "tileflight/core/base/input_error.h"
#include "tileflight/live/simulator/world.h"

namespace tileflight::simulator {

void Clock::pause(bool is_paused) {
  const std::lock_guard lock(world_.state_mutex);
  world_.clock.set_paused(is_paused);
}

bool Clock::is_paused() const {
  const std::lock_guard lock(world_.state_mutex);
  return world_.clock.paused();
}

void Clock::continue_for_time(double seconds) {
  constexpr double kMost_s = 3600.0;
  if (!(seconds >= 0.0 && seconds <= kMost_s))
    throw InputError("simContinueForTime", "the time must be from 0 to 3600 seconds");
  continue_for_frames(static_cast<std::uint32_t>(std::ceil(seconds / SimulationClock::kStep_s - 1e-6)));
}

void Clock::continue_for_frames(std::uint32_t frames) {
  constexpr std::uint32_t kMost = 1'200'000;
  if (frames > kMost) throw InputError("simContinueForFrames", "more than 1200000 steps");
  std::unique_lock lock(world_.state_mutex);
  if (world_.clock.steps_awaited() >= kMaxContinuingCalls)
    throw InputError("simContinueForTime", std::to_string(kMaxContinuingCalls) +
                                               " calls wait for the clock already; wait for some of them, or end them "
                                               "with simPause");
  world_.clock.run_steps(lock, frames);
}

std::int64_t Clock::tick() const {
  const std::lock_guard lock(world_.state_mutex);
  return world_.clock.steps();
}

std::uint64_t Clock::start_ns() const { return world_.clock.start_ns(); }

void Clock::advance_to(std::int64_t tick) {
  std::unique_lock lock(world_.state_mutex);
  world_.clock.drive_to(lock, tick);
}

}  // namespace tileflight::simulator
