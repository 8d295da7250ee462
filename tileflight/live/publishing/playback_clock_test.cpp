#include "tileflight/live/publishing/playback_clock.h"

#include <gmock/gmock.h>

namespace tileflight::publishing::playback_clock_test {
namespace {

using std::chrono::milliseconds;

constexpr std::int64_t kSecond = 1'000'000'000;
const PlaybackClock::WallTime kBegin{std::chrono::hours(5)};

TEST(PlaybackClock, MessagesAreDueAtTheRate) {
  PlaybackClock clock(2.0, false);
  clock.set_time(10 * kSecond, kBegin);
  EXPECT_EQ(clock.due(10 * kSecond), kBegin);
  EXPECT_EQ(clock.due(14 * kSecond), kBegin + milliseconds(2000));
  EXPECT_EQ(clock.time_ns(kBegin + milliseconds(500)), 11 * kSecond);
}

TEST(PlaybackClock, AChangeOfRateKeepsTheTime) {
  PlaybackClock clock(1.0, false);
  clock.set_time(0, kBegin);
  clock.set_rate(4.0, kBegin + milliseconds(1000));
  EXPECT_EQ(clock.time_ns(kBegin + milliseconds(1000)), kSecond);
  EXPECT_EQ(clock.due(5 * kSecond), kBegin + milliseconds(2000));
}

TEST(PlaybackClock, NothingIsDueInAPause) {
  PlaybackClock clock(1.0, true);
  clock.set_time(kSecond, kBegin);
  EXPECT_EQ(clock.due(kSecond), std::nullopt);
  EXPECT_EQ(clock.time_ns(kBegin + milliseconds(9000)), kSecond);
  clock.set_paused(false, kBegin + milliseconds(9000));
  EXPECT_EQ(clock.due(2 * kSecond), kBegin + milliseconds(10000));
  clock.set_paused(true, kBegin + milliseconds(9500));
  EXPECT_EQ(clock.time_ns(kBegin + milliseconds(20000)), 3 * kSecond / 2);
}

}  // namespace
}  // namespace tileflight::publishing::playback_clock_test
