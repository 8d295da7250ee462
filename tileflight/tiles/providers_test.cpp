#include <gmock/gmock.h>

#include <fstream>
#include <sstream>

#include "tests/temporary_folder.h"
#include "tileflight/tiles/http_source.h"
#include "tileflight/tiles/load.h"
#include "tileflight/tiles/provider_google.h"
#include "tileflight/tiles/provider_ion.h"
#include "tileflight/tiles/test_http_place.h"
#include "tileflight/tiles/url_secrets.h"

/// Each provider against a small server that speaks its protocol.
namespace tileflight::tiles {
namespace {

using std::chrono::hours;
using ::testing::AllOf;
using ::testing::ElementsAre;
using testing::error_of;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::ServedConnection;
using testing::ServedRequest;
using testing::TestHttpServer;

std::string tile_with_copyright(const std::string& copyright) {
  testing::GltfWriter writer;
  writer.add_primitive(
      {{"attributes", {{"POSITION", writer.add_accessor(std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0}, 3)}}}});
  writer.json()["asset"]["copyright"] = copyright;
  return writer.glb();
}

/// Root with a session, which its tiles want beside the key.
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
    if (query_value(request.target, "key") != kKey) {
      return connection.answer(403, std::string(R"({"error": {"message": "Consumer 'api_key:)") +
                                        query_value(request.target, "key") + R"(' has no access"}})");
    }
    const auto box = testing::box_volume(0, 0, 0, 9, 9, 9);
    if (request.path() == "/v1/3dtiles/root.json") {
      ++roots_;
      session_ok_ = true;
      auto outer = testing::tile(box, 100);
      outer["children"].push_back(
          testing::tile(box, 50, "/v1/3dtiles/datasets/CgA/files/outer.json?session=" + session()));
      return connection.answer(200, testing::tileset(outer).dump(), {"Cache-Control: private, max-age=100"});
    }
    if (!session_ok_ || query_value(request.target, "session") != session()) {
      return connection.answer(
          400, R"({"error": {"message": "session )" + query_value(request.target, "session") + R"( is not valid"}})");
    }
    if (request.path().ends_with("/outer.json")) {
      auto inner = testing::tile(box, 50);
      for (const char* name : {"a.glb", "b.glb", "c.glb"}) inner["children"].push_back(testing::tile(box, 0, name));
      return connection.answer(200, testing::tileset(inner).dump(), {"Cache-Control: private, max-age=100"});
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
  SourceOptions source_options() {
    SourceOptions options;
    options.http = testing::quick_source_options();
    options.google_key = GoogleServer::kKey;
    options.google_root = google_.root();
    return options;
  }
  LoadedTiles load(const SourceOptions& source) {
    LoadOptions options;
    options.source = source;
    return load_region("google", options);
  }
  HttpSource open() {
    GoogleOptions options;
    options.root_url = google_.root();
    options.key = GoogleServer::kKey;
    options.now = [this] { return std::chrono::steady_clock::time_point() + time_; };
    return HttpSource(std::make_unique<GoogleProvider>(options), testing::quick_source_options());
  }

  GoogleServer google_;
  std::chrono::seconds time_{0};
};

TEST_F(Google, key_and_session_go_along_and_holders_are_counted) {
  const LoadedTiles tiles = load(source_options());
  EXPECT_EQ(tiles.tiles_loaded, 3);
  EXPECT_THAT(tiles.attribution, ElementsAre("Google", "Survey", "Airbus"));
  EXPECT_EQ(tiles.terms.provider, "Google Photorealistic 3D Tiles");
  EXPECT_EQ(google_.roots(), 1) << "each is paid for";
  for (const ServedRequest& request : google_.server().requests()) {
    EXPECT_EQ(query_value(request.target, "key"), GoogleServer::kKey);
    const bool is_root = request.path().ends_with("root.json");
    EXPECT_EQ(query_value(request.target, "session"), is_root ? "" : google_.session());
  }
  EXPECT_EQ(load(source_options()).cut_hash, tiles.cut_hash) << "the cut is the same in another session";
}

