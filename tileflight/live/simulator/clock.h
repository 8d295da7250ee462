#pragma once

#include <cstddef>
#include <cstdint>

namespace tileflight::simulator {

struct World;

/// The simulation's clock, as clients and repeated sessions control it.
class Clock {
 public:
  explicit Clock(World& world) : world_(world) {}

  /// Calls that may wait for the clock at once; further ones throw InputError.
  static constexpr std::size_t kMaxContinuingCalls = 128;

  void pause(bool is_paused);
  bool is_paused() const;
  /// Blocks for this time of the simulation, then pauses it.
  void continue_for_time(double seconds);
  /// Blocks for this number of clock steps, then pauses the simulation.
  void continue_for_frames(std::uint32_t frames);

  std::int64_t tick() const;       ///< steps that the clock has made
  std::uint64_t start_ns() const;  ///< time stamp of the start
  /// Advances to this step as fast as possible; with SimulatorOptions::repeats_session only.
  void advance_to(std::int64_t tick);

 private:
  World& world_;
};

}  // namespace tileflight::simulator
