#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <fstream>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <variant>

#include "tileflight/core/base/progress.h"
#include "tileflight/live/airsim/levels.h"
#include "tileflight/live/rpc/method_table.h"
#include "tileflight/live/rpc/server.h"
#include "tileflight/live/simulator/simulator.h"

namespace tileflight::airsim {

// The file of a recorded session: MessagePack arrays one after the other, whose first value says what they are
// (docs/sessions.md), in the order in which things took effect. A file that ends within a record, since the server was
// killed, is complete up to there.

/// Steps of the clock in a session, at most: three years of 3 ms. A file that claims more is damaged, rather
/// than repeated for ever.
inline constexpr std::int64_t kMaxTick = std::int64_t{1} << 35;

/// First record: program, place and settings of the session.
struct SessionHeader {
  std::string program;         ///< the program that wrote it, with its version
  std::string source;          ///< SOURCE of the command line
  std::string settings;        ///< text of the settings.json
  std::string world;           ///< the options that choose tiles and start, as one line of text
  std::uint64_t start_ns = 0;  ///< time stamp of the clock's start
};

/// A call of a client.
struct RecordedCall {
  std::uint64_t number = 0;  ///< from 0
  std::uint64_t client = 0;  ///< number of its connection, from 1
  std::int64_t tick = 0;     ///< steps that the clock had made when it took effect
  std::string message;       ///< MessagePack-RPC, as it came
};

/// First 16 bytes of a SHA-256.
using AnswerHash = std::array<std::uint8_t, 16>;

/// The answer to a call; calls that wait for the simulation are answered later, others at once.
struct RecordedAnswer {
  std::uint64_t call = 0;  ///< its number
  AnswerHash hash{};       ///< hash of the whole answer
  bool failed = false;     ///< whether it is an error
  std::int64_t tick = 0;   ///< steps that the clock had made when it was given, at least
};

/// An autopilot's event. For kSensors it has the hash instead of the bytes.
struct RecordedEvent {
  simulator::AutopilotEvent event;
  AnswerHash hash{};
};

/// A call of simLoadLevel opened another place, whose clock starts at this time stamp.
struct RecordedLevel {
  std::uint64_t start_ns = 0;
};

/// The server was stopped.
struct RecordedEnd {
  std::int64_t tick = 0;
};

using SessionRecord =
    std::variant<SessionHeader, RecordedCall, RecordedAnswer, RecordedEvent, RecordedLevel, RecordedEnd>;

AnswerHash hash_of(std::string_view bytes);

/// Writes a session. Thread-safe. Each record has reached the operating system when add() returns. The file ends with
/// the first record that cannot be written (a full disk), and is complete up to there.
class SessionWriter {
 public:
  /// Throws InputError if the file cannot be written, or exists.
  SessionWriter(const std::filesystem::path& file, const SessionHeader& header);

  /// Returns false if this record is the first that could not be written. Nothing is written after RecordedEnd.
  bool add(const SessionRecord& record);

 private:
  std::mutex mutex_;
  std::ofstream stream_;
  bool ended_ = false;
};

/// Reads a session, record by record.
class SessionReader {
 public:
  /// Throws InputError if the file cannot be read or is no session.
  explicit SessionReader(const std::filesystem::path& file);

  const SessionHeader& header() const { return header_; }
  /// Returns the next record; nullopt at the end, or where the file breaks off. Throws InputError for other bytes.
  std::optional<SessionRecord> next();
  /// Returns whether the file breaks off within a record.
  bool is_cut() const { return cut_; }

 private:
  std::optional<std::string> next_bytes();

  std::filesystem::path file_;
  std::ifstream stream_;
  std::string buffer_;
  std::size_t taken_ = 0;     ///< bytes of buffer_ that are read
  std::uint64_t offset_ = 0;  ///< of the next record in the file
  bool cut_ = false;
  SessionHeader header_;
};

/// Numbers of a session's file.
struct SessionSummary {
  SessionHeader header;
  std::deque<std::uint64_t> level_starts_ns;  ///< start time stamps of the places that were opened, in order
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
  std::string what;  ///< name of the method
};

/// Result of a repetition.
struct ReplayResult {
  std::uint64_t calls = 0;
  std::uint64_t answers_compared = 0;  ///< answers to calls, and messages to autopilots
  std::uint64_t autopilot_events = 0;
  std::uint64_t differences = 0;
  std::optional<SessionDifference> first_difference;  ///< the earliest
  double simulated_s = 0.0;                           ///< of the world served last
};

/// Repeats a session as fast as possible in worlds with SimulatorOptions::repeats_session, and compares each answer
/// with that of the session, except those that depend on the speed of the machine (tfStatistics, tfGroundTruth). Stops
/// the worlds at the end. Throws InputError for a damaged file.
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

  /// Returns the SimulatorOptions::journal for all worlds of the session.
  simulator::AutopilotJournal journal();
  /// Records that simLoadLevel is about to open a place.
  void begin_level(std::uint64_t start_ns);
  /// Makes a call of a client and records it with its answer.
  rpc::Response call(Levels& levels, const rpc::MethodTable& methods, std::uint64_t client,
                     const rpc::Request& request);
  /// Records that the server stops; later calls are not recorded.
  void finish(const Levels& levels);

 private:
  void add(const SessionRecord& record);

  std::string file_;
  simulator::SimulatorLog log_;
  SessionWriter writer_;
  std::atomic<std::uint64_t> calls_{0};
};

/// A turn (Simulator::Turn) of the world that is served.
class ServedTurn {
 public:
  explicit ServedTurn(const Levels& levels);
  std::int64_t tick() const { return turn_->tick(); }

 private:
  std::shared_ptr<simulator::Simulator> world_;
  std::optional<simulator::Simulator::Turn> turn_;  ///< ends before the world
};

}  // namespace tileflight::airsim
