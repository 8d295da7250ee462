#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/temporary_folder.h"
#include "tileflight/tiles/fetch/http_source.h"
#include "tileflight/tiles/fetch/provider_google.h"
#include "tileflight/tiles/fetch/provider_ion.h"
#include "tileflight/tiles/fetch/url_secrets.h"
#include "tileflight/tiles/tileset/load.h"
#include "tileflight/tiles/tileset/test_http_tileset.h"

/// Each provider against a small server that speaks its protocol.
namespace tileflight::tileset::providers_test {
namespace {

using base::test_support::error_of;
using fetch::test_support::ServedConnection;
using fetch::test_support::ServedRequest;
using fetch::test_support::TestHttpServer;
using std::chrono::hours;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

std::string tile_with_copyright(const std::string& copyright) {
  fetch::test_support::GltfWriter writer;
  writer.add_primitive(
      {{"attributes", {{"POSITION", writer.add_accessor(std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0}, 3)}}}});
  writer.json()["asset"]["copyright"] = copyright;
  return writer.glb();
}

/// Serves a root with a session, which its tiles require in addition to the key.
class GoogleServer {
 public:
  static constexpr const char* kKey = "AIzaSECRETKEY";

  GoogleServer() : server_([this](const ServedRequest& r, ServedConnection& c) { return answer(r, c); }) {}

  void end_session() { session_ok_ = false; }
  int roots() const { return roots_; }
  TestHttpServer& server() { return server_; }
  std::string root() const { return server_.url("/v1/3dtiles/root.json"); }
  std::string tile_url(const std::string& name) const { return server_.url("/v1/3dtiles/datasets/CgA/files/" + name); }
  std::string session() const { return "CIqhSESSION" + std::to_string(roots_); }

 private:
  bool answer(const ServedRequest& request, ServedConnection& connection) {
    if (fetch::query_value(request.target, "key") != kKey) {
      return connection.answer(403, std::string(R"({"error": {"message": "Consumer 'api_key:)") +
                                        fetch::query_value(request.target, "key") + R"(' has no access"}})");
    }
    const auto box = fetch::test_support::box_volume(0, 0, 0, 9, 9, 9);
    if (request.path() == "/v1/3dtiles/root.json") {
      ++roots_;
      session_ok_ = true;
      auto outer = fetch::test_support::tile(box, 100);
      outer["children"].push_back(
          fetch::test_support::tile(box, 50, "/v1/3dtiles/datasets/CgA/files/outer.json?session=" + session()));
      return connection.answer(200, fetch::test_support::tileset(outer).dump(),
                               {"Cache-Control: private, max-age=100"});
    }
    if (!session_ok_ || fetch::query_value(request.target, "session") != session()) {
      return connection.answer(400, R"({"error": {"message": "session )" +
                                        fetch::query_value(request.target, "session") + R"( is not valid"}})");
    }
    if (request.path().ends_with("/outer.json")) {
      auto inner = fetch::test_support::tile(box, 50);
      for (const char* name : {"a.glb", "b.glb", "c.glb"})
        inner["children"].push_back(fetch::test_support::tile(box, 0, name));
      return connection.answer(200, fetch::test_support::tileset(inner).dump(),
                               {"Cache-Control: private, max-age=100"});
    }
    const bool is_a = request.path().ends_with("a.glb");
    return connection.answer(200, tile_with_copyright(is_a ? "Airbus; Survey" : "Survey"),
                             {"Cache-Control: private, max-age=100", "ETag: \"1\""});
  }

  std::atomic<int> roots_ = 0;
  std::atomic<bool> session_ok_ = false;
  TestHttpServer server_;
};

class Google : public ::testing::Test {
 protected:
  fetch::SourceOptions source_options() {
    fetch::SourceOptions options;
    options.http = test_support::quick_source_options();
    options.google_key = GoogleServer::kKey;
    options.google_root_url = google_.root();
    return options;
  }
  LoadedTiles load(const fetch::SourceOptions& source) {
    LoadOptions options;
    options.source = source;
    return load_region("google", options);
  }
  fetch::HttpSource open() {
    fetch::GoogleOptions options;
    options.root_url = google_.root();
    options.key = GoogleServer::kKey;
    options.now = [this] { return std::chrono::steady_clock::time_point() + time_; };
    return fetch::HttpSource(std::make_unique<fetch::GoogleProvider>(options), test_support::quick_source_options());
  }

  GoogleServer google_;
  std::chrono::seconds time_{0};
};

