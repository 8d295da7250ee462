#include "tileflight/tiles/fetch/url_secrets.h"

#include <gmock/gmock.h>

#include "tileflight/tiles/fetch/uri.h"

namespace tileflight::fetch::url_secrets_test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(UrlSecrets, MessagesHideKeysSessionsTokensAndPasswords) {
  EXPECT_EQ(redact_url("https://h/a.glb?session=abc&v=2&key=SECRET"), "https://h/a.glb?session=…&v=2&key=…");
  EXPECT_EQ(redact_url("https://user:pw@h/a?X-Amz-Signature=1&access_token=2&flag#part"),
            "https://…@h/a?X-Amz-Signature=…&access_token=…&flag");
  EXPECT_EQ(redact_url("https://h/a?q=abcdefghijklmnopqrstuvwxyz0123456789"), "https://h/a?q=…") << "may be a token";
  EXPECT_EQ(redact_url("https://h/a@b/c.glb"), "https://h/a@b/c.glb") << "no user name";
  EXPECT_EQ(redact_url("sub/a.glb"), "sub/a.glb");
}

TEST(UrlSecrets, UrisInMessagesAreRedactedAndCut) {
  EXPECT_EQ(uri_for_message("https://h/a.glb?key=SECRET"), "https://h/a.glb?key=…");
  EXPECT_THAT(uri_for_message("https://h/" + std::string(300, 'x') + "?key=SECRET"), Not(HasSubstr("SECRET")));
}

TEST(UrlSecrets, ContentIsNamedWithoutThem) {
  EXPECT_EQ(remove_secrets("https://h/a.glb?session=abc&v=2&key=SECRET#part"), "https://h/a.glb?v=2");
  EXPECT_EQ(remove_secrets("https://user:pw@h/a.glb?key=SECRET"), "https://h/a.glb");
  EXPECT_EQ(remove_secrets("https://h/a?x=1&y&keyed=2"), "https://h/a?x=1&y&keyed=2") << "what selects content stays";
}

TEST(UrlSecrets, ParametersAreFoundAndAdded) {
  EXPECT_EQ(query_value("https://h/a?x=1&session=CIq&y=2#f", "session"), "CIq");
  EXPECT_EQ(query_value("https://h/a?xsession=1", "session"), "");
  EXPECT_EQ(query_value("https://h/a", "session"), "");
  EXPECT_EQ(add_query_parameter("https://h/a", "key", "1"), "https://h/a?key=1");
  EXPECT_EQ(add_query_parameter("https://h/a?v=2#f", "key", "1"), "https://h/a?v=2&key=1");
  EXPECT_EQ(inherit_query_parameters("https://h/a?v=3", "https://h/root.json?v=2&sig=x&se=1"),
            "https://h/a?v=3&sig=x&se=1");
}

TEST(UrlSecrets, TextsAreScrubbed) {
  EXPECT_EQ(find_secrets("https://h/a?v=1&key=AAA&session=BBB"), (std::vector<std::string>{"AAA", "BBB"}));
  EXPECT_EQ(mask_secrets("consumer AAA, AAA and BBB", {"AAA", "", "BBB"}), "consumer …, … and …");
}

}  // namespace
}  // namespace tileflight::fetch::url_secrets_test
