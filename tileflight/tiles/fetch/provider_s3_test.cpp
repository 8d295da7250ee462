#include "tileflight/tiles/fetch/provider_s3.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <sstream>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/tiles/fetch/open_source.h"
#include "tileflight/tiles/fetch/test_http_server.h"
#include "tileflight/tiles/fetch/uri.h"

namespace tileflight::fetch::provider_s3_test {
namespace {

using test_support::ServedConnection;
using test_support::ServedRequest;
using test_support::TestHttpServer;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using tests::refusal_of;

std::string bytes_of_hex(const std::string& hex) {
  std::string bytes;
  for (std::size_t i = 0; i + 1 < hex.size(); i += 2)
    bytes += static_cast<char>(std::stoi(hex.substr(i, 2), nullptr, 16));
  return bytes;
}

/// RFC 2104, as hexadecimal text.
std::string hmac_hex(std::string key, const std::string& message) {
  if (key.size() > 64) key = bytes_of_hex(base::sha256_hex(key));
  key.resize(64, '\0');
  std::string inner = key, outer = key;
  for (char& c : inner) c = static_cast<char>(c ^ 0x36);
  for (char& c : outer) c = static_cast<char>(c ^ 0x5c);
  return base::sha256_hex(outer + bytes_of_hex(base::sha256_hex(inner + message)));
}
std::string hmac(const std::string& key, const std::string& message) { return bytes_of_hex(hmac_hex(key, message)); }

std::string decoded(const std::string& text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    out += text[i] == '%' ? static_cast<char>(std::stoi(text.substr(i + 1, 2), nullptr, 16)) : text[i];
    if (text[i] == '%') i += 2;
  }
  return out;
}

/// "UriEncode" of the signature's definition.
std::string encoded(const std::string& text, bool keeps_slash) {
  std::string out;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (std::isalnum(byte) != 0 || std::string("-._~").find(c) != std::string::npos || (keeps_slash && c == '/')) {
      out += c;
    } else {
      char escape[4];
      std::snprintf(escape, sizeof escape, "%%%02X", byte);
      out += escape;
    }
  }
  return out;
}

std::string canonical_query(const std::string& target) {
  std::vector<std::string> parameters;
  std::istringstream query(target.find('?') == std::string::npos ? "" : target.substr(target.find('?') + 1));
  for (std::string parameter; std::getline(query, parameter, '&');) {
    const std::size_t equals = std::min(parameter.find('='), parameter.size());
    parameters.push_back(encoded(decoded(parameter.substr(0, equals)), false) + "=" +
                         encoded(decoded(parameter.substr(std::min(equals + 1, parameter.size()))), false));
  }
  std::ranges::sort(parameters);
  std::string out;
  for (const std::string& parameter : parameters) out += (out.empty() ? "" : "&") + parameter;
  return out;
}

std::string between(const std::string& text, const std::string& begin, const std::string& end) {
  const std::size_t at = text.find(begin);
  if (at == std::string::npos) return "";
  const std::string rest = text.substr(at + begin.size());
  return rest.substr(0, rest.find(end));
}

using Objects = std::map<std::string, std::string>;  ///< by path

/// An object store that computes each request's signature anew ("Authenticating Requests: Using the Authorization
/// Header", Amazon S3 API reference).
class ObjectStore {
 public:
  explicit ObjectStore(Objects objects)
      : objects_(std::move(objects)), server_([this](const ServedRequest& request, ServedConnection& connection) {
          return answer(request, connection);
        }) {}

  SourceOptions options() const {
    SourceOptions options;
    options.s3 = {.endpoint_url = server_.url(""),
                  .region = "eu-central-1",
                  .access_key_id = "AKIDEXAMPLE",
                  .secret_access_key = "wJalrXUtnFEMI/K7MDENG+bPxRfiCYEXAMPLEKEY",
                  .session_token = token};
    options.http.http.retry.max_tries = 1;
    return options;
  }
  const TestHttpServer& server() const { return server_; }

  std::string token;  ///< that it takes; empty: none
  std::string error = {};

 private:
  bool answer(const ServedRequest& request, ServedConnection& connection) const {
    const std::string fault = error.empty() ? fault_of(request) : error;
    if (!fault.empty()) {
      return connection.answer(403, "<?xml version=\"1.0\"?><Error><Code>" + fault +
                                        "</Code><Message>In words.</Message>" +
                                        "<AWSAccessKeyId>AKIDEXAMPLE</AWSAccessKeyId></Error>");
    }
    const auto object = objects_.find(decoded(request.path()));
    if (object == objects_.end()) return connection.answer(404, "<Error><Code>NoSuchKey</Code></Error>");
    return connection.answer(200, object->second, {"ETag: \"1\""});
  }