TEST_F(Google, KeyAndSessionGoAlongAndHoldersAreCounted) {
  const LoadedTiles tiles = load(source_options());
  EXPECT_EQ(tiles.tiles_loaded, 3);
  EXPECT_THAT(tiles.attribution, ElementsAre("Google", "Survey", "Airbus"));
  EXPECT_EQ(tiles.terms.provider, "Google Photorealistic 3D Tiles");
  EXPECT_EQ(google_.roots(), 1) << "each is paid for";
  for (const ServedRequest& request : google_.server().requests()) {
    EXPECT_EQ(fetch::query_value(request.target, "key"), GoogleServer::kKey);
    const bool is_root = request.path().ends_with("root.json");
    EXPECT_EQ(fetch::query_value(request.target, "session"), is_root ? "" : google_.session());
  }
  EXPECT_EQ(load(source_options()).cut_hash, tiles.cut_hash) << "the cut is the same in another session";
}

TEST_F(Google, ASessionThatIsAboutToRunOutIsRenewed) {
  fetch::HttpSource source = open();
  source.read(source.root_uri());
  source.read(google_.tile_url("a.glb"));
  EXPECT_EQ(google_.roots(), 1);
  time_ = hours(3) - std::chrono::minutes(4);
  source.read(google_.tile_url("b.glb"));
  EXPECT_EQ(google_.roots(), 2);
  source.read(google_.tile_url("c.glb?session=of-a-former-time"));
  EXPECT_EQ(google_.roots(), 2);
}

TEST_F(Google, WhatWasAskedForInASessionThatEndedIsAskedForAgain) {
  fetch::HttpSource source = open();
  source.read(source.root_uri());
  google_.end_session();
  source.prefetch({google_.tile_url("a.glb"), google_.tile_url("b.glb")});
  for (int i = 0; i < 500 && google_.server().requests().size() < 3; ++i) {
    google_.server().wait(std::chrono::milliseconds(10));
  }
  time_ = hours(3);
  EXPECT_GT(source.read(google_.tile_url("a.glb")).size(), 100U);
  EXPECT_GT(source.read(google_.tile_url("b.glb")).size(), 100U);
  EXPECT_EQ(google_.roots(), 2);
}

TEST_F(Google, AnotherRefusalCostsNoRootRequestAndShowsNoSecret) {
  fetch::HttpSource source = open();
  source.read(source.root_uri());
  google_.end_session();
  time_ = hours(1);
  EXPECT_THAT(base::test_support::error_of([&] { source.read(google_.tile_url("a.glb")); }),
              AllOf(HasSubstr("400"), HasSubstr("session … is not valid"), Not(HasSubstr("SESSION"))));
  EXPECT_EQ(google_.roots(), 1);
}

TEST_F(Google, AWrongKeyIsToldWithoutItAndAMissingOneByItsVariable) {
  fetch::SourceOptions options = source_options();
  options.google_key = "AIzaANOTHERKEY";
  EXPECT_THAT(base::test_support::error_of([&] { load(options); }),
              AllOf(HasSubstr("403"), HasSubstr("api_key:…' has no access"), Not(HasSubstr("ANOTHER"))));
  options.google_key = "";
  EXPECT_THAT(base::test_support::error_of([&] { load(options); }), HasSubstr("GOOGLE_MAPS_API_KEY"));
}

std::string all_bytes_below(const std::filesystem::path& folder) {
  std::string bytes;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    std::ostringstream file;
    file << std::ifstream(entry.path(), std::ios::binary).rdbuf();
    bytes += file.str();
  }
  return bytes;
}

TEST_F(Google, IsCachedByLeaveOnlyAndWithoutSecrets) {
  const tests::TemporaryFolder folder;
  fetch::SourceOptions options = source_options();
  options.cache_folder = folder.path();
  load(options);
  EXPECT_THAT(all_bytes_below(folder.path()), Not(HasSubstr("a.glb"))) << "the terms forbid it";
  options.cache_required = true;
  EXPECT_THAT(base::test_support::error_of([&] { load(options); }),
              AllOf(HasSubstr("forbid keeping tiles in a cache"), HasSubstr("maps/documentation/tile/policies"),
                    HasSubstr("--terms-accepted")));
  options.terms_accepted = true;
  load(options);
  const std::string bytes = all_bytes_below(folder.path());
  EXPECT_THAT(bytes, HasSubstr("a.glb"));
  EXPECT_THAT(bytes, AllOf(Not(HasSubstr(GoogleServer::kKey)), Not(HasSubstr("SESSION"))));
  const int before = google_.server().count("/v1/3dtiles/datasets/CgA/files/a.glb");
  EXPECT_EQ(load(options).tiles_loaded, 3);
  EXPECT_EQ(google_.server().count("/v1/3dtiles/datasets/CgA/files/a.glb"), before) << "a new session, the same tile";
}

/// Serves endpoints for the user's token, and assets for the access tokens of those endpoints.
class IonServer {
 public:
  static constexpr const char* kToken = "ion-SECRET-of-the-user";

  IonServer() : server_([this](const ServedRequest& r, ServedConnection& c) { return answer(r, c); }) {}

