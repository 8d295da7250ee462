#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "tileflight/live/foxglove/messages.h"

namespace tileflight::foxglove {

/// Limits of the messages that wait for one client.
struct QueueLimits {
  std::size_t max_bytes = std::size_t{64} << 20U;  ///< all channels together, without latched ones
  std::size_t max_messages = 1000;                 ///< in one channel
  /// Limit of one channel that has more than `always_kept` messages. It bounds large messages, which are soon out of
  /// date, and keeps all small ones.
  std::size_t max_channel_bytes = std::size_t{1} << 20U;
  std::size_t always_kept = 4;
};

/// A message of a channel; its bytes are shared by all clients that wait for it.
struct QueuedMessage {
  ChannelId channel = 0;
  std::uint64_t time_ns = 0;
  std::shared_ptr<const std::string> bytes;
};

/// Messages that wait until a client reads, in the order of their arrival. Beyond the limits the oldest message of a
/// channel is dropped: a slow client misses messages, and the server's memory is bounded.
class SendQueue {
 public:
  explicit SendQueue(const QueueLimits& limits = {}) : limits_(limits) {}

  /// Adds a message. `max_bytes`: a limit below QueueLimits::max_bytes, if clients share memory. Beyond it the channel
  /// that holds most drops its oldest message.
  void push(QueuedMessage message, std::size_t max_bytes);
  /// Adds a message of a latched channel. It replaces the one that waits and is never dropped for others.
  void push_latched(QueuedMessage message);
  std::optional<QueuedMessage> pop();
  /// Drops the messages of a channel.
  void forget(ChannelId channel);

  bool empty() const { return messages_.empty(); }
  std::size_t bytes() const { return bytes_; }  ///< of the messages that are not latched
  std::uint64_t dropped() const { return dropped_; }

 private:
  struct Entry {
    QueuedMessage message;
    bool is_latched = false;
  };
  struct ChannelLoad {
    std::size_t messages = 0;
    std::size_t bytes = 0;
  };

  bool is_over(const ChannelLoad& load) const;
  void remove(const std::deque<Entry>::iterator& at);
  void drop_oldest_of(ChannelId channel);
  ChannelId heaviest_channel() const;

  QueueLimits limits_;
  std::deque<Entry> messages_;
  std::map<ChannelId, ChannelLoad> loads_;  ///< of the channels that are not latched and have messages
  std::size_t bytes_ = 0;
  std::uint64_t dropped_ = 0;
};

}  // namespace tileflight::foxglove
