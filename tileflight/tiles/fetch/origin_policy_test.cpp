#include "tileflight/tiles/fetch/origin_policy.h"

#include <gmock/gmock.h>

#include "tileflight/tiles/fetch/test_tilesets.h"

namespace tileflight::fetch::origin_policy_test {
namespace {

using base::test_support::error_of;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(OriginPolicy, OriginsAreReadAsTheClientReadsThem) {
  EXPECT_EQ(parse_origin("HTTPS://Example.org/a"), (Origin{"https", "example.org", "443"}));
  EXPECT_EQ(parse_origin("http://[::1]:81/a"), (Origin{"http", "[::1]", "81"}));
  EXPECT_THAT(base::test_support::error_of([] { parse_origin("http://user:SECRET@host/"); }),
              ::testing::AllOf(HasSubstr("user name"), Not(HasSubstr("SECRET"))));
  EXPECT_THAT(base::test_support::error_of([] { parse_origin("a/b.glb"); }), HasSubstr("not an http"));
  EXPECT_THAT(base::test_support::error_of([] { parse_origin("http://"); }), HasSubstr("not a valid URL"));
}

TEST(OriginPolicy, OnlyTheOwnOrigin) {
  const OriginPolicy policy("http://example.org/place/tileset.json");
  for (const char* url : {"http://example.org/x.glb", "http://EXAMPLE.org:80/x", "https://example.org/x"}) {
    EXPECT_EQ(base::test_support::error_of([&] { policy.check(url); }), "") << url;
    EXPECT_TRUE(policy.is_same_origin(url)) << url;
  }
  for (const char* url : {"http://other.org/x", "http://example.org.evil.org/x", "http://example.org:81/x",
                          "https://example.org:8443/x", "http://sub.example.org/x", "http://127.0.0.1/x"}) {
    EXPECT_THAT(base::test_support::error_of([&] { policy.check(url); }), HasSubstr("--allow-host")) << url;
    EXPECT_FALSE(policy.is_same_origin(url)) << url;
  }
  for (const char* url : {"file:///etc/passwd", "ftp://example.org/x", "gopher://example.org/x", "javascript:x"}) {
    EXPECT_THAT(base::test_support::error_of([&] { policy.check(url); }), HasSubstr("may not name")) << url;
  }
}

TEST(OriginPolicy, NeverBackToPlainHttp) {
  const OriginPolicy policy("https://example.org/tileset.json", {"cdn.org"});
  EXPECT_THAT(base::test_support::error_of([&] { policy.check("http://example.org/x"); }),
              HasSubstr("without encryption"));
  EXPECT_THAT(base::test_support::error_of([&] { policy.check("http://cdn.org/x"); }), HasSubstr("without encryption"));
  EXPECT_EQ(base::test_support::error_of([&] { policy.check("https://cdn.org/x"); }), "");
}

TEST(OriginPolicy, AllowedHostsGetRequestsButNoCredentials) {
  const OriginPolicy policy("http://example.org/tileset.json", {"CDN.org", "other.org:8080"});
  for (const char* url : {"http://cdn.org/x", "https://cdn.org:444/x", "http://other.org:8080/x"}) {
    EXPECT_EQ(base::test_support::error_of([&] { policy.check(url); }), "") << url;
    EXPECT_FALSE(policy.is_same_origin(url)) << url;
  }
  EXPECT_NE(base::test_support::error_of([&] { policy.check("http://other.org/x"); }), "") << "another port";
}

}  // namespace
}  // namespace tileflight::fetch::origin_policy_test