  void set_external(const std::string& url) { external_ = url; }
  void end_token() { token_ok_ = false; }
  void never_accept() { accepts_ = false; }
  int endpoints() const { return endpoints_; }
  TestHttpServer& server() { return server_; }
  std::string access_token() const { return "access-SECRET-" + std::to_string(endpoints_); }

 private:
  bool answer(const ServedRequest& request, ServedConnection& connection) {
    if (request.path().starts_with("/v1/assets/")) return answer_endpoint(request, connection);
    if (!accepts_ || !token_ok_ || request.header("authorization") != "Bearer " + access_token()) {
      return connection.answer(401, R"({"code": "InvalidCredentials", "message": "Invalid access token"})");
    }
    const auto box = fetch::test_support::box_volume(0, 0, 0, 9, 9, 9);
    if (request.path() == "/7/tileset.json") {
      auto root = fetch::test_support::tile(box, 50);
      for (const char* name : {"a.glb", "b.glb"}) root["children"].push_back(fetch::test_support::tile(box, 0, name));
      return connection.answer(200, fetch::test_support::tileset(root).dump());
    }
    return connection.answer(200, tile_with_copyright("Survey"));
  }

  bool answer_endpoint(const ServedRequest& request, ServedConnection& connection) {
    if (request.header("authorization") != std::string("Bearer ") + kToken) {
      return connection.answer(401, R"({"message": "Invalid access token"})");
    }
    ++endpoints_;
    token_ok_ = true;
    nlohmann::json json = nlohmann::json::parse(R"({"type": "3DTILES", "attributions": [
        {"html": "<a href=\"https://cesium.com\"><img alt=\"Cesium ion\" src=\"x.png\"></a>"},
        {"html": "<span>Survey &amp; Sons &copy; 2024</span>", "collapsible": true}]})");
    if (request.path() == "/v1/assets/1/endpoint") json["type"] = "IMAGERY";
    if (request.path() == "/v1/assets/9/endpoint") {
      json["externalType"] = "3DTILES";
      json["options"]["url"] = external_;
    } else {
      json["url"] = server_.url("/7/tileset.json?v=4");
      json["accessToken"] = access_token();
    }
    return connection.answer(200, json.dump());
  }

  std::atomic<int> endpoints_ = 0;
  std::atomic<bool> token_ok_ = false;
  std::atomic<bool> accepts_ = true;
  std::string external_;
  TestHttpServer server_;
};

class Ion : public ::testing::Test {
 protected:
  fetch::SourceOptions source_options() {
    fetch::SourceOptions options;
    options.http = test_support::quick_source_options();
    options.ion_token = IonServer::kToken;
    options.ion_api_url = ion_.server().url("");
    return options;
  }
  LoadedTiles load(const std::string& asset, const fetch::SourceOptions& source) {
    LoadOptions options;
    options.source = source;
    return load_region("ion:" + asset, options);
  }
  fetch::HttpSource open() {
    fetch::IonOptions options;
    options.api = ion_.server().url("");
    options.asset = "7";
    options.token = IonServer::kToken;
    return fetch::HttpSource(std::make_unique<fetch::IonProvider>(options), test_support::quick_source_options());
  }
  std::string tile_url(const std::string& name) { return ion_.server().url("/7/" + name); }

  IonServer ion_;
};

TEST_F(Ion, TheUsersTokenGetsAnAccessTokenThatTheTilesWant) {
  const LoadedTiles tiles = load("7", source_options());
  EXPECT_EQ(tiles.tiles_loaded, 2);
  EXPECT_THAT(tiles.attribution, ElementsAre("Cesium ion", "Survey & Sons © 2024", "Survey"));
  EXPECT_EQ(tiles.terms.provider, "Cesium ion");
  int of_tiles = 0;
  for (const ServedRequest& request : ion_.server().requests()) {
    if (request.path().starts_with("/v1/")) continue;
    ++of_tiles;
    EXPECT_EQ(request.header("authorization"), "Bearer " + ion_.access_token()) << "never the user's own";
    EXPECT_THAT(request.target, Not(HasSubstr("SECRET")));
  }
  EXPECT_GE(of_tiles, 2);
}

TEST_F(Ion, ATokenThatHasRunOutIsReplacedOnce) {
  fetch::HttpSource source = open();
  source.read(source.root_uri());
  ion_.end_token();
  source.prefetch({tile_url("a.glb"), tile_url("b.glb")});
  EXPECT_GT(source.read(tile_url("a.glb")).size(), 100U);
  EXPECT_GT(source.read(tile_url("b.glb")).size(), 100U);
  EXPECT_EQ(ion_.endpoints(), 2);
}

