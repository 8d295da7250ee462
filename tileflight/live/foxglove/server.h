#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>

#include "tileflight/live/foxglove/messages.h"
#include "tileflight/live/foxglove/send_queue.h"

namespace tileflight::foxglove {

struct ServerOptions {
  std::string address = "127.0.0.1";  ///< of this machine, or "localhost"; 0.0.0.0 or :: for all of its networks
  std::uint16_t port = 0;             ///< 0: any free port
  std::string name = "tileflight";    ///< shown by clients
  std::size_t max_clients = 64;
  std::size_t max_message_bytes = std::size_t{1} << 20U;   ///< from a client
  QueueLimits queue;                                       ///< of one client
  std::size_t max_queued_bytes = std::size_t{512} << 20U;  ///< of all clients together, latched messages apart
  std::chrono::milliseconds max_silence{60'000};           ///< a client that reads nothing for so long is disconnected
};

struct ServerStatistics {
  std::uint64_t clients = 0;           ///< connected now
  std::uint64_t clients_refused = 0;   ///< because there were too many
  std::uint64_t messages_dropped = 0;  ///< since the start, for clients that read too slowly
};

/// A server of the Foxglove WebSocket protocol, version 1 (https://github.com/foxglove/ws-protocol, docs/spec.md), for
/// the sub-protocols foxglove.websocket.v1 and foxglove.sdk.v1, which are the same under two names. It knows nothing
/// of what it sends. All that clients send and make wait is bounded: a client that reads slowly misses messages, one
/// that sends what is not of the protocol is disconnected; others are not affected. Thread-safe.
class Server {
 public:
  /// Receives one line for each connection that is refused, lost or closed for a fault, by the server's thread, and for
  /// each channel whose messages are too large, by the publishing one.
  using Log = std::function<void(const std::string& line)>;

  /// Starts listening, in a thread of its own. Throws InputError if that address and port cannot be used.
  explicit Server(const ServerOptions& options, ParameterAccess parameters = {}, Log log = {});
  /// Says goodbye to all clients and stops.
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  std::uint16_t port() const;

  ChannelId add_channel(Channel channel);
  void remove_channel(ChannelId channel);

  /// Returns whether any client has subscribed to the channel; otherwise its messages need not be made.
  bool is_subscribed(ChannelId channel) const;
  /// Counts subscriptions and ends of subscriptions since the start.
  std::uint64_t subscription_changes() const;
  /// Waits until any client has subscribed to any channel. Returns false if `stop` was requested.
  bool wait_for_subscriber(const std::stop_token& stop) const;

  /// Sends a message to the channel's subscribers, unless it is larger than QueueLimits::max_bytes. Never waits.
  void publish(ChannelId channel, std::uint64_t time_ns, std::string bytes);
  /// Tells all clients the time.
  void publish_time(std::uint64_t time_ns);
  /// Shows a warning to all clients.
  void warn(const std::string& text);

  /// Waits until all that waits is sent, or dropped with its client, for this time at most.
  void wait_until_sent(std::chrono::milliseconds limit) const;

  ServerStatistics statistics() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::foxglove
