#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>

#include "tileflight/simulator/settings.h"

namespace tileflight::simulator {

/// The simulation's clock: steps of kStep_s, in step with the wall's clock (times ClockSpeed) or, on demand, as fast as
/// they can be made while there is anything to do. A step happens with the mutex held, in a thread of its own; nothing
/// else moves time. Where the machine is too slow, simulated time goes slower and no step is left out.
class Engine {
 public:
  static constexpr double kStep_s = 0.003;  ///< AirSim's

  struct Hooks {
    std::function<void(double time_s)> step;  ///< moves everything on to that time; mutex held
    std::function<bool()> busy;               ///< whether a task is under way; mutex held
    /// After each step, the mutex not held; time stands still meanwhile. Empty: nothing.
    std::function<void(double time_s)> after_step;
  };

  /// `state`: guards all that hooks touch; the clock's own numbers too.
  Engine(std::mutex& state, const ClockSettings& clock, Hooks hooks);
  /// Stops.
  ~Engine();
  Engine(const Engine&) = delete;
  Engine& operator=(const Engine&) = delete;

  void start();
  /// Wakes all who wait; no further step. May be called twice.
  void stop();

  // With the mutex held:
  double time_s() const { return static_cast<double>(steps_) * kStep_s; }
  std::uint64_t time_ns() const { return start_ns_ + static_cast<std::uint64_t>(steps_) * kStepNs; }
  bool paused() const { return paused_; }
  bool stopped() const { return stopping_; }
  void set_paused(bool paused);
  /// Something has changed: a task was given or has ended.
  void wake() {
    wake_.notify_all();
    done_.notify_all();
  }
  /// Waits until the condition holds or the engine is stopped; asked after each step. Whether it holds.
  bool wait(std::unique_lock<std::mutex>& lock, const std::function<bool()>& done);
  /// So many steps, then paused. Returns when they are done, or the engine is stopped or paused by someone else.
  void run_steps(std::unique_lock<std::mutex>& lock, std::int64_t steps);

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr std::uint64_t kStepNs = 3'000'000;

  void run();
  bool may_step() const;
  void pace(std::unique_lock<std::mutex>& lock);
  void let_others_in();

  std::mutex& state_;
  ClockSettings clock_;
  Hooks hooks_;
  std::condition_variable wake_;  ///< of the thread
  std::condition_variable done_;  ///< of those who wait
  std::int64_t steps_ = 0;
  std::uint64_t start_ns_ = 0;
  bool paused_ = false;
  std::optional<std::int64_t> run_until_;  ///< then paused
  bool stopping_ = false;
  Clock::time_point next_step_{};
  int steps_without_rest_ = 0;  ///< of the thread alone
  std::thread thread_;
};

}  // namespace tileflight::simulator
