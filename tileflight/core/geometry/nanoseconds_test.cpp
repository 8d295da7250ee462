#include "tileflight/core/geometry/nanoseconds.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "tests/refusal.h"

namespace tileflight::geometry::nanoseconds_test {
namespace {

TEST(Nanoseconds, SecondsComeBackToTheLastBit) {
  std::mt19937_64 random(7);
  for (const double largest_s : {1e-3, 1.0, 1e5, 2e9, 9e9}) {
    std::uniform_real_distribution<double> times(-largest_s, largest_s);
    for (int k = 0; k < 2000; ++k) {
      // Nanoseconds hold no finer times.
      const double time_s = to_seconds(to_nanoseconds(times(random)));
      EXPECT_EQ(to_seconds(to_nanoseconds(time_s)), time_s);
    }
  }
}

TEST(Nanoseconds, SmallNumbersAndEurocsComeBackAsTheyWere) {
  for (const std::int64_t time_ns : {0LL, 1LL, -1LL, 2500000000LL, -1500000001LL, 1403715274262142976LL})
    EXPECT_EQ(to_nanoseconds(to_seconds(time_ns)), time_ns);
}

TEST(Nanoseconds, DecimalsAreTheNearestDoubles) {
  EXPECT_EQ(to_seconds(207793500), 0.2077935);
  EXPECT_EQ(to_seconds(415494000), 0.415494);
  EXPECT_EQ(to_seconds(1305031102175304000), 1305031102.175304);
}

TEST(Nanoseconds, TimesTooLargeAreRefused) {
  for (const double time_s : {1e300, -1e10, std::nan("")})
    EXPECT_THAT(tests::refusal_of([&] { to_nanoseconds(time_s); }), testing::HasSubstr("is too large"));
}

}  // namespace
}  // namespace tileflight::geometry::nanoseconds_test
