#include "tileflight/simulator/engine.h"

#include <algorithm>
#include <utility>

namespace tileflight::simulator {
namespace {

/// Behind the wall's clock by more than this, the difference is given up.
constexpr std::chrono::milliseconds kMostBehind{100};
constexpr int kMostWithoutRest = 8;  // steps
constexpr std::chrono::microseconds kRest{20};
/// On demand, the clock starts here and not at the wall's time, so that stamps are the same each time.
constexpr std::uint64_t kOnDemandStart_ns = 1'000'000'000;

std::uint64_t wall_ns() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::nanoseconds>(now).count());
}

}  // namespace

Engine::Engine(std::mutex& state, const ClockSettings& clock, Hooks hooks)
    : state_(state),
      clock_(clock),
      hooks_(std::move(hooks)),
      start_ns_(clock.on_demand ? kOnDemandStart_ns : wall_ns()) {}

Engine::~Engine() { stop(); }

void Engine::start() {
  next_step_ = Clock::now();
  thread_ = std::thread([this] { run(); });
}

void Engine::stop() {
  {
    const std::lock_guard lock(state_);
    stopping_ = true;
  }
  wake_.notify_all();
  done_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void Engine::set_paused(bool paused) {
  paused_ = paused;
  run_until_.reset();
  wake_.notify_all();
  done_.notify_all();
}

bool Engine::may_step() const {
  if (run_until_) return true;
  return !paused_ && (!clock_.on_demand || hooks_.busy());
}

bool Engine::wait(std::unique_lock<std::mutex>& lock, const std::function<bool()>& done) {
  wake_.notify_all();
  done_.wait(lock, [&] { return stopping_ || done(); });
  return done();
}

void Engine::run_steps(std::unique_lock<std::mutex>& lock, std::int64_t steps) {
  const std::int64_t until = steps_ + steps;
  run_until_ = std::max(until, run_until_.value_or(until));
  wake_.notify_all();
  done_.wait(lock, [&] { return stopping_ || steps_ >= until || !run_until_; });
}

/// Sleeps until the next step is due by the wall's clock; the mutex is free meanwhile.
void Engine::pace(std::unique_lock<std::mutex>& lock) {
  if (clock_.on_demand) return;
  const auto now = Clock::now();
  if (next_step_ < now - kMostBehind) next_step_ = now - kMostBehind;
  if (next_step_ > now) {
    wake_.wait_until(lock, next_step_, [&] { return stopping_; });
    steps_without_rest_ = 0;
  }
  next_step_ += std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(kStep_s / clock_.speed));
}

void Engine::run() {
  std::unique_lock lock(state_);
  while (!stopping_) {
    if (!may_step()) {
      wake_.wait(lock, [&] { return stopping_ || may_step(); });
      next_step_ = Clock::now();
      continue;
    }
    pace(lock);
    if (stopping_ || !may_step()) continue;
    ++steps_;
    hooks_.step(time_s());
    const bool last = run_until_ && steps_ >= *run_until_;
    if (last) {
      run_until_.reset();
      paused_ = true;
    }
    const double now_s = time_s();
    lock.unlock();
    if (hooks_.after_step) hooks_.after_step(now_s);
    done_.notify_all();
    let_others_in();
    lock.lock();
  }
}

/// A thread that never waits would have the mutex back before one that was woken by it came there.
void Engine::let_others_in() {
  if (++steps_without_rest_ < kMostWithoutRest) return;
  steps_without_rest_ = 0;
  std::this_thread::sleep_for(kRest);
}

}  // namespace tileflight::simulator