  std::string fault_of(const ServedRequest& request) const {
    const std::string authorization = request.header("authorization"), date = request.header("x-amz-date");
    const std::string scope = between(authorization, "Credential=AKIDEXAMPLE/", ",");
    if (scope.empty()) return "InvalidAccessKeyId";
    if (request.header("x-amz-security-token") != token) return "InvalidToken";
    if (scope != date.substr(0, 8) + "/eu-central-1/s3/aws4_request") return "AuthorizationHeaderMalformed";
    const std::string names = between(authorization, "SignedHeaders=", ",");
    for (const auto& [name, value] : request.headers) {
      if ((name == "host" || name.starts_with("x-amz-")) &&
          (";" + names + ";").find(";" + name + ";") == std::string::npos)
        return "AccessDenied";
    }
    std::string headers;
    std::istringstream list(names);
    for (std::string name; std::getline(list, name, ';');) headers += name + ":" + request.header(name) + "\n";
    const std::string payload = request.header("x-amz-content-sha256");
    if (payload != base::sha256_hex("")) return "XAmzContentSHA256Mismatch";
    const std::string canonical = request.method + "\n" + encoded(decoded(request.path()), true) + "\n" +
                                  canonical_query(request.target) + "\n" + headers + "\n" + names + "\n" + payload;
    const std::string to_sign = "AWS4-HMAC-SHA256\n" + date + "\n" + scope + "\n" + base::sha256_hex(canonical);
    std::string key = "AWS4wJalrXUtnFEMI/K7MDENG+bPxRfiCYEXAMPLEKEY";
    for (const std::string& part :
         {date.substr(0, 8), std::string("eu-central-1"), std::string("s3"), std::string("aws4_request")})
      key = hmac(key, part);
    return hmac_hex(key, to_sign) == between(authorization, "Signature=", ",") ? "" : "SignatureDoesNotMatch";
  }

  Objects objects_;
  TestHttpServer server_;
};

std::string text_at(TileSource& source, const std::string& reference) {
  const std::vector<std::byte> bytes = source.read(resolve_uri(source.root_uri(), reference));
  return std::string(base::as_text(bytes));
}

// The signature's own example ("GET Object", Amazon S3 API reference) checks this test's computation.
TEST(ObjectStore, SignsAsInTheSpecificationsExample) {
  std::string key = "AWS4wJalrXUtnFEMI/K7MDENG/bPxRfiCYEXAMPLEKEY";
  for (const char* part : {"20130524", "us-east-1", "s3", "aws4_request"}) key = hmac(key, part);
  EXPECT_EQ(hmac_hex(key,
                     "AWS4-HMAC-SHA256\n20130524T000000Z\n20130524/us-east-1/s3/aws4_request\n"
                     "7344ae5b7ee6c3e7e6b0fe0640412a37625d1fbfff95c48bbb2dc43964946972"),
            "f0e8bdb87c964420e857bd35b5d6ed310bd44f0170aba48dd91039c6036bdb41");
}

TEST(S3, ReadsWithValidSignaturesWhateverTheKeysAre) {
  for (const std::string token : {"", "FwoGZXIvYXdzEXAMPLE//token=="}) {
    ObjectStore store(Objects{{"/city/a b/tileset.json", "{}"},
                              {"/city/a b/0.glb", "zero"},
                              {"/city/a b/x (1)+~'!*,;=@$:é.glb", "odd"},
                              {"/city/other.glb", "other"}});
    store.token = token;
    const auto source = open_source("s3://city/a b/", store.options());
    EXPECT_EQ(text_at(*source, "tileset.json"), "{}");
    EXPECT_EQ(text_at(*source, "0.glb"), "zero");
    EXPECT_EQ(text_at(*source, "0.glb?v=1"), "zero");
    EXPECT_EQ(text_at(*source, "0.glb?b=2&a=1&flag"), "zero");
    EXPECT_EQ(text_at(*source, "x%20(1)+~'!*,;=@$:%C3%A9.glb"), "odd");
    EXPECT_EQ(text_at(*source, "x%20(1)+%7e'!*,;=@$:%c3%a9.glb"), "odd");
    EXPECT_EQ(text_at(*source, "../other.glb"), "other");
    EXPECT_THAT(refusal_of([&] { text_at(*source, "none.glb"); }), HasSubstr("404 (not found): NoSuchKey"));
    EXPECT_THAT(refusal_of([&] { text_at(*source, "../../bills/0.glb"); }), HasSubstr("lies outside the bucket city"));
  }
}

TEST(S3, ValidatesItsCacheWithSignedRequests) {
  const tests::TemporaryFolder folder;
  ObjectStore store(Objects{{"/city/tileset.json", "{\"a\": 1}"}});
  SourceOptions options = store.options();
  options.cache_folder = folder.path();
  for (int i = 0; i < 2; ++i)
    EXPECT_EQ(text_at(*open_source("s3://city/tileset.json", options), "tileset.json"), "{\"a\": 1}");
  ASSERT_EQ(store.server().requests().size(), 2U);
  EXPECT_EQ(store.server().requests().back().header("if-none-match"), "\"1\"");
}

