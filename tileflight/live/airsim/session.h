#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <string>

#include "tileflight/live/airsim/levels.h"
#include "tileflight/live/airsim/session_file.h"
#include "tileflight/live/rpc/server.h"
#include "tileflight/live/simulator/simulator.h"

namespace tileflight::airsim {

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
