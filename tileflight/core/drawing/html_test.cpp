#include "tileflight/core/drawing/html.h"

#include <gtest/gtest.h>

#include "tileflight/core/base/files.h"

namespace tileflight::drawing::html_test {
namespace {

TEST(Html, TextIsEscaped) {
  EXPECT_EQ(text(R"(<b a="1" c='2'> & more)").str(), "&lt;b a=&quot;1&quot; c=&#39;2&#39;&gt; &amp; more");
}

TEST(Html, WhatStandsBetweenBackticksIsCode) {
  EXPECT_EQ(text_with_code("try `a <b>` or `c`.").str(), "try <code>a &lt;b&gt;</code> or <code>c</code>.");
  EXPECT_EQ(text_with_code("one ` alone").str(), "one ` alone");
  EXPECT_EQ(text_with_code("`x` and ` alone").str(), "<code>x</code> and ` alone");
  EXPECT_EQ(text_with_code("").str(), "");
}

TEST(Html, AttributesAreEscaped) {
  EXPECT_EQ(element("a", {{"title", "\"><script>"}}, text("x")).str(), "<a title=\"&quot;&gt;&lt;script&gt;\">x</a>");
  EXPECT_EQ(empty_element("img", {{"alt", "a&b"}}).str(), "<img alt=\"a&amp;b\"/>");
}

TEST(Html, BytesThatNoPageMayHoldAreReplaced) {
  const std::string bad = "\xEF\xBF\xBD";
  EXPECT_EQ(text(std::string("a\0b", 3)).str(), "a" + bad + "b");
  EXPECT_EQ(text("\x1B[31m").str(), bad + "[31m");
  EXPECT_EQ(text("\xFF").str(), bad);
  EXPECT_EQ(text("\xC3").str(), bad);                      // a sequence cut short
  EXPECT_EQ(text("\xC0\xAF").str(), bad + bad);            // an overlong form of '/'
  EXPECT_EQ(text("\xED\xA0\x80").str(), bad + bad + bad);  // a surrogate
  EXPECT_EQ(text("\xF4\x90\x80\x80").str(), bad + bad + bad + bad);
  EXPECT_EQ(text("\xEF\xBF\xBF").str(), bad);  // U+FFFF
}

TEST(Html, OtherTextStaysAsItIs) {
  const std::string plain = "Quito, Machángara \u2013 \u4E2D\u6587 \U0001F681\n\ttab";
  EXPECT_EQ(text(plain).str(), plain);
}

TEST(Html, DataUriIsBase64) {
  // RFC 4648, section 10.
  const std::pair<const char*, const char*> vectors[] = {{"", ""},
                                                         {"f", "Zg=="},
                                                         {"fo", "Zm8="},
                                                         {"foo", "Zm9v"},
                                                         {"foob", "Zm9vYg=="},
                                                         {"fooba", "Zm9vYmE="},
                                                         {"foobar", "Zm9vYmFy"}};
  for (const auto& [bytes, encoded] : vectors)
    EXPECT_EQ(data_uri("image/png", bytes), std::string("data:image/png;base64,") + encoded);
  EXPECT_EQ(data_uri("a/b", std::string("\xFF\xFE\x00", 3)), "data:a/b;base64,//4A");
}

}  // namespace
}  // namespace tileflight::drawing::html_test
