#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <vector>

namespace tileflight::rpc {

/// Limits of one message. A message that exceeds them is not read to its end: the connection is closed.
struct MessageLimits {
  std::size_t max_bytes = 64U << 20U;
  std::uint64_t max_values = 1'000'000;  ///< numbers, strings, arrays, maps… of a message, nested ones included
  std::size_t max_depth = 32;            ///< nesting of arrays and maps
};

/// Limits for all clients together and for each one.
struct ServerLimits {
  MessageLimits message;
  MessageLimits message_before_authentication{.max_bytes = 64U << 10U, .max_values = 1000, .max_depth = 8};
  std::size_t max_connections = 64;
  /// Further requests wait; those that only wait are not counted, and slow ones (MethodTable::mark_slow()) by
  /// themselves.
  std::size_t max_running_per_connection = 32;
  /// Running, waiting and unread responses, without slow requests; beyond it, reading pauses.
  std::size_t max_pending_per_connection = 64;
  std::size_t max_slow_pending_per_connection = 1024;  ///< slow requests that run or wait; beyond it, reading pauses
  std::size_t max_workers = 256;                       ///< and as many for slow requests
  std::size_t max_waiting_calls = 256;  ///< of all clients (MethodTable::mark_waiting()); further ones count as others
  std::size_t max_queued_bytes = 256U << 20U;  ///< unread responses of one client; beyond it, the connection is closed
  std::size_t max_held_bytes = 1024U << 20U;   ///< all messages and responses; beyond it, the largest holder is closed
  double message_timeout_s = 60.0;             ///< from a message's first byte to its last
  double write_timeout_s = 60.0;               ///< within which a client must have read some of its response
  double authentication_timeout_s = 10.0;      ///< within which a client must have sent the token, if one is required
  double worker_idle_timeout_s = 10.0;         ///< after which an idle thread ends
};

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
