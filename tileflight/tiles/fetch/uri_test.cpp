#include "tileflight/tiles/fetch/uri.h"

#include <gmock/gmock.h>

#include "tileflight/tiles/fetch/test_tilesets.h"

namespace tileflight::fetch::uri_test {
namespace {

using base::test_support::error_of;
using base::test_support::to_text;
using ::testing::HasSubstr;

/// RFC 3986, section 5.4, as far as a tileset can write it (fragments are dropped).
TEST(Uri, ResolvesTheExamplesOfTheStandard) {
  const std::string base = "http://a/b/c/d;p?q";
  const std::pair<const char*, const char*> cases[] = {{"g:h", "g:h"},
                                                       {"g", "http://a/b/c/g"},
                                                       {"./g", "http://a/b/c/g"},
                                                       {"g/", "http://a/b/c/g/"},
                                                       {"/g", "http://a/g"},
                                                       {"//g", "http://g"},
                                                       {"?y", "http://a/b/c/d;p?y"},
                                                       {"g?y", "http://a/b/c/g?y"},
                                                       {"g#s", "http://a/b/c/g"},
                                                       {";x", "http://a/b/c/;x"},
                                                       {"", "http://a/b/c/d;p?q"},
                                                       {".", "http://a/b/c/"},
                                                       {"./", "http://a/b/c/"},
                                                       {"..", "http://a/b/"},
                                                       {"../", "http://a/b/"},
                                                       {"../g", "http://a/b/g"},
                                                       {"../..", "http://a/"},
                                                       {"../../g", "http://a/g"},
                                                       {"../../../g", "http://a/g"},
                                                       {"/./g", "http://a/g"},
                                                       {"/../g", "http://a/g"},
                                                       {"g.", "http://a/b/c/g."},
                                                       {"..g", "http://a/b/c/..g"},
                                                       {"./../g", "http://a/b/g"},
                                                       {"./g/.", "http://a/b/c/g/"},
                                                       {"g/./h", "http://a/b/c/g/h"},
                                                       {"g/../h", "http://a/b/c/h"},
                                                       {"g;x=1/../y", "http://a/b/c/y"},
                                                       {"g?y/./x", "http://a/b/c/g?y/./x"}};
  for (const auto& [reference, wanted] : cases) EXPECT_EQ(resolve_uri(base, reference), wanted) << reference;
}

TEST(Uri, KeepsWhatLeavesARelativeBase) {
  EXPECT_EQ(resolve_uri("tileset.json", "0/0.b3dm"), "0/0.b3dm");
  EXPECT_EQ(resolve_uri("sub/tileset.json", "../a.glb"), "a.glb");
  EXPECT_EQ(resolve_uri("sub/tileset.json", "../../a.glb"), "../a.glb");
  EXPECT_EQ(resolve_uri("sub/tileset.json", "sub2\\a.glb"), "sub/sub2/a.glb");
  EXPECT_EQ(resolve_uri("sub/tileset.json", "/etc/passwd"), "/etc/passwd");
}

TEST(Uri, PathAndEnding) {
  EXPECT_EQ(uri_path("a%20b/%C3%A9.glb?key=1#x"), "a b/\xC3\xA9.glb");
  EXPECT_EQ(uri_extension("a.b/c.B3DM?v=1.2"), "b3dm");
  EXPECT_EQ(uri_extension("a.b/c"), "");
  EXPECT_THAT(base::test_support::error_of([] { uri_path("a%2"); }), HasSubstr("hexadecimal"));
  EXPECT_THAT(base::test_support::error_of([] { uri_path("a%zz"); }), HasSubstr("hexadecimal"));
  EXPECT_THAT(base::test_support::error_of([] { uri_path("a%00.glb"); }), HasSubstr("zero byte"));
}

TEST(Uri, Data) {
  EXPECT_EQ(base::test_support::to_text(decode_data_uri("data:text/plain,a%20b", "x")), "a b");
  EXPECT_EQ(base::test_support::to_text(decode_data_uri("data:;base64,Zm9vYmE=", "x")), "fooba");
  EXPECT_EQ(base::test_support::to_text(decode_data_uri("DATA:application/octet-stream;base64,Zm9vYg", "x")), "foob");
  EXPECT_THAT(base::test_support::error_of([] { decode_data_uri("data:;base64,Zm9*", "x"); }), HasSubstr("base64"));
  EXPECT_THAT(base::test_support::error_of([] { decode_data_uri("data:;base64", "x"); }), HasSubstr("comma"));
}

}  // namespace
}  // namespace tileflight::fetch::uri_test
