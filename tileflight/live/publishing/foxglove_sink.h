#pragma once

#include "tileflight/live/foxglove/server.h"
#include "tileflight/live/publishing/message_sink.h"

namespace tileflight::publishing {

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

}  // namespace tileflight::publishing
