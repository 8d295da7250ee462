#include "tileflight/live/publishing/message_sink.h"

#include <condition_variable>
#include <thread>

namespace tileflight::publishing {

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
