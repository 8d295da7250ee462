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
                                                       {"//g", "http://g/"},
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

/// Cases of the tests of the WHATWG URL standard (web-platform-tests, url/resources/urltestdata.json), as far as a
/// tileset can write them: reference, base, result without fragment.
TEST(Uri, ResolvesAsBrowsersDo) {
  const std::string page = "http://example.org/foo/bar";
  struct Case {
    const char* reference;
    std::string base;
    const char* wanted;
  };
  const Case cases[] = {
      {"  \t:foo.com/  \n", page, "http://example.org/foo/:foo.com/"},
      {" foo.com  ", page, "http://example.org/foo/foo.com"},
      {"http://example\t.\norg", page, "http://example.org/"},
      {"http:foo.com", page, "http://example.org/foo/foo.com"},
      {"http:/example.com/", page, "http://example.org/example.com/"},
      {"https:foo.com", page, "https://foo.com/"},
      {"http:\\\\x:\\y\\", "", "http://x/y/"},
      {"http://f:80/c", page, "http://f/c"},
      {"https://f:443/c", page, "https://f/c"},
      {"http://f:/c", page, "http://f/c"},
      {"HTTP://ExAmPlE.CoM/A", page, "http://example.com/A"},
      {"///test", "http://example.org/", "http://test/"},
      {"//x:8080/../a", page, "http://x:8080/a"},
      {"\\\\server\\file", page, "http://server/file"},
      {"\\x", page, "http://example.org/x"},
      {"/a/ /c", page, "http://example.org/a/%20/c"},
      {"/a%2fc", page, "http://example.org/a%2fc"},
      {"http://example.com/foo%2Ehtml", "", "http://example.com/foo%2Ehtml"},
      {"http://example.com/foo/%2e%2", "", "http://example.com/foo/%2e%2"},
      {"http://example.com/foo/%2e./%2e%2e/.%2e/%2e.bar", "", "http://example.com/%2e.bar"},
      {"http://example.com////../..", "", "http://example.com//"},
      {"http://example.com/foo/bar//../..", "", "http://example.com/foo/"},
      {"http://example.com/foo/bar//..", "", "http://example.com/foo/bar/"},
      {"http://example.com/foo/bar/..", "", "http://example.com/foo/"},
      {"http://example.com/foo/%2e", "", "http://example.com/foo/"},
      {"http://example.com/foo%", "", "http://example.com/foo%"},
      {"http://example.com/foo%2zbar", "", "http://example.com/foo%2zbar"},
      {"http://example.com/foo%41%7a", "", "http://example.com/foo%41%7a"},
      {"http://example.com/(%28:%3A%29)", "", "http://example.com/(%28:%3A%29)"},
      {"http://example.com/foo\\bar", "", "http://example.com/foo/bar"},
      {"http://example.com/foo\tbar", "", "http://example.com/foobar"},
      {"http://example.com/~/a|b", "", "http://example.com/~/a|b"},
      {"http://www.google.com/foo?bar=baz# \xC2\xBB", "", "http://www.google.com/foo?bar=baz"},
      {"http://example.com/你好你好", "", "http://example.com/%E4%BD%A0%E5%A5%BD%E4%BD%A0%E5%A5%BD"},
      {"http://host/ \"<>`{}?a \"<>'`{}", "", "http://host/%20%22%3C%3E%60%7B%7D?a%20%22%3C%3E%27`{}"},
      {"http://host/?'", "", "http://host/?%27"},
      {"?a=b&c=d", "http://example.org/foo/bar?x", "http://example.org/foo/bar?a=b&c=d"},
      {"?a\\b", page, "http://example.org/foo/bar?a\\b"},
      {"my tile.glb", "http://h/files/tileset.json", "http://h/files/my%20tile.glb"},
      {"x y.json", "HTTP://H:80", "http://h/x%20y.json"}};
  for (const auto& [reference, base, wanted] : cases) {
    EXPECT_EQ(resolve_uri(base, reference), wanted) << reference << " in " << base;
  }
}

/// Folders and archives get the same file as a server would be asked for.
TEST(Uri, ARelativeBaseNamesTheSameFileAsAUrl) {
  const std::pair<const char*, const char*> cases[] = {{"my tile.glb", "sub/my tile.glb"},
                                                       {"my%20tile.glb", "sub/my tile.glb"},
                                                       {" a.glb\n", "sub/a.glb"},
                                                       {"x\\a.glb?v=1#s", "sub/x/a.glb"},
                                                       {"%2e%2E/a.glb", "a.glb"},
                                                       {"100%.glb", "sub/100%.glb"},
                                                       {"\xC3\x84.glb", "sub/\xC3\x84.glb"},
                                                       {"x/.%2e/./a.glb", "sub/a.glb"}};
  for (const auto& [reference, wanted] : cases) {
    EXPECT_EQ(uri_path(resolve_uri("sub/tileset.json", reference)), wanted) << reference;
    EXPECT_EQ(uri_path(resolve_uri("https://h/sub/tileset.json", reference)), "/" + std::string(wanted)) << reference;
  }
}

TEST(Uri, QueryParametersOfATilesetArePassedOn) {
  const std::string inner = "http://h/q/sub/tileset.json?session=S&v=2";
  EXPECT_EQ(resolve_in_tileset(inner, "a.glb"), "http://h/q/sub/a.glb?session=S&v=2");
  EXPECT_EQ(resolve_in_tileset(inner, "a.glb?v=3"), "http://h/q/sub/a.glb?v=3&session=S");
  EXPECT_EQ(resolve_in_tileset(inner, "http://H:80/a.glb"), "http://h/a.glb?session=S&v=2");
  EXPECT_EQ(resolve_in_tileset(inner, "https://h/a.glb"), "https://h/a.glb") << "another origin";
  EXPECT_EQ(resolve_in_tileset(inner, "//other/a.glb"), "http://other/a.glb");
  EXPECT_EQ(resolve_in_tileset("http://h/t.json?versionId=7&k=1", "a.glb"), "http://h/a.glb?k=1") << "of one object";
  EXPECT_EQ(resolve_in_tileset("sub/t.json?v=2", "a.glb"), "sub/a.glb");
  EXPECT_EQ(resolve_in_tileset(inner, "data:,x"), "data:,x");
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
  EXPECT_EQ(uri_path("100%.glb"), "100%.glb");
  EXPECT_EQ(uri_path("a%2"), "a%2");
  EXPECT_EQ(uri_path("a%zz"), "a%zz");
  EXPECT_THAT(base::test_support::error_of([] { uri_path("a%00.glb"); }), HasSubstr("zero byte"));
}

TEST(Uri, Data) {
  EXPECT_EQ(base::test_support::to_text(decode_data_uri("data:text/plain,a%20b", "x")), "a b");
  EXPECT_EQ(base::test_support::to_text(decode_data_uri("data:;base64,Zm9vYmE=", "x")), "fooba");
  EXPECT_EQ(base::test_support::to_text(decode_data_uri("data:;base64,Zm9v\r\n YmE=\n", "x")), "fooba");
  EXPECT_EQ(base::test_support::to_text(decode_data_uri("DATA:application/octet-stream;base64,Zm9vYg", "x")), "foob");
  EXPECT_THAT(base::test_support::error_of([] { decode_data_uri("data:;base64,Zm9*", "x"); }), HasSubstr("base64"));
  EXPECT_THAT(base::test_support::error_of([] { decode_data_uri("data:;base64", "x"); }), HasSubstr("comma"));
}

}  // namespace
}  // namespace tileflight::fetch::uri_test
