#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <optional>
#include <string>
#include <variant>

#include "tileflight/live/simulator/simulator.h"

namespace tileflight::airsim {

// The file of a recorded session: MessagePack arrays one after the other, whose first value says what they are
// (docs/sessions.md), in the order in which things took effect. A file that ends within a record, since the server was
// killed, is complete up to there.

/// Steps of the clock in a session, at most: three years of 3 ms. A file that claims more is damaged, rather
/// than repeated for ever.
inline constexpr std::int64_t kMaxTick = std::int64_t{1} << 35;

/// First record: what the session was of.
struct SessionHeader {
  std::string program;         ///< that wrote it, with its version
  std::string source;          ///< SOURCE of the command line
  std::string settings;        ///< text of the settings.json
  std::string world;           ///< the options that choose tiles and start, as one line of text
  std::uint64_t start_ns = 0;  ///< time stamp of the clock's start
};

/// A call of a client.
struct RecordedCall {
  std::uint64_t number = 0;  ///< from 0
  std::uint64_t client = 0;  ///< its connection, from 1
  std::int64_t tick = 0;     ///< steps that the clock had made when it took effect
  std::string message;       ///< MessagePack-RPC, as it came
};

/// First 16 bytes of a SHA-256.
using AnswerHash = std::array<std::uint8_t, 16>;

/// The answer to a call; calls that wait for the simulation are answered later, others at once.
struct RecordedAnswer {
  std::uint64_t call = 0;  ///< its number
  AnswerHash hash{};       ///< of the whole answer
  bool failed = false;     ///< it is an error
  std::int64_t tick = 0;   ///< steps that the clock had made when it was given, at least
};

/// An autopilot's event; for kSensors with the hash instead of the bytes.
struct RecordedEvent {
  simulator::AutopilotEvent event;
  AnswerHash hash{};
};

/// simLoadLevel opens another place, whose clock starts at this time stamp.
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

/// Writes a session. Thread-safe. Each record is with the operating system when add() returns. What cannot be written
/// (a full disk) ends the file: it is complete up to there.
class SessionWriter {
 public:
  /// Throws InputError if the file cannot be written, or exists.
  SessionWriter(const std::filesystem::path& file, const SessionHeader& header);

  /// False: this record is the first that could not be written. After RecordedEnd nothing is written any more.
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
  /// The next record; nullopt at the end, or where the file breaks off. Throws InputError for what is no record.
  std::optional<SessionRecord> next();
  /// Whether the file breaks off within a record.
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

}  // namespace tileflight::airsim
