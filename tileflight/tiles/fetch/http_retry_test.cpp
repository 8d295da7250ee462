#include "tileflight/tiles/fetch/http_retry.h"

#include <gtest/gtest.h>

namespace tileflight::fetch::http_retry_test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

TEST(HttpRetry, RetryAfterInBothForms) {
  constexpr std::time_t kNow = 784111777;  // Sun, 06 Nov 1994 08:49:37 GMT
  EXPECT_EQ(parse_retry_after("120", kNow), seconds(120));
  EXPECT_EQ(parse_retry_after(" 0 ", kNow), seconds(0));
  EXPECT_EQ(parse_retry_after("Sun, 06 Nov 1994 08:50:07 GMT", kNow), seconds(30));
  EXPECT_EQ(parse_retry_after("Sun, 06 Nov 1994 08:00:00 GMT", kNow), seconds(0)) << "has passed";
  EXPECT_EQ(parse_retry_after("99999999999999999999", kNow), seconds(1'000'000'000));
  EXPECT_EQ(parse_retry_after("soon", kNow), std::nullopt);
  EXPECT_EQ(parse_retry_after("-3", kNow), std::nullopt);
  EXPECT_EQ(parse_retry_after("", kNow), std::nullopt);
}

TEST(HttpRetry, WaitsDoubleWithinBoundsAndSpread) {
  const RetryOptions options{.initial_backoff = milliseconds(100), .max_backoff = milliseconds(1000)};
  EXPECT_EQ(backoff(options, 1, 0), milliseconds(50));
  EXPECT_EQ(backoff(options, 1, 0xFFFFFFFF), milliseconds(99));
  EXPECT_EQ(backoff(options, 3, 0), milliseconds(200));
  EXPECT_EQ(backoff(options, 3, 0x80000000), milliseconds(300));
  EXPECT_EQ(backoff(options, 60, 0), milliseconds(500)) << "no more than half of the longest, at least";
}

TEST(HttpRetry, StatusesThatMayChange) {
  for (const long status : {408, 429, 500, 502, 503, 504}) EXPECT_TRUE(is_retryable_status(status)) << status;
  for (const long status : {200, 304, 400, 401, 403, 404, 410, 501})
    EXPECT_FALSE(is_retryable_status(status)) << status;
}

}  // namespace
}  // namespace tileflight::fetch::http_retry_test
