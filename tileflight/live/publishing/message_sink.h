#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <stop_token>
#include <string>
#include <vector>

#include "tileflight/live/foxglove/messages.h"
#include "tileflight/live/foxglove/server.h"
#include "tileflight/live/ros2/topics.h"

namespace tileflight::publishing {

/// A receiver of messages: Foxglove's viewers, ROS 2's nodes, or both. Channels are described in Foxglove's terms.
/// Callers make only messages of channels that is_wanted(). Thread-safe.
class MessageSink {
 public:
  using ChannelId = foxglove::ChannelId;

  MessageSink() = default;
  virtual ~MessageSink() = default;
  MessageSink(const MessageSink&) = delete;
  MessageSink& operator=(const MessageSink&) = delete;

  virtual ChannelId add_channel(const foxglove::Channel& channel) = 0;
  virtual void remove_channel(ChannelId channel) = 0;
  virtual bool is_wanted(ChannelId channel) const = 0;
  /// Sends a message to the channel's subscribers; never waits for them.
  virtual void publish(ChannelId channel, std::uint64_t time_ns, std::string bytes) = 0;
  /// Sends the time, if the receiver has a way for it apart from messages.
  virtual void publish_time(std::uint64_t time_ns) = 0;
  /// Counts arrivals and departures of subscribers since the start.
  virtual std::uint64_t audience_changes() const = 0;
  /// Waits for the first subscriber. Returns false if `stop` was requested.
  virtual bool wait_for_audience(const std::stop_token& stop) const = 0;
  virtual void warn(const std::string& text) = 0;
};

/// Several sinks as one.
class SeveralSinks : public MessageSink {
 public:
  /// The sinks must outlive this.
  explicit SeveralSinks(std::vector<MessageSink*> sinks) : sinks_(std::move(sinks)) {}

  ChannelId add_channel(const foxglove::Channel& channel) override;
  void remove_channel(ChannelId channel) override;
  bool is_wanted(ChannelId channel) const override;
  void publish(ChannelId channel, std::uint64_t time_ns, std::string bytes) override;
  void publish_time(std::uint64_t time_ns) override;
  std::uint64_t audience_changes() const override;
  bool wait_for_audience(const std::stop_token& stop) const override;
  void warn(const std::string& text) override;

 private:
  /// Returns the channel's number in each sink, in the order of the sinks.
  std::vector<ChannelId> numbers_of(ChannelId channel) const;

  std::vector<MessageSink*> sinks_;
  mutable std::mutex mutex_;  ///< guards the next one
  std::vector<std::vector<ChannelId>> channels_;
};

/// The viewers of a server of Foxglove's protocol.
class FoxgloveSink : public MessageSink {
 public:
  /// `server` must outlive the sink.
  explicit FoxgloveSink(foxglove::Server& server) : server_(server) {}

  ChannelId add_channel(const foxglove::Channel& channel) override { return server_.add_channel(channel); }
  void remove_channel(ChannelId channel) override { server_.remove_channel(channel); }
  bool is_wanted(ChannelId channel) const override { return server_.is_subscribed(channel); }
  void publish(ChannelId channel, std::uint64_t time_ns, std::string bytes) override {
    server_.publish(channel, time_ns, std::move(bytes));
  }
  void publish_time(std::uint64_t time_ns) override { server_.publish_time(time_ns); }
  std::uint64_t audience_changes() const override { return server_.subscription_changes(); }
  bool wait_for_audience(const std::stop_token& stop) const override { return server_.wait_for_subscriber(stop); }
  void warn(const std::string& text) override { server_.warn(text); }

 private:
  foxglove::Server& server_;
};

/// A sink that publishes the topics of a ROS 2 node. Channels without ROS 2 messages are left out.
class Ros2Sink : public MessageSink {
 public:
  /// `participant` must outlive the sink.
  explicit Ros2Sink(ros2::Participant& participant) : participant_(participant) {}

  ChannelId add_channel(const foxglove::Channel& channel) override;
  void remove_channel(ChannelId channel) override;
  bool is_wanted(ChannelId channel) const override;
  void publish(ChannelId channel, std::uint64_t time_ns, std::string bytes) override;
  void publish_time(std::uint64_t /*time_ns*/) override {}  // /clock is a channel
  std::uint64_t audience_changes() const override { return participant_.audience_changes(); }
  bool wait_for_audience(const std::stop_token& stop) const override { return participant_.wait_for_reader(stop); }
  void warn(const std::string& text) override { participant_.report(text); }

  /// Waits until reliable readers have received everything, for `limit` at most.
  void wait_until_acknowledged(std::chrono::milliseconds limit) const;

 private:
  std::shared_ptr<ros2::Publisher> publisher(ChannelId channel) const;

  ros2::Participant& participant_;
  mutable std::mutex mutex_;  ///< guards the next two
  std::map<ChannelId, std::shared_ptr<ros2::Publisher>> publishers_;
  ChannelId last_ = 0;
};

/// Chooses the quality of service of a topic. Topics are reliable, so that both reliable readers and those of the
/// sensor-data profile (best effort) match. The queue for a reader holds 5 images or clouds, as in that profile, and
/// 100 messages of other topics.
ros2::QualityOfService ros2_quality(const foxglove::Channel& channel);

}  // namespace tileflight::publishing
