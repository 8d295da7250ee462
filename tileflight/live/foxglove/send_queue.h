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

/// Limits of what waits for one client.
struct QueueLimits {
  std::size_t max_bytes = std::size_t{64} << 20U;  ///< of all channels, latched ones apart
  std::size_t max_messages = 1000;                 ///< of one channel
  /// Of one channel that has more than `always_kept` messages: large messages are soon out of date, small ones are
  /// wanted one and all.
  std::size_t max_channel_bytes = std::size_t{1} << 20U;
  std::size_t always_kept = 4;
};

/// A message of a channel; its bytes are shared by all clients that wait for it.
struct QueuedMessage {
  ChannelId channel = 0;
  std::uint64_t time_ns = 0;
  std::shared_ptr<const std::string> bytes;
};

/// Messages that wait until a client reads, in the order of their arrival. What is too much is dropped, the oldest of a
/// channel first, so that a slow client misses messages and the server's memory is bounded.
class SendQueue {
 public:
  explicit SendQueue(const QueueLimits& limits = {}) : limits_(limits) {}

  /// `max_bytes`: a lower limit than QueueLimits::max_bytes, if the client has to share. Beyond it the channel that
  /// holds most drops its oldest message.
  void push(QueuedMessage message, std::size_t max_bytes);
  /// Of a latched channel only the last message waits; it is not dropped for others.
  void push_latched(QueuedMessage message);
  std::optional<QueuedMessage> pop();
  /// Drops what waits of a channel.
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
  void remove(std::deque<Entry>::iterator at);
  void drop_oldest_of(ChannelId channel);
  ChannelId heaviest_channel() const;

  QueueLimits limits_;
  std::deque<Entry> messages_;
  std::map<ChannelId, ChannelLoad> loads_;  ///< of the channels that are not latched and have messages
  std::size_t bytes_ = 0;
  std::uint64_t dropped_ = 0;
};

}  // namespace tileflight::foxglove
