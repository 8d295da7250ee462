#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "tileflight/core/base/progress.h"
#include "tileflight/live/airsim/levels.h"
#include "tileflight/live/airsim/session_file.h"
#include "tileflight/live/rpc/method_table.h"
#include "tileflight/live/rpc/server.h"
#include "tileflight/live/simulator/simulator.h"

namespace tileflight::airsim {

/// Numbers of a session's file.
struct SessionSummary {
  SessionHeader header;
  std::deque<std::uint64_t> level_starts_ns;  ///< of the places that were opened, in their order
  std::uint64_t records = 0;
  bool is_cut = false;  ///< the file breaks off: its server was killed, or its disk full
};

/// Reads a whole session. Throws InputError.
SessionSummary summarize_session(const std::filesystem::path& file);

/// A difference between a session and its repetition.
struct SessionDifference {
  std::uint64_t call = 0;  ///< its number, from 0
  std::uint64_t client = 0;
  std::int64_t tick = 0;
  std::string what;  ///< the method that was called
};

/// Result of a repetition.
struct ReplayResult {
  std::uint64_t calls = 0;
  std::uint64_t answers_compared = 0;  ///< of calls, and messages to autopilots
  std::uint64_t autopilot_events = 0;
  std::uint64_t differences = 0;
  std::optional<SessionDifference> first_difference;  ///< the earliest
  double simulated_s = 0.0;                           ///< of the world served last
};

/// Repeats a session, as fast as it can, in worlds with SimulatorOptions::repeats_session, and compares each answer
/// with that of the session. Not compared are calls whose answers say how fast the machine is (tfStatistics,
/// tfGroundTruth). Stops the worlds at the end. Throws InputError for a damaged file.
ReplayResult replay_session(const std::filesystem::path& file, std::uint64_t records, Levels& levels,
                            const rpc::MethodTable& methods, const Progress& progress = {});

/// Records a session: everything that changes the world, in the order in which it takes effect. For that, the calls of
/// all clients are made one after the other, and time stands while one is made, except for those that wait for the
/// simulation (takeoff, moveToPosition, simContinueForTime …): they are over, as far as others are concerned, once they
/// wait. Thread-safe.
class SessionRecorder {
 public:
  /// Throws InputError if the file cannot be written, or exists.
  SessionRecorder(const std::filesystem::path& file, const SessionHeader& header, simulator::SimulatorLog log);

  /// For SimulatorOptions::journal of all worlds of the session.
  simulator::AutopilotJournal journal();
  /// simLoadLevel is about to open a place.
  void begin_level(std::uint64_t start_ns);
  /// Makes a call of a client and records it with its answer.
  rpc::Response call(Levels& levels, const rpc::MethodTable& methods, std::uint64_t client,
                     const rpc::Request& request);
  /// The server stops; later calls are not recorded.
  void finish(const Levels& levels);

 private:
  void add(const SessionRecord& record);

  std::string file_;
  simulator::SimulatorLog log_;
  SessionWriter writer_;
  std::atomic<std::uint64_t> calls_{0};
};

/// The turn (Simulator::Turn) of the world that is served.
class ServedTurn {
 public:
  explicit ServedTurn(const Levels& levels);
  std::int64_t tick() const { return turn_->tick(); }

 private:
  std::shared_ptr<simulator::Simulator> world_;
  std::optional<simulator::Simulator::Turn> turn_;  ///< ends before the world
};

}  // namespace tileflight::airsim
