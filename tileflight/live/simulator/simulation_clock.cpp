#include "tileflight/live/simulator/simulation_clock.h"

#include <algorithm>
#include <utility>

namespace tileflight::simulator {
namespace {

/// A larger lag behind the wall clock is not caught up.
constexpr std::chrono::milliseconds kMaxLag{100};
constexpr int kMaxStepsWithoutYield = 8;  // steps
constexpr std::chrono::microseconds kYieldSleep{20};
/// Start time with StepOnDemand and with autopilots, instead of the wall clock, so that time stamps are reproducible.
constexpr std::uint64_t kOnDemandStart_ns = 1'000'000'000;

std::uint64_t wall_ns() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::nanoseconds>(now).count());
}

}  // namespace

std::uint64_t default_start_ns(const ClockSettings& clock) {
  return clock.on_demand || clock.by_autopilots ? kOnDemandStart_ns : wall_ns();
}

SimulationClock::SimulationClock(std::mutex& state, const ClockSettings& clock, Hooks hooks)
    : state_(state),
      clock_(clock),
      hooks_(std::move(hooks)),
      start_ns_(clock.start_ns ? *clock.start_ns : default_start_ns(clock)) {}

SimulationClock::~SimulationClock() { stop(); }

void SimulationClock::start() {
  next_step_ = WallClock::now();
  thread_ = std::thread([this] { run(); });
}

void SimulationClock::stop() {
  {
    const std::lock_guard lock(state_);
    stopping_ = true;
  }
  wake_.notify_all();
  step_done_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void SimulationClock::set_paused(bool paused) {
  paused_ = paused;
  run_until_.reset();
  wake_.notify_all();
  step_done_.notify_all();
}

bool SimulationClock::may_step() const {
  constexpr double kRounding_s = 1e-9;
  if (clock_.driven) return steps_ < driven_to_;
  if (clock_.by_autopilots && static_cast<double>(steps_ + 1) * kStep_s > limit_s_ + kRounding_s) return false;
  if (run_until_) return true;
  return !paused_ && (clock_.by_autopilots || !clock_.on_demand || hooks_.busy());
}

void SimulationClock::allow_until(double time_s) {
  limit_s_ = std::max(limit_s_, time_s);
  wake();
}

bool SimulationClock::wait(std::unique_lock<std::mutex>& lock, const std::function<bool()>& done) {
  end_turn();
  wake_.notify_all();
  step_done_.wait(lock, [&] { return stopping_ || done(); });
  return done();
}

void SimulationClock::run_steps(std::unique_lock<std::mutex>& lock, std::int64_t steps) {
  const std::int64_t until = steps_ + steps;
  run_until_ = std::max(until, run_until_.value_or(until));
  end_turn();
  wake();
  ++steps_awaited_;
  step_done_.wait(lock, [&] { return stopping_ || steps_ >= until || !run_until_; });
  --steps_awaited_;
}

bool SimulationClock::take_turn(std::unique_lock<std::mutex>& lock) {
  ++turns_wanted_;
  step_done_.wait(lock, [&] { return stopping_ || (!turn_owner_ && !in_step_ && (turn_is_next_ || !step_is_due_)); });
  --turns_wanted_;
  turn_is_next_ = false;
  if (stopping_) return false;
  turn_owner_ = std::this_thread::get_id();
  return true;
}

void SimulationClock::end_turn() {
  if (turn_owner_ != std::this_thread::get_id()) return;
  turn_owner_.reset();
  wake();
}

void SimulationClock::drive_to(std::unique_lock<std::mutex>& lock, std::int64_t step) {
  driven_to_ = std::max(driven_to_, step);
  wake();
  step_done_.wait(lock, [&] { return stopping_ || (steps_ >= step && !in_step_); });
}

/// Sleeps until the next step is due by the wall clock; the mutex is released meanwhile.
void SimulationClock::wait_until_due(std::unique_lock<std::mutex>& lock) {
  if (clock_.on_demand || clock_.by_autopilots || clock_.driven) return;
  const auto now = WallClock::now();
  if (next_step_ < now - kMaxLag) next_step_ = now - kMaxLag;
  if (next_step_ > now) {
    wake_.wait_until(lock, next_step_, [&] { return stopping_; });
    steps_without_rest_ = 0;
  }
  next_step_ += std::chrono::duration_cast<WallClock::duration>(std::chrono::duration<double>(kStep_s / clock_.speed));
}

void SimulationClock::run() {
  std::unique_lock lock(state_);
  while (!stopping_) {
    if (!may_step()) {
      wake_.wait(lock, [&] { return stopping_ || may_step(); });
      next_step_ = WallClock::now();
      continue;
    }
    wait_until_due(lock);
    wait_for_turn(lock);
    if (stopping_ || !may_step()) continue;
    ++steps_;
    hooks_.step(time_s());
    const bool last = run_until_ && steps_ >= *run_until_;
    if (last) {
      run_until_.reset();
      paused_ = true;
    }
    const double now_s = time_s();
    in_step_ = true;
    lock.unlock();
    if (hooks_.after_step) hooks_.after_step(now_s);
    step_done_.notify_all();
    yield_to_waiters();
    lock.lock();
    in_step_ = false;
    turn_is_next_ = turns_wanted_ > 0;
    if (clock_.by_autopilots || clock_.driven || turn_is_next_) step_done_.notify_all();
  }
}

/// Waits while a thread has the turn, or is to get it before this step.
void SimulationClock::wait_for_turn(std::unique_lock<std::mutex>& lock) {
  if (!turn_owner_ && !turn_is_next_) return;
  step_is_due_ = true;
  wake_.wait(lock, [&] { return stopping_ || (!turn_owner_ && !turn_is_next_); });
  step_is_due_ = false;
  if (!may_step()) step_done_.notify_all();
}

/// Lets waiting threads run: otherwise this thread would reacquire the mutex before a thread that it has notified.
void SimulationClock::yield_to_waiters() {
  if (++steps_without_rest_ < kMaxStepsWithoutYield) return;
  steps_without_rest_ = 0;
  std::this_thread::sleep_for(kYieldSleep);
}

}  // namespace tileflight::simulator
