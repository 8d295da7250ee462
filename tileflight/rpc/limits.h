#pragma once

#include <cstddef>
#include <cstdint>

namespace tileflight::rpc {

/// What one message may be. A message that goes beyond is not read to its end: the connection is closed.
struct MessageLimits {
  std::size_t max_bytes = 64U << 20U;
  std::uint64_t max_values = 1'000'000;  ///< numbers, texts, arrays, maps… of a message, nested ones included
  std::size_t max_depth = 32;            ///< arrays and maps within each other
};

/// What all clients together and each by itself may take from the server.
struct Limits {
  MessageLimits message;
  MessageLimits message_before_token{.max_bytes = 64U << 10U, .max_values = 1000, .max_depth = 8};
  std::size_t max_connections = 64;
  std::size_t max_running_per_connection = 32;  ///< further requests wait
  std::size_t max_pending_per_connection = 64;  ///< running, waiting and answers not yet read; then reading pauses
  std::size_t max_workers = 256;
  std::size_t max_queued_bytes = 256U << 20U;  ///< of answers that one client has not read: it is closed beyond
  std::size_t max_held_bytes = 1024U << 20U;   ///< of all messages and answers: who holds the most is closed beyond
  double half_message_s = 60.0;                ///< from a message's first byte to its last
  double unread_answer_s = 60.0;               ///< in which a client must have read something of its answer
  double token_s = 10.0;                       ///< in which a client must have sent the token, if one is asked for
  double idle_worker_s = 10.0;                 ///< after which a thread without work ends
};

}  // namespace tileflight::rpc
