#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>

#include "tileflight/live/simulator/settings.h"

namespace tileflight::simulator {

/// Returns the time stamp of a clock's start: that of the wall clock, or a constant with StepOnDemand and autopilots.
std::uint64_t default_start_ns(const ClockSettings& clock);

/// The simulation's clock. It advances in steps of kStep_s, in step with the wall clock (times ClockSpeed), or on
/// demand as fast as possible while there is work, or as far as autopilots have advanced. Steps run with the mutex
/// held, in the clock's own thread; nothing else advances time. On a slow machine simulation time runs slower, and no
/// step is skipped.
class SimulationClock {
 public:
  static constexpr double kStep_s = 0.003;  ///< AirSim's

  struct Hooks {
    std::function<void(double time_s)> step;  ///< advances everything to that time; mutex held
    std::function<bool()> busy;               ///< whether a task is running; mutex held
    /// Called after each step without the mutex; time does not advance meanwhile. Optional.
    std::function<void(double time_s)> after_step;
  };

  /// `state`: the mutex that guards everything the hooks access, including the clock's own state.
  SimulationClock(std::mutex& state, const ClockSettings& clock, Hooks hooks);
  /// Stops the clock.
  ~SimulationClock();
  SimulationClock(const SimulationClock&) = delete;
  SimulationClock& operator=(const SimulationClock&) = delete;

  void start();
  /// Wakes all waiting threads; no further steps. May be called twice.
  void stop();

  // The following require the mutex to be held:
  double time_s() const { return static_cast<double>(steps_) * kStep_s; }
  std::uint64_t time_ns() const { return start_ns_ + static_cast<std::uint64_t>(steps_) * kStepNs; }
  bool paused() const { return paused_; }
  bool stopped() const { return stopping_; }
  void set_paused(bool paused);
  /// Returns whether autopilots may advance: the clock is not paused.
  bool advancing() const { return !paused_ || run_until_.has_value(); }
  /// Lets time advance up to `time_s`, with ClockSettings::by_autopilots.
  void allow_until(double time_s);
  /// Returns whether all steps that may be made now have been made, including their after_step.
  bool settled() const { return !in_step_ && !may_step(); }
  /// Notifies the clock of a change: a task has started or ended.
  void wake() {
    wake_.notify_all();
    step_done_.notify_all();
  }
  /// Waits until the condition holds or the clock is stopped; the condition is checked after each step. Returns whether
  /// it holds. A thread that has the turn gives it up.
  bool wait(std::unique_lock<std::mutex>& lock, const std::function<bool()>& done);
  /// Runs this number of steps, then pauses. Returns when they are done, or the clock is stopped or paused by another
  /// thread. A thread that has the turn gives it up.
  void run_steps(std::unique_lock<std::mutex>& lock, std::int64_t steps);
  /// Threads that are in run_steps().
  std::size_t steps_awaited() const { return steps_awaited_; }

  // The turn orders what a recorded session does: while a thread has it, no step is made and no other thread gets it;
  // steps that are due and threads that wait alternate. Without a recording nobody takes it.
  /// Waits for the turn. Returns false without the turn if the clock is stopped.
  bool take_turn(std::unique_lock<std::mutex>& lock);
  /// Ends this thread's turn, if it has it.
  void end_turn();
  bool turn_is_free() const { return !turn_owner_; }
  /// Steps made so far.
  std::int64_t steps() const { return steps_; }
  std::uint64_t start_ns() const { return start_ns_; }
  /// Makes steps up to this number, with ClockSettings::driven. Returns when they are made, including their after_step.
  void drive_to(std::unique_lock<std::mutex>& lock, std::int64_t step);

 private:
  using WallClock = std::chrono::steady_clock;
  static constexpr std::uint64_t kStepNs = 3'000'000;

  void run();
  bool may_step() const;
  void wait_until_due(std::unique_lock<std::mutex>& lock);
  void wait_for_turn(std::unique_lock<std::mutex>& lock);
  void yield_to_waiters();

  std::mutex& state_;
  ClockSettings clock_;
  Hooks hooks_;
  std::condition_variable wake_;       ///< for the clock's thread
  std::condition_variable step_done_;  ///< for waiting threads
  std::int64_t steps_ = 0;
  std::uint64_t start_ns_ = 0;
  bool paused_ = false;
  std::optional<std::int64_t> run_until_;  ///< step number at which to pause
  std::size_t steps_awaited_ = 0;
  double limit_s_ = 0.0;  ///< up to which autopilots have advanced
  bool in_step_ = false;
  bool stopping_ = false;
  std::optional<std::thread::id> turn_owner_;
  int turns_wanted_ = 0;       ///< threads that wait for the turn
  bool turn_is_next_ = false;  ///< before the next step
  bool step_is_due_ = false;   ///< before the next turn but for turn_is_next_
  std::int64_t driven_to_ = 0;
  WallClock::time_point next_step_{};
  int steps_without_rest_ = 0;  ///< used only by the clock's thread
  std::thread thread_;
};

}  // namespace tileflight::simulator
