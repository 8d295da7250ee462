#include "tileflight/tiles/origin_policy.h"

#include <gmock/gmock.h>

#include "tileflight/tiles/test_tilesets.h"

namespace tileflight::tiles {
namespace {

using testing::error_of;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(OriginPolicy, origins_are_read_as_the_client_reads_them) {
  EXPECT_EQ(origin_of("HTTPS://Example.org/a"), (Origin{"https", "example.org", "443"}));
  EXPECT_EQ(origin_of("http://[::1]:81/a"), (Origin{"http", "[::1]", "81"}));
  EXPECT_THAT(error_of([] { origin_of("http://user:SECRET@host/"); }),
              ::testing::AllOf(HasSubstr("user name"), Not(HasSubstr("SECRET"))));
  EXPECT_THAT(error_of([] { origin_of("a/b.glb"); }), HasSubstr("not an http"));
  EXPECT_THAT(error_of([] { origin_of("http://"); }), HasSubstr("not a URL"));
}

TEST(OriginPolicy, only_the_own_origin) {
  const OriginPolicy policy("http://example.org/place/tileset.json");
  for (const char* url : {"http://example.org/x.glb", "http://EXAMPLE.org:80/x", "https://example.org/x"}) {
    EXPECT_EQ(error_of([&] { policy.check(url); }), "") << url;
    EXPECT_TRUE(policy.is_own(url)) << url;
  }
  for (const char* url : {"http://other.org/x", "http://example.org.evil.org/x", "http://example.org:81/x",
                          "https://example.org:8443/x", "http://sub.example.org/x", "http://127.0.0.1/x"}) {
    EXPECT_THAT(error_of([&] { policy.check(url); }), HasSubstr("--allow-host")) << url;
    EXPECT_FALSE(policy.is_own(url)) << url;
  }
  for (const char* url : {"file:///etc/passwd", "ftp://example.org/x", "gopher://example.org/x", "javascript:x"}) {
    EXPECT_THAT(error_of([&] { policy.check(url); }), HasSubstr("may not name")) << url;
  }
}

TEST(OriginPolicy, never_back_to_plain_http) {
  const OriginPolicy policy("https://example.org/tileset.json", {"cdn.org"});
  EXPECT_THAT(error_of([&] { policy.check("http://example.org/x"); }), HasSubstr("without encryption"));
  EXPECT_THAT(error_of([&] { policy.check("http://cdn.org/x"); }), HasSubstr("without encryption"));
  EXPECT_EQ(error_of([&] { policy.check("https://cdn.org/x"); }), "");
}

TEST(OriginPolicy, allowed_hosts_get_requests_but_no_credentials) {
  const OriginPolicy policy("http://example.org/tileset.json", {"CDN.org", "other.org:8080"});
  for (const char* url : {"http://cdn.org/x", "https://cdn.org:444/x", "http://other.org:8080/x"}) {
    EXPECT_EQ(error_of([&] { policy.check(url); }), "") << url;
    EXPECT_FALSE(policy.is_own(url)) << url;
  }
  EXPECT_NE(error_of([&] { policy.check("http://other.org/x"); }), "") << "another port";
}

}  // namespace
}  // namespace tileflight::tiles
