#include "tileflight/tiles/fetch/cache_control.h"

#include <gtest/gtest.h>

namespace tileflight::fetch::cache_control_test {
namespace {

constexpr std::int64_t kNow = 784111777;                    // Unix time of kDate
const std::string kDate = "Sun, 06 Nov 1994 08:49:37 GMT";  // RFC 9110, section 5.6.7
const std::string kTenMinutesLater = "Sun, 06 Nov 1994 08:59:37 GMT";
const std::string kTenHoursBefore = "Sat, 05 Nov 1994 22:49:37 GMT";
const std::string kYearsBefore = "Sun, 06 Nov 1983 08:49:37 GMT";

Freshness judged(const HttpHeaders& headers) { return evaluate_freshness(headers, kNow, kNow); }
std::int64_t lifetime_s(const HttpHeaders& headers) { return judged(headers).fresh_until_s - kNow; }

TEST(CacheControl, Directives) {
  const auto directives = parse_cache_control("Max-Age=60, private=\"a, b\" ,NO-STORE,,max-age=5");
  EXPECT_EQ(directives.size(), 3U);
  EXPECT_EQ(directives.at("max-age"), "60");
  EXPECT_EQ(directives.at("private"), "a, b");
  EXPECT_EQ(directives.at("no-store"), "");
  EXPECT_TRUE(parse_cache_control("").empty());
  EXPECT_EQ(parse_cache_control("a=\"unclosed").size(), 1U);
}

TEST(CacheControl, Lifetimes) {
  EXPECT_EQ(lifetime_s({{"cache-control", "max-age=60"}}), 60);
  EXPECT_EQ(lifetime_s({{"cache-control", "max-age=60"}, {"expires", kTenMinutesLater}, {"date", kDate}}), 60);
  EXPECT_EQ(lifetime_s({{"cache-control", "max-age=sixty"}, {"expires", kTenMinutesLater}}), 0);
  EXPECT_EQ(lifetime_s({{"cache-control", "max-age=99999999999999999999"}}), std::int64_t{1} << 31);
  EXPECT_EQ(lifetime_s({{"expires", kTenMinutesLater}, {"date", kDate}}), 600);
  EXPECT_EQ(lifetime_s({{"expires", "0"}}), 0) << "a common way to say: at once";
  EXPECT_EQ(lifetime_s({{"last-modified", kTenHoursBefore}}), 3600) << "a tenth of ten hours";
  EXPECT_EQ(lifetime_s({{"last-modified", kYearsBefore}}), 24 * 3600) << "a day at most";
  EXPECT_EQ(lifetime_s({{"cache-control", "no-cache, max-age=60"}}), 0);
  EXPECT_EQ(lifetime_s({}), 0);
}

TEST(CacheControl, AgeIsTakenOff) {
  EXPECT_EQ(lifetime_s({{"cache-control", "max-age=60"}, {"age", "20"}}), 40);
  EXPECT_EQ(lifetime_s({{"cache-control", "max-age=60"}, {"age", "x"}}), 60);
  EXPECT_EQ(evaluate_freshness({{"cache-control", "max-age=60"}}, kNow - 5, kNow).fresh_until_s, kNow + 55)
      << "the way here";
  EXPECT_EQ(evaluate_freshness({{"cache-control", "max-age=60"}, {"date", kDate}}, kNow + 50, kNow + 50).fresh_until_s,
            kNow + 60)
      << "it was made 50 s ago";
}

TEST(CacheControl, WhatMayBeStored) {
  EXPECT_TRUE(judged({{"cache-control", "max-age=60"}}).may_store);
  EXPECT_TRUE(judged({{"cache-control", "private, max-age=60"}}).may_store);
  EXPECT_TRUE(judged({{"cache-control", "no-cache"}, {"etag", "\"1\""}}).may_store) << "to be asked about";
  EXPECT_TRUE(judged({{"last-modified", kDate}}).may_store);
  EXPECT_FALSE(judged({{"cache-control", "no-store, max-age=60"}, {"etag", "\"1\""}}).may_store);
  EXPECT_FALSE(judged({{"cache-control", "max-age=60"}, {"vary", "*"}}).may_store);
  EXPECT_FALSE(judged({}).may_store) << "of no use";
  EXPECT_TRUE(judged({{"cache-control", "max-age=60, must-revalidate"}}).must_revalidate);
  EXPECT_TRUE(judged({{"cache-control", "no-cache"}}).must_revalidate);
  EXPECT_FALSE(judged({{"cache-control", "max-age=60"}}).must_revalidate);
}

TEST(CacheControl, AnAnswerOfNotModifiedRenewsWhatItSays) {
  const HttpHeaders stored = {
      {"cache-control", "max-age=60"}, {"etag", "\"1\""}, {"age", "50"}, {"date", kTenHoursBefore}};
  const HttpHeaders updated = merge_headers(stored, {{"cache-control", "max-age=90"}, {"x-other", "1"}});
  EXPECT_EQ(updated, (HttpHeaders{{"cache-control", "max-age=90"}, {"etag", "\"1\""}}));
  EXPECT_EQ(merge_headers(stored, {}).at("cache-control"), "max-age=60");
}

}  // namespace
}  // namespace tileflight::fetch::cache_control_test
