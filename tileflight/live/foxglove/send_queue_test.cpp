#include "tileflight/live/foxglove/send_queue.h"

#include <gmock/gmock.h>

#include <map>
#include <random>

namespace tileflight::foxglove::send_queue_test {
namespace {

constexpr std::size_t kUnshared = std::size_t{1} << 30U;

QueuedMessage message(ChannelId channel, std::uint64_t time_ns, std::size_t size) {
  return {channel, time_ns, std::make_shared<const std::string>(size, 'x')};
}

/// (channel, time) of all that waits, in order.
std::vector<std::pair<ChannelId, std::uint64_t>> drained(SendQueue& queue) {
  std::vector<std::pair<ChannelId, std::uint64_t>> all;
  while (const auto next = queue.pop()) all.emplace_back(next->channel, next->time_ns);
  return all;
}

TEST(SendQueue, MessagesKeepTheirOrder) {
  SendQueue queue;
  queue.push(message(1, 10, 5), kUnshared);
  queue.push(message(2, 11, 5), kUnshared);
  queue.push(message(1, 12, 5), kUnshared);
  EXPECT_EQ(queue.bytes(), 15U);
  EXPECT_THAT(drained(queue), testing::ElementsAre(testing::Pair(1, 10), testing::Pair(2, 11), testing::Pair(1, 12)));
  EXPECT_TRUE(queue.empty());
  EXPECT_EQ(queue.bytes(), 0U);
}

TEST(SendQueue, OfLargeMessagesTheLastFewWait) {
  SendQueue queue({.max_bytes = 1000, .max_messages = 100, .max_channel_bytes = 50, .always_kept = 2});
  for (std::uint64_t i = 0; i < 5; ++i) queue.push(message(1, i, 40), kUnshared);
  EXPECT_EQ(queue.dropped(), 3U);
  EXPECT_THAT(drained(queue), testing::ElementsAre(testing::Pair(1, 3), testing::Pair(1, 4)));
}

TEST(SendQueue, OfSmallMessagesManyWait) {
  SendQueue queue({.max_bytes = 1000, .max_messages = 3, .max_channel_bytes = 50, .always_kept = 2});
  for (std::uint64_t i = 0; i < 5; ++i) queue.push(message(1, i, 1), kUnshared);
  EXPECT_THAT(drained(queue), testing::ElementsAre(testing::Pair(1, 2), testing::Pair(1, 3), testing::Pair(1, 4)));
}

TEST(SendQueue, TheHeaviestChannelDropsFirst) {
  SendQueue queue({.max_bytes = 100, .max_messages = 100, .max_channel_bytes = 100, .always_kept = 4});
  queue.push(message(1, 0, 10), kUnshared);
  queue.push(message(2, 1, 40), kUnshared);
  queue.push(message(2, 2, 40), kUnshared);
  queue.push(message(1, 3, 20), kUnshared);
  EXPECT_THAT(drained(queue), testing::ElementsAre(testing::Pair(1, 0), testing::Pair(2, 2), testing::Pair(1, 3)));
}

TEST(SendQueue, AShareOfTheServersMemoryLimitsFurther) {
  SendQueue queue({.max_bytes = 100, .max_messages = 100, .max_channel_bytes = 100, .always_kept = 4});
  queue.push(message(1, 0, 40), 100);
  queue.push(message(1, 1, 40), 50);
  EXPECT_THAT(drained(queue), testing::ElementsAre(testing::Pair(1, 1)));
  queue.push(message(1, 2, 60), 50);
  EXPECT_TRUE(queue.empty()) << "it does not fit at all";
}

TEST(SendQueue, OfALatchedChannelTheLastMessageWaitsAndIsNotDroppedForOthers) {
  SendQueue queue({.max_bytes = 100, .max_messages = 100, .max_channel_bytes = 100, .always_kept = 4});
  queue.push_latched(message(1, 0, 500));
  queue.push(message(2, 1, 60), kUnshared);
  queue.push(message(2, 2, 60), kUnshared);
  queue.push_latched(message(1, 3, 500));
  EXPECT_EQ(queue.bytes(), 60U);
  EXPECT_THAT(drained(queue), testing::ElementsAre(testing::Pair(2, 2), testing::Pair(1, 3)));
}

TEST(SendQueue, AForgottenChannelLeavesNothing) {
  SendQueue queue;
  queue.push(message(1, 0, 5), kUnshared);
  queue.push(message(2, 1, 7), kUnshared);
  queue.push_latched(message(1, 2, 5));
  queue.forget(1);
  EXPECT_EQ(queue.bytes(), 7U);
  EXPECT_THAT(drained(queue), testing::ElementsAre(testing::Pair(2, 1)));
}

/// Whatever is pushed and read, the limits hold, what is left is in order, and bytes are what is there.
TEST(SendQueue, LimitsHoldForAnyTraffic) {
  std::mt19937 random(5);
  const QueueLimits limits{.max_bytes = 500, .max_messages = 20, .max_channel_bytes = 120, .always_kept = 3};
  SendQueue queue(limits);
  std::uint64_t pushed = 0, read = 0;
  for (std::uint64_t i = 0; i < 20000; ++i) {
    if (random() % 4 == 0) read += queue.pop() ? 1 : 0;
    queue.push(message(random() % 5, i, random() % 90), kUnshared);
    ++pushed;
    ASSERT_LE(queue.bytes(), limits.max_bytes);
  }
  const std::uint64_t dropped = queue.dropped();
  const std::size_t bytes_waiting = queue.bytes();
  std::map<ChannelId, std::pair<std::size_t, std::size_t>> left;
  std::size_t bytes = 0, count = 0;
  std::uint64_t last = 0;
  while (const auto next = queue.pop()) {
    EXPECT_GE(next->time_ns, last);
    last = next->time_ns;
    left[next->channel].first += 1;
    left[next->channel].second += next->bytes->size();
    bytes += next->bytes->size();
    ++count;
  }
  EXPECT_EQ(bytes, bytes_waiting);
  EXPECT_EQ(pushed, read + dropped + count);
  for (const auto& [channel, load] : left)
    EXPECT_TRUE(load.first <= limits.always_kept || load.second <= limits.max_channel_bytes) << channel;
}

}  // namespace
}  // namespace tileflight::foxglove::send_queue_test