TEST_F(Google, a_session_that_is_about_to_run_out_is_renewed) {
  HttpSource source = open();
  source.read(source.root_uri());
  source.read(google_.tile_url("a.glb"));
  EXPECT_EQ(google_.roots(), 1);
  time_ = hours(3) - std::chrono::minutes(4);
  source.read(google_.tile_url("b.glb"));
  EXPECT_EQ(google_.roots(), 2);
  source.read(google_.tile_url("c.glb?session=of-a-former-time"));
  EXPECT_EQ(google_.roots(), 2);
}

TEST_F(Google, what_was_asked_for_in_a_session_that_ended_is_asked_for_again) {
  HttpSource source = open();
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

TEST_F(Google, another_refusal_costs_no_root_request_and_shows_no_secret) {
  HttpSource source = open();
  source.read(source.root_uri());
  google_.end_session();
  time_ = hours(1);
  EXPECT_THAT(error_of([&] { source.read(google_.tile_url("a.glb")); }),
              AllOf(HasSubstr("400"), HasSubstr("session … is not valid"), Not(HasSubstr("SESSION"))));
  EXPECT_EQ(google_.roots(), 1);
}

TEST_F(Google, a_wrong_key_is_told_without_it_and_a_missing_one_by_its_variable) {
  SourceOptions options = source_options();
  options.google_key = "AIzaANOTHERKEY";
  EXPECT_THAT(error_of([&] { load(options); }),
              AllOf(HasSubstr("403"), HasSubstr("api_key:…' has no access"), Not(HasSubstr("ANOTHER"))));
  options.google_key = "";
  EXPECT_THAT(error_of([&] { load(options); }), HasSubstr("GOOGLE_MAPS_API_KEY"));
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

TEST_F(Google, is_cached_by_leave_only_and_without_secrets) {
  const tests::TemporaryFolder folder;
  SourceOptions options = source_options();
  options.cache = folder.path();
  load(options);
  EXPECT_THAT(all_bytes_below(folder.path()), Not(HasSubstr("a.glb"))) << "the terms forbid it";
  options.cache_asked_for = true;
  EXPECT_THAT(error_of([&] { load(options); }),
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

/// Endpoints for the user's token, assets for the access tokens that those give.
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
    const auto box = testing::box_volume(0, 0, 0, 9, 9, 9);
    if (request.path() == "/7/tileset.json") {
      auto root = testing::tile(box, 50);
      for (const char* name : {"a.glb", "b.glb"}) root["children"].push_back(testing::tile(box, 0, name));
      return connection.answer(200, testing::tileset(root).dump());
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
  SourceOptions source_options() {
    SourceOptions options;
    options.http = testing::quick_source_options();
    options.ion_token = IonServer::kToken;
    options.ion_api = ion_.server().url("");
    return options;
  }
  LoadedTiles load(const std::string& asset, const SourceOptions& source) {
    LoadOptions options;
    options.source = source;
    return load_region("ion:" + asset, options);
  }
  HttpSource open() {
    IonOptions options;
    options.api = ion_.server().url("");
    options.asset = "7";
    options.token = IonServer::kToken;
    return HttpSource(std::make_unique<IonProvider>(options), testing::quick_source_options());
  }
  std::string tile_url(const std::string& name) { return ion_.server().url("/7/" + name); }

  IonServer ion_;
};

TEST_F(Ion, the_users_token_gets_an_access_token_that_the_tiles_want) {
  const LoadedTiles tiles = load("7", source_options());
  EXPECT_EQ(tiles.tiles_loaded, 2);
  EXPECT_THAT(tiles.attribution, ElementsAre("Cesium ion", "Survey & Sons © 2024", "Survey"));
  EXPECT_EQ(tiles.terms.provider, "Cesium ion");
  for (const ServedRequest& request : ion_.server().requests()) {
    if (request.path().starts_with("/v1/")) continue;
    EXPECT_EQ(request.header("authorization"), "Bearer " + ion_.access_token()) << "never the user's own";
    EXPECT_THAT(request.target, Not(HasSubstr("SECRET")));
  }
}

TEST_F(Ion, a_token_that_has_run_out_is_replaced_once) {
  HttpSource source = open();
  source.read(source.root_uri());
  ion_.end_token();
  source.prefetch({tile_url("a.glb"), tile_url("b.glb")});
  EXPECT_GT(source.read(tile_url("a.glb")).size(), 100U);
  EXPECT_GT(source.read(tile_url("b.glb")).size(), 100U);
  EXPECT_EQ(ion_.endpoints(), 2);
}

TEST_F(Ion, a_refusal_that_stays_ends) {
  HttpSource source = open();
  ion_.never_accept();
  EXPECT_THAT(error_of([&] { source.read(tile_url("a.glb")); }),
              AllOf(HasSubstr("401 (not authorised"), HasSubstr("Invalid access token"), Not(HasSubstr("SECRET"))));
  EXPECT_EQ(ion_.endpoints(), 2) << "one more try, with another token";
}

TEST_F(Ion, googles_tiles_through_it_keep_googles_protocol_and_terms) {
  GoogleServer google;
  ion_.set_external(google.root() + "?key=" + GoogleServer::kKey);
  SourceOptions options = source_options();
  options.google_root = google.root();
  const LoadedTiles tiles = load("9", options);
  EXPECT_EQ(tiles.tiles_loaded, 3);
  EXPECT_EQ(tiles.terms.provider, "Google Photorealistic 3D Tiles");
  EXPECT_THAT(tiles.attribution, ElementsAre("Cesium ion", "Survey & Sons © 2024", "Google", "Survey", "Airbus"));
  for (const ServedRequest& request : google.server().requests()) {
    EXPECT_EQ(request.header("authorization"), "") << "no token of Cesium's goes to Google";
  }
}

TEST_F(Ion, other_external_assets_are_plain_servers) {
  testing::HttpPlace place;
  place.add_tileset();
  ion_.set_external(place.root() + "?key=carried");
  const LoadedTiles tiles = load("9", source_options());
  EXPECT_EQ(tiles.tiles_loaded, 2);
  for (const ServedRequest& request : place.server().requests()) {
    EXPECT_EQ(query_value(request.target, "key"), "carried");
  }
}

TEST_F(Ion, what_cannot_be_opened_is_told_in_one_line) {
  SourceOptions options = source_options();
  EXPECT_THAT(error_of([&] { load("1", options); }), HasSubstr("ion:1: is of type IMAGERY, not 3DTILES"));
  EXPECT_THAT(error_of([&] { load("x", options); }), HasSubstr("ion:x: an asset of Cesium ion is a number"));
  options.ion_token = "wrong-SECRET";
  EXPECT_THAT(error_of([&] { load("7", options); }),
              AllOf(HasSubstr("status 401: Invalid access token; see CESIUM_ION_TOKEN"), Not(HasSubstr("SECRET"))));
  options.ion_token = "";
  EXPECT_THAT(error_of([&] { load("7", options); }), HasSubstr("environment variable CESIUM_ION_TOKEN"));
}

TEST(IonHtml, attributions_become_text) {
  EXPECT_EQ(text_of_html("<b>A</b>  &amp;\n<i>B</i>"), "A & B");
  EXPECT_EQ(text_of_html("<img title=\"Logo\" src=x>"), "Logo");
  EXPECT_EQ(text_of_html("plain"), "plain");
  EXPECT_EQ(text_of_html("<a"), "");
  EXPECT_EQ(text_of_html(""), "");
}

TEST(GoogleSession, is_found_at_any_depth) {
  EXPECT_EQ(session_in(testing::to_bytes(R"({"a": [{"uri": "/x.json?v=1&session=S1"}, "b?session=S2"]})")), "S1");
  EXPECT_EQ(session_in(testing::to_bytes(R"({"a": 1})")), "");
  EXPECT_EQ(session_in(testing::to_bytes("no JSON")), "");
}

TEST(TermsOf, plain_servers_are_unknown_and_googles_host_is_googles) {
  EXPECT_TRUE(PlainProvider("https://tiles.example.org/tileset.json").terms().forbidden.empty());
  EXPECT_NE(PlainProvider("https://tile.googleapis.com/v1/3dtiles/root.json?key=K").terms().forbids(Use::kExtract),
            nullptr);
  EXPECT_EQ(error_of([] { require_permitted(google_terms(), Use::kExtract, true, "google"); }), "");
  EXPECT_THAT(error_of([] { require_permitted(google_terms(), Use::kExtract, false, "google"); }),
              AllOf(HasSubstr("google: the terms of Google Photorealistic 3D Tiles forbid extraction of geometry"),
                    HasSubstr("https://developers.google.com"), HasSubstr("--terms-accepted")));
}

}  // namespace
}  // namespace tileflight::tiles