TEST_F(Ion, ARefusalThatStaysEnds) {
  fetch::HttpSource source = open();
  ion_.never_accept();
  EXPECT_THAT(base::test_support::error_of([&] { source.read(tile_url("a.glb")); }),
              AllOf(HasSubstr("401 (not authorised"), HasSubstr("Invalid access token"), Not(HasSubstr("SECRET"))));
  EXPECT_EQ(ion_.endpoints(), 2) << "one more try, with another token";
}

TEST_F(Ion, GooglesTilesThroughItKeepGooglesProtocolAndTerms) {
  GoogleServer google;
  ion_.set_external(google.root() + "?key=" + GoogleServer::kKey);
  fetch::SourceOptions options = source_options();
  options.google_root_url = google.root();
  const LoadedTiles tiles = load("9", options);
  EXPECT_EQ(tiles.tiles_loaded, 3);
  EXPECT_EQ(tiles.terms.provider, "Google Photorealistic 3D Tiles");
  EXPECT_THAT(tiles.attribution, ElementsAre("Cesium ion", "Survey & Sons © 2024", "Google", "Survey", "Airbus"));
  ASSERT_FALSE(google.server().requests().empty());
  for (const ServedRequest& request : google.server().requests()) {
    EXPECT_EQ(request.header("authorization"), "") << "no token of Cesium's goes to Google";
  }
}

TEST_F(Ion, OtherExternalAssetsArePlainServers) {
  test_support::TestHttpTileset place;
  place.add_tileset();
  ion_.set_external(place.root() + "?key=carried");
  const LoadedTiles tiles = load("9", source_options());
  EXPECT_EQ(tiles.tiles_loaded, 2);
  ASSERT_FALSE(place.server().requests().empty());
  for (const ServedRequest& request : place.server().requests()) {
    EXPECT_EQ(fetch::query_value(request.target, "key"), "carried");
  }
}

TEST_F(Ion, WhatCannotBeOpenedIsToldInOneLine) {
  fetch::SourceOptions options = source_options();
  EXPECT_THAT(base::test_support::error_of([&] { load("1", options); }),
              HasSubstr("ion:1: is of type IMAGERY, not 3DTILES"));
  EXPECT_THAT(base::test_support::error_of([&] { load("x", options); }),
              HasSubstr("ion:x: a Cesium ion asset is given by its number"));
  options.ion_token = "wrong-SECRET";
  EXPECT_THAT(base::test_support::error_of([&] { load("7", options); }),
              AllOf(HasSubstr("status 401: Invalid access token; see CESIUM_ION_TOKEN"), Not(HasSubstr("SECRET"))));
  options.ion_token = "";
  EXPECT_THAT(base::test_support::error_of([&] { load("7", options); }),
              HasSubstr("environment variable CESIUM_ION_TOKEN"));
}

TEST(IonHtml, AttributionsBecomeText) {
  EXPECT_EQ(fetch::html_to_text("<b>A</b>  &amp;\n<i>B</i>"), "A & B");
  EXPECT_EQ(fetch::html_to_text("<img title=\"Logo\" src=x>"), "Logo");
  EXPECT_EQ(fetch::html_to_text("plain"), "plain");
  EXPECT_EQ(fetch::html_to_text("<a"), "");
  EXPECT_EQ(fetch::html_to_text(""), "");
}

TEST(GoogleSession, IsFoundAtAnyDepth) {
  EXPECT_EQ(fetch::find_session(
                base::test_support::to_bytes(R"({"a": [{"uri": "/x.json?v=1&session=S1"}, "b?session=S2"]})")),
            "S1");
  EXPECT_EQ(fetch::find_session(base::test_support::to_bytes(R"({"a": 1})")), "");
  EXPECT_EQ(fetch::find_session(base::test_support::to_bytes("no JSON")), "");
}

TEST(TermsOf, PlainServersAreUnknownAndGooglesHostIsGoogles) {
  EXPECT_TRUE(fetch::UrlProvider("https://tiles.example.org/tileset.json").terms().forbidden.empty());
  EXPECT_NE(fetch::UrlProvider("https://tile.googleapis.com/v1/3dtiles/root.json?key=K")
                .terms()
                .find_prohibition(fetch::Use::kExtract),
            nullptr);
  EXPECT_EQ(base::test_support::error_of(
                [] { fetch::require_permitted(fetch::google_terms(), fetch::Use::kExtract, true, "google"); }),
            "");
  EXPECT_THAT(base::test_support::error_of(
                  [] { fetch::require_permitted(fetch::google_terms(), fetch::Use::kExtract, false, "google"); }),
              AllOf(HasSubstr("google: the terms of Google Photorealistic 3D Tiles forbid extraction of geometry"),
                    HasSubstr("https://developers.google.com"), HasSubstr("--terms-accepted")));
}

}  // namespace
}  // namespace tileflight::tileset::providers_test
