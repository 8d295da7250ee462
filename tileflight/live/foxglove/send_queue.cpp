#include "tileflight/live/foxglove/send_queue.h"

#include <algorithm>
#include <utility>

namespace tileflight::foxglove {

bool SendQueue::is_over(const ChannelLoad& load) const {
  return load.messages > limits_.max_messages ||
         (load.messages > limits_.always_kept && load.bytes > limits_.max_channel_bytes);
}

void SendQueue::push(QueuedMessage message, std::size_t max_bytes) {
  const ChannelId channel = message.channel;
  const std::size_t size = message.bytes->size();
  ChannelLoad& load = loads_[channel];
  ++load.messages;
  load.bytes += size;
  bytes_ += size;
  messages_.push_back({std::move(message), false});
  while (is_over(load)) drop_oldest_of(channel);
  while (bytes_ > std::min(max_bytes, limits_.max_bytes)) drop_oldest_of(heaviest_channel());
}

void SendQueue::push_latched(QueuedMessage message) {
  const auto before = std::ranges::find_if(
      messages_, [&](const Entry& entry) { return entry.is_latched && entry.message.channel == message.channel; });
  if (before != messages_.end()) remove(before);
  messages_.push_back({std::move(message), true});
}

std::optional<QueuedMessage> SendQueue::pop() {
  if (messages_.empty()) return std::nullopt;
  QueuedMessage first = messages_.front().message;  // shares its bytes
  remove(messages_.begin());
  return first;
}

void SendQueue::forget(ChannelId channel) {
  for (;;) {
    const auto at = std::ranges::find(messages_, channel, [](const Entry& entry) { return entry.message.channel; });
    if (at == messages_.end()) return;
    remove(at);
  }
}

void SendQueue::remove(const std::deque<Entry>::iterator& at) {
  if (!at->is_latched) {
    const std::size_t size = at->message.bytes->size();
    ChannelLoad& load = loads_[at->message.channel];
    --load.messages;
    load.bytes -= size;
    bytes_ -= size;
  }
  messages_.erase(at);
}

void SendQueue::drop_oldest_of(ChannelId channel) {
  const auto at = std::ranges::find_if(
      messages_, [&](const Entry& entry) { return !entry.is_latched && entry.message.channel == channel; });
  remove(at);
  ++dropped_;
}

ChannelId SendQueue::heaviest_channel() const {
  return std::ranges::max_element(loads_, {}, [](const auto& load) { return load.second.bytes; })->first;
}

}  // namespace tileflight::foxglove
