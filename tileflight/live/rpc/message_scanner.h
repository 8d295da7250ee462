#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <vector>

#include "tileflight/live/rpc/server_limits.h"

namespace tileflight::rpc {

/// Bytes that are not a msgpack-rpc message, or a message beyond the limits. The stream cannot be resynchronised, so
/// its connection is closed; the message states the reason.
class ProtocolError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Finds the end of the first message of a byte stream without decoding it and without trusting its declared sizes:
/// memory use is one count per nesting level. MessagePack specification, "Formats".
class MessageScanner {
 public:
  explicit MessageScanner(const MessageLimits& limits) : limits_(limits) {}

  /// `bytes`: all bytes received of the message so far; each call continues where the last one stopped. Returns the
  /// message's length once it is complete. Throws ProtocolError.
  std::optional<std::size_t> find_message_end(std::string_view bytes);

  /// Prepares for the next message.
  void restart();

 private:
  void open_container(std::uint64_t values);
  void close_finished_containers();

  MessageLimits limits_;
  std::size_t offset_ = 0;           ///< of the next value's first byte
  std::uint64_t values_ = 0;         ///< read so far and declared
  std::vector<std::uint64_t> open_;  ///< values still to come, for each unfinished array or map
  bool begun_ = false;
  bool whole_ = false;
};

}  // namespace tileflight::rpc
