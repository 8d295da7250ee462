#include "tileflight/live/publishing/message_sink.h"

#include <condition_variable>
#include <set>
#include <thread>
#include <utility>
#include <vector>

namespace tileflight::publishing {

/// Static transforms: all in one message (tf2_ros: StaticBroadcasterQoS).
ros2::QualityOfService ros2_quality(const foxglove::Channel& channel) {
  static const std::set<std::string> kLarge{"sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage",
                                            "sensor_msgs/msg/PointCloud2"};
  if (channel.is_latched) return {.is_latched = true, .depth = 1};
  return {.depth = kLarge.contains(channel.schema_name) ? 5U : 100U};
}

MessageSink::ChannelId Ros2Sink::add_channel(const foxglove::Channel& channel) {
  constexpr ChannelId kNone = 0;
  if (channel.encoding != "cdr") return kNone;
  auto publisher =
      std::make_shared<ros2::Publisher>(participant_, channel.topic, channel.schema_name, ros2_quality(channel));
  const std::lock_guard lock(mutex_);
  publishers_.emplace(++last_, std::move(publisher));
  return last_;
}

void Ros2Sink::remove_channel(ChannelId channel) {
  std::shared_ptr<ros2::Publisher> last;  // goes without the lock
  const std::lock_guard lock(mutex_);
  const auto at = publishers_.find(channel);
  if (at == publishers_.end()) return;
  last = std::move(at->second);
  publishers_.erase(at);
}

std::shared_ptr<ros2::Publisher> Ros2Sink::publisher(ChannelId channel) const {
  const std::lock_guard lock(mutex_);
  const auto at = publishers_.find(channel);
  return at == publishers_.end() ? nullptr : at->second;
}

bool Ros2Sink::is_wanted(ChannelId channel) const {
  const auto to = publisher(channel);
  return to && to->has_readers();
}

void Ros2Sink::publish(ChannelId channel, std::uint64_t /*time_ns*/, std::string bytes) {
  if (const auto to = publisher(channel)) to->publish(std::move(bytes));
}

void Ros2Sink::wait_until_acknowledged(std::chrono::milliseconds limit) const {
  std::vector<std::shared_ptr<ros2::Publisher>> all;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& [channel, to] : publishers_) all.push_back(to);
  }
  const auto end = std::chrono::steady_clock::now() + limit;
  for (const auto& to : all) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
    if (left.count() > 0) to->wait_until_acknowledged(left);
  }
}

MessageSink::ChannelId SeveralSinks::add_channel(const foxglove::Channel& channel) {
  std::vector<ChannelId> numbers;
  for (MessageSink* sink : sinks_) numbers.push_back(sink->add_channel(channel));
  const std::lock_guard lock(mutex_);
  channels_.push_back(std::move(numbers));
  return static_cast<ChannelId>(channels_.size() - 1);
}

std::vector<MessageSink::ChannelId> SeveralSinks::numbers_of(ChannelId channel) const {
  const std::lock_guard lock(mutex_);
  return channels_.at(channel);
}

void SeveralSinks::remove_channel(ChannelId channel) {
  const std::vector<ChannelId> numbers = numbers_of(channel);
  for (std::size_t i = 0; i < sinks_.size(); ++i) sinks_[i]->remove_channel(numbers[i]);
}

bool SeveralSinks::is_wanted(ChannelId channel) const {
  const std::vector<ChannelId> numbers = numbers_of(channel);
  for (std::size_t i = 0; i < sinks_.size(); ++i) {
    if (sinks_[i]->is_wanted(numbers[i])) return true;
  }
  return false;
}

void SeveralSinks::publish(ChannelId channel, std::uint64_t time_ns, std::string bytes) {
  const std::vector<ChannelId> numbers = numbers_of(channel);
  for (std::size_t i = 0; i < sinks_.size(); ++i) sinks_[i]->publish(numbers[i], time_ns, bytes);
}

void SeveralSinks::publish_time(std::uint64_t time_ns) {
  for (MessageSink* sink : sinks_) sink->publish_time(time_ns);
}

std::uint64_t SeveralSinks::audience_changes() const {
  std::uint64_t changes = 0;
  for (const MessageSink* sink : sinks_) changes += sink->audience_changes();
  return changes;
}

/// Each sink waits in a thread of its own.
bool SeveralSinks::wait_for_audience(const std::stop_token& stop) const {
  std::mutex mutex;
  std::condition_variable_any came;
  bool is_there = false;
  std::vector<std::jthread> waiting;
  for (const MessageSink* sink : sinks_) {
    waiting.emplace_back([&, sink](const std::stop_token& enough) {
      if (!sink->wait_for_audience(enough)) return;
      const std::lock_guard lock(mutex);
      is_there = true;
      came.notify_all();
    });
  }
  std::unique_lock lock(mutex);
  const bool is_found = came.wait(lock, stop, [&] { return is_there; });
  lock.unlock();
  return is_found && !stop.stop_requested();
}

void SeveralSinks::warn(const std::string& text) {
  for (MessageSink* sink : sinks_) sink->warn(text);
}

}  // namespace tileflight::publishing
