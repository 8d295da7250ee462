#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/live/foxglove/messages.h"
#include "tileflight/live/foxglove/send_queue.h"

namespace tileflight::foxglove {

/// A channel with its last message, if it is latched and there was one.
struct OpenChannel {
  Channel channel;
  std::uint64_t time_ns = 0;
  std::shared_ptr<const std::string> last;
  bool is_refusal_told = false;  ///< whether it was logged that a message was too large
};

/// One message to a client: a text, or a binary message of a head and a body.
struct OutgoingMessage {
  bool is_text = false;
  std::string head;
  std::shared_ptr<const std::string> body;  ///< follows the head; null: nothing
  std::size_t size() const { return head.size() + (body ? body->size() : 0); }
};

/// State of the protocol with one client, independent of the transport: its subscriptions and the messages that wait to
/// be sent. Not thread-safe.
class ClientSession {
 public:
  using Channels = std::map<ChannelId, OpenChannel>;

  /// `channels` and `parameters` must outlive the session. Server info and the channels are sent first.
  ClientSession(const std::string& server_name, const std::string& session_id, const Channels& channels,
                const ParameterAccess& parameters, const QueueLimits& limits = {});

  /// Handles a text message. A request that this server cannot fulfil is answered by a status. Returns the names of the
  /// parameters that the client has set. Throws ProtocolError if the connection must be closed.
  std::vector<std::string> receive(std::string_view text);

  void advertise(ChannelId id, const Channel& channel);
  void unadvertise(ChannelId id);
  /// Queues a message if the client has subscribed to the channel; excess messages are dropped (SendQueue::push).
  void offer(const QueuedMessage& message, bool is_latched, std::size_t max_bytes);
  /// Sets the time to send; only the last one is sent.
  void offer_time(std::uint64_t time_ns) { time_ns_ = time_ns; }
  /// Sends the parameters whose updates the client has subscribed to.
  void offer_parameters(const std::vector<Parameter>& parameters);
  void send_status(StatusLevel level, const std::string& text);

  bool is_subscribed(ChannelId channel) const { return subscriptions_.contains(channel); }
  bool has_subscriptions() const { return !subscriptions_.empty(); }
  /// Takes the data to send next: answers, then the time, then messages.
  std::optional<OutgoingMessage> next();
  bool has_next() const { return !answers_.empty() || time_ns_ || !queue_.empty(); }
  std::uint64_t dropped() const { return queue_.dropped(); }

 private:
  void handle(const Subscribe& message);
  void handle(const Unsubscribe& message);
  void handle(const GetParameters& message);
  void handle(const SetParameters& message);
  void handle(const SubscribeParameters& message);
  void handle(const UnsubscribeParameters& message);
  void handle(const UnsupportedOperation& message);
  void subscribe(const Subscription& wanted);
  void answer(std::string text);
  std::vector<Parameter> named_parameters(const std::vector<std::string>& names) const;

  const Channels& channels_;
  const ParameterAccess& parameters_;
  std::map<ChannelId, std::uint32_t> subscriptions_;  ///< the client's id of each subscribed channel
  std::set<std::string> watched_parameters_;
  std::vector<std::string> set_parameters_;  ///< names set by the message that is handled
  std::deque<std::string> answers_;
  std::size_t answer_bytes_ = 0;
  std::optional<std::uint64_t> time_ns_;
  SendQueue queue_;
};

}  // namespace tileflight::foxglove