TEST(S3, SaysInOneLineWhatToDoAboutItsKeys) {
  ObjectStore store(Objects{{"/city/tileset.json", "{}"}});
  const auto refusal = [&](const std::function<void(S3Options&)>& change) {
    SourceOptions options = store.options();
    change(options.s3);
    const std::string text =
        refusal_of([&] { text_at(*open_source("s3://city/tileset.json", options), "tileset.json"); });
    EXPECT_THAT(text, AllOf(Not(HasSubstr("wJalr")), Not(HasSubstr("FwoG")), Not(HasSubstr("\n"))));
    return text;
  };
  EXPECT_THAT(refusal([](S3Options& s3) { s3.access_key_id = ""; }),
              HasSubstr("needs AWS_ACCESS_KEY_ID in the environment"));
  EXPECT_THAT(refusal([](S3Options& s3) { s3.access_key_id = s3.secret_access_key = ""; }),
              HasSubstr("needs AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY in"));
  EXPECT_THAT(refusal([](S3Options& s3) { s3.endpoint_url = s3.region = ""; }), HasSubstr("needs AWS_REGION"));
  EXPECT_THAT(refusal([](S3Options& s3) { s3.endpoint_url = "ftp://host"; }), HasSubstr("AWS_ENDPOINT_URL: must be"));
  EXPECT_THAT(refusal([](S3Options& s3) { s3.access_key_id = "AKIDOTHER"; }),
              HasSubstr("InvalidAccessKeyId, In words. (check AWS_ACCESS_KEY_ID)"));
  EXPECT_THAT(refusal([](S3Options& s3) { s3.secret_access_key += "x"; }),
              HasSubstr("SignatureDoesNotMatch, In words. (check AWS_SECRET_ACCESS_KEY)"));
  EXPECT_THAT(refusal([](S3Options& s3) { s3.session_token = "FwoGZXIvYXdz"; }), HasSubstr("check AWS_SESSION_TOKEN"));
  EXPECT_THAT(refusal([](S3Options& s3) { s3.region = "us-east-1"; }), HasSubstr("check AWS_REGION"));
  store.error = "ExpiredToken";
  EXPECT_THAT(refusal([](S3Options&) {}), HasSubstr("AWS_SESSION_TOKEN has expired: obtain new keys"));
  EXPECT_THAT(refusal_of([&] { open_source("s3://city", store.options()); }), Not(HasSubstr("form")));
  EXPECT_THAT(refusal_of([&] { open_source("s3://b?x/k", store.options()); }),
              HasSubstr("must have the form s3://BUCKET/KEY"));
}

TEST(S3, KeysGoToNobodyElse) {
  TestHttpServer other([](const ServedRequest&, ServedConnection& connection) { return connection.answer(200, "{}"); });
  TestHttpServer store([&](const ServedRequest& request, ServedConnection& connection) {
    if (request.path().ends_with("moved.glb"))
      return connection.answer(307, "", {"Location: " + other.url("/moved.glb")});
    return connection.answer(200, "{}");
  });
  SourceOptions options;
  options.s3 = {store.url("/base/"), "", "AKIDEXAMPLE", "secret", ""};
  options.http.allowed_hosts = {other.host()};
  const auto source = open_source("s3://city/", options);
  EXPECT_EQ(text_at(*source, "tileset.json"), "{}");
  EXPECT_EQ(store.requests().front().path(), "/base/city/tileset.json");
  EXPECT_THAT(store.requests().front().header("authorization"), HasSubstr("/us-east-1/s3/"));
  EXPECT_THAT(refusal_of([&] { text_at(*source, "moved.glb"); }),
              HasSubstr("its signature is not valid: check AWS_REGION"));
  EXPECT_TRUE(other.requests().empty());
  EXPECT_EQ(text_at(*source, other.url("/tile.glb")), "{}");
  EXPECT_EQ(other.requests().front().header("authorization"), "");
}

TEST(S3, IsAddressedByHostAtAmazons) {
  HttpClient client;
  const auto root = [&](const std::string& source, const std::string& region) {
    return S3Provider(source, {"", region, "AKIDEXAMPLE", "secret", ""}).resolve_root_url(client);
  };
  EXPECT_EQ(root("s3://city/a/", "eu-west-1"), "https://city.s3.eu-west-1.amazonaws.com/a/tileset.json");
  EXPECT_EQ(root("s3://city.org/50%/t.json", "eu-west-1"), "https://s3.eu-west-1.amazonaws.com/city.org/50%25/t.json");
  EXPECT_EQ(root("s3://city/t.json", "cn-north-1"), "https://city.s3.cn-north-1.amazonaws.com.cn/t.json");
  EXPECT_TRUE(is_network_source("s3://city/t.json"));
  EXPECT_EQ(redact_source("s3://city/t.json"), "s3://city/t.json");
}

}  // namespace
}  // namespace tileflight::fetch::provider_s3_test
