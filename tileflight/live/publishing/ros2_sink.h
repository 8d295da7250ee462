#pragma once

#include <chrono>
#include <map>
#include <memory>
#include <mutex>

#include "tileflight/live/publishing/message_sink.h"
#include "tileflight/live/ros2/topics.h"

namespace tileflight::publishing {

/// The topics of a ROS 2 node. Channels that are no ROS 2 messages are left out.
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

  /// Waits until reliable readers have got everything, for this time at most.
  void wait_until_acknowledged(std::chrono::milliseconds limit) const;

 private:
  std::shared_ptr<ros2::Publisher> publisher(ChannelId channel) const;

  ros2::Participant& participant_;
  mutable std::mutex mutex_;  ///< guards the next two
  std::map<ChannelId, std::shared_ptr<ros2::Publisher>> publishers_;
  ChannelId last_ = 0;
};

/// How a topic is sent: reliably, so that readers that want reliability match it as well as those of the sensor-data
/// profile (best effort), which get it as if it were sent so. What waits for a reader is 5 messages of images and
/// clouds, as in that profile, and 100 of small ones.
ros2::QualityOfService ros2_quality(const foxglove::Channel& channel);

}  // namespace tileflight::publishing
