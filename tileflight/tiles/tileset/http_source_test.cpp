#include "tileflight/tiles/fetch/http_source.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "tests/temporary_folder.h"
#include "tileflight/tiles/tileset/inspect.h"
#include "tileflight/tiles/tileset/load.h"
#include "tileflight/tiles/tileset/test_http_tileset.h"

namespace tileflight::tileset::http_source_test {
namespace {

using base::test_support::error_of;
using base::test_support::to_text;
using fetch::test_support::MemorySource;
using fetch::test_support::ServedConnection;
using fetch::test_support::ServedRequest;
using fetch::test_support::TestHttpServer;
using std::chrono::milliseconds;
using test_support::TestHttpTileset;
using ::testing::AllOf;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

class HttpSourceTest : public ::testing::Test {
 protected:
  HttpSourceTest() { place_.add_tileset(); }

  fetch::HttpSource open(const std::vector<std::string>& headers = {}) { return open_at(place_.root(), headers); }
  fetch::HttpSource open_at(const std::string& url, const std::vector<std::string>& headers = {}) {
    return fetch::HttpSource(std::make_unique<fetch::UrlProvider>(url, headers), options_);
  }
  LoadOptions load_options() const {
    LoadOptions options;
    options.source.http = options_;
    options.allow_incomplete = true;
    return options;
  }
  LoadedTiles load() { return load_region(place_.root(), load_options()); }

  fetch::HttpSourceOptions options_ = test_support::quick_source_options();
  TestHttpTileset place_;
};

TEST_F(HttpSourceTest, ARegionIsTheSameAsFromFiles) {
  MemorySource memory;
  for (const auto& [path, content] : place_.files()) memory.add(path.substr(std::string("/place/").size()), content);
  const LoadedTiles expected = load_region(memory, "memory", {});
  const LoadedTiles tiles = load();
  EXPECT_TRUE(tiles.complete);
  EXPECT_EQ(tiles.tiles_loaded, 2);
  EXPECT_EQ(tiles.cut_hash, expected.cut_hash) << "the cut is the same, wherever its bytes are";
  EXPECT_EQ(tiles.bytes_read, expected.bytes_read);
  EXPECT_THAT(tiles.attribution, ElementsAre("City", "Survey"));
  ASSERT_EQ(tiles.meshes.size(), expected.meshes.size());
  for (std::size_t i = 0; i < tiles.meshes.size(); ++i) {
    EXPECT_EQ(tiles.meshes[i].mesh.vertices, expected.meshes[i].mesh.vertices);
  }
  for (const auto& [path, content] : place_.files()) EXPECT_EQ(place_.server().count(path), 1) << path;
}

TEST_F(HttpSourceTest, AFolderIsItsTilesetAndAnInspectionFetchesFewTilesForTheirCopyright) {
  fetch::SourceOptions options;
  options.http = options_;
  const TilesetSummary summary = inspect_tileset(place_.url("/place/"), options);
  EXPECT_EQ(summary.content_files, 2);
  EXPECT_FALSE(summary.content_sizes_known);
  EXPECT_EQ(summary.content_files_missing, 0);
  EXPECT_EQ(summary.external_tilesets, 1);
  EXPECT_EQ(place_.server().requests().size(), 4U) << "two tilesets, and both tiles for whose they are";
}

/// RFC 3986, section 5.1.3: the base is where the redirect ended; also if the file then comes from the cache.
TEST_F(HttpSourceTest, ReferencesAreRelativeToWhereARedirectEnded) {
  place_.stage("/short/tileset.json", [](const ServedRequest&, ServedConnection& c) {
    return c.answer(302, "", {"Location: /place/tileset.json"});
  });
  const std::string tileset = place_.files().at("/place/tileset.json");
  place_.stage("/place/tileset.json", [tileset](const ServedRequest&, ServedConnection& c) {
    return c.answer(200, tileset, {"Cache-Control: max-age=1000"});
  });
  fetch::SourceOptions options;
  options.http = options_;
  const tests::TemporaryFolder folder;
  options.cache_folder = folder / "cache";
  for (int time = 0; time < 2; ++time) {
    const std::unique_ptr<fetch::TileSource> source = fetch::open_source(place_.url("/short/tileset.json"), options);
    EXPECT_EQ(load_region(*source, "place", {}).tiles_loaded, 2) << time;
    EXPECT_EQ(source->base_uri(place_.url("/short/tileset.json")), place_.root());
  }
  EXPECT_EQ(place_.server().count("/short/tileset.json"), 1) << "the second time it is in the cache";
}

/// A blank is sent as %20; a session in an external tileset's URI goes to its contents, as with CesiumJS.
TEST_F(HttpSourceTest, BlanksAreEncodedAndQueryParametersPassedOn) {
  using fetch::test_support::box_volume;
  place_.add("/q/my place.json", fetch::test_support::tileset(fetch::test_support::tile(box_volume(5, 0, 0, 2, 2, 2), 5,
                                                                                        "sub/inner.json?session=S"))
                                     .dump());
  place_.add(
      "/q/sub/inner.json",
      fetch::test_support::tileset(fetch::test_support::tile(box_volume(5, 0, 0, 2, 2, 2), 0, "the east.glb")).dump());
  const std::string tile = place_.files().at("/place/east.glb");
  place_.stage("/q/sub/the%20east.glb", [tile](const ServedRequest& r, ServedConnection& c) {
    const bool known = r.target.find("session=S") != std::string::npos && r.target.find("key=K") != std::string::npos;
    return known ? c.answer(200, tile) : c.answer(403, "");
  });
  place_.add("/q/my%20place.json", place_.files().at("/q/my place.json"));
  fetch::HttpSource source = open_at(place_.url("/q/my place.json?key=K"));
  const LoadedTiles tiles = load_region(source, "place", {});
  EXPECT_TRUE(tiles.complete);
  EXPECT_EQ(tiles.tiles_loaded, 1);
}

TEST_F(HttpSourceTest, StatusesAreNamedWithTheReasonGiven) {
  place_.stage("/gone", [](const ServedRequest&, ServedConnection& c) {
    return c.answer(403, R"({"error": {"code": 403, "message": "key SECRETSECRET is not enabled"}})");
  });
  fetch::HttpSource source = open_at(place_.root() + "?key=SECRETSECRET");
  EXPECT_THAT(base::test_support::error_of([&] { source.read(place_.url("/none.glb")); }),
              HasSubstr("status 404 (not found)"));
  EXPECT_THAT(base::test_support::error_of([&] { source.read(place_.url("/gone")); }),
              AllOf(HasSubstr("403 (forbidden"), HasSubstr("key … is not enabled"), Not(HasSubstr("SECRET"))));
}

TEST_F(HttpSourceTest, EachFaultGivesTheBytesOrOneError) {
  std::atomic<int> count = 0;
  const std::map<std::string, TestHttpServer::Handler> faults = {
      {"404", [](const ServedRequest&, ServedConnection& c) { return c.answer(404, "no"); }},
      {"500 twice",
       [&](const ServedRequest&, ServedConnection& c) {
         return ++count < 3 ? c.answer(500, "no") : c.answer(200, place_.files().at("/place/east.glb"));
       }},
      {"429",
       [&](const ServedRequest&, ServedConnection& c) {
         return ++count < 2 ? c.answer(429, "", {"Retry-After: 0"})
                            : c.answer(200, place_.files().at("/place/east.glb"));
       }},
      {"cut short",
       [&](const ServedRequest&, ServedConnection& c) {
         c.send("HTTP/1.1 200 OK\r\nContent-Length: 1000\r\n\r\nglTF");
         return false;
       }},
      {"wrong length",
       [&](const ServedRequest&, ServedConnection& c) {
         c.send("HTTP/1.1 200 OK\r\nContent-Length: 40\r\n\r\n" + place_.files().at("/place/east.glb"));
         return false;
       }},
      {"reset",
       [](const ServedRequest&, ServedConnection& c) {
         c.reset_at_end();
         return false;
       }},
      {"wrong type",
       [&](const ServedRequest&, ServedConnection& c) {
         return c.answer(200, place_.files().at("/place/east.glb"), {"Content-Type: text/html"});
       }},
      {"web page",
       [](const ServedRequest&, ServedConnection& c) {
         return c.answer(200, "\n<!DOCTYPE html><p>Log in", {"Content-Type: text/html; charset=utf-8"});
       }},
      {"garbage", [](const ServedRequest&, ServedConnection& c) { return c.answer(200, std::string(500, '\7')); }},
      {"empty", [](const ServedRequest&, ServedConnection& c) { return c.answer(200, ""); }},
      {"no content", [](const ServedRequest&, ServedConnection& c) { return c.answer(204, ""); }},
      {"loop",
       [](const ServedRequest& r, ServedConnection& c) { return c.answer(302, "", {"Location: " + r.target}); }},
      {"to a file",
       [](const ServedRequest&, ServedConnection& c) { return c.answer(302, "", {"Location: file:///etc/passwd"}); }},
      {"to another host",
       [](const ServedRequest&, ServedConnection& c) { return c.answer(302, "", {"Location: http://localhost:1/x"}); }},
  };
  const std::map<std::string, std::string> errors = {{"404", "status 404"},
                                                     {"cut short", "closed early"},
                                                     {"wrong length", "east.glb"},
                                                     {"reset", "cannot be fetched"},
                                                     {"web page", "sent a web page"},
                                                     {"garbage", "east.glb"},
                                                     {"empty", "east.glb"},
                                                     {"no content", "status 204"},
                                                     {"loop", "redirected more than 5 times"},
                                                     {"to a file", "may not name 'file:'"},
                                                     {"to another host", "--allow-host localhost:1"}};
  for (const auto& [name, fault] : faults) {
    SCOPED_TRACE(name);
    count = 0;
    TestHttpTileset place;
    place.add_tileset();
    place.stage("/place/east.glb", fault);
    const LoadedTiles tiles = load_region(place.root(), load_options());
    const auto error = errors.find(name);
    if (error == errors.end()) {
      EXPECT_TRUE(tiles.complete);
      EXPECT_EQ(tiles.triangles, 2);
    } else {
      ASSERT_EQ(tiles.failures.size(), 1U);
      EXPECT_THAT(tiles.failures[0], AllOf(HasSubstr("east.glb"), HasSubstr(error->second)));
      EXPECT_EQ(tiles.tiles_loaded, 1);
    }
  }
}

TEST_F(HttpSourceTest, ATilesetCannotSendItsReaderElsewhere) {
  fetch::test_support::Json root = fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 9, 9, 9), 5);
  for (const std::string uri : {"file:///etc/passwd", "http://localhost:9/a.glb", "//127.0.0.2/a.glb", "ftp://h/a.glb",
                                "https://127.0.0.1/a.glb"}) {
    root["children"].push_back(fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 2, 2, 2), 0, uri));
  }
  place_.add("/place/tileset.json", fetch::test_support::tileset(root).dump());
  const LoadedTiles tiles = load();
  EXPECT_EQ(tiles.tiles_loaded, 0);
  EXPECT_EQ(tiles.failures.size(), 5U);
  EXPECT_THAT(tiles.failures, Each(::testing::AnyOf(HasSubstr("may not name"), HasSubstr("is on another host"))));
}

TEST_F(HttpSourceTest, HeadersAndParametersGoToTheOwnOriginAlone) {
  TestHttpTileset other;
  other.add("/b.glb", "other");
  const std::string elsewhere = "http://localhost:" + std::to_string(other.server().port()) + "/b.glb";
  place_.stage("/place/moved", [&](const ServedRequest&, ServedConnection& c) {
    return c.answer(302, "", {"Location: " + elsewhere});
  });
  options_.allowed_hosts = {"localhost"};
  fetch::HttpSource source = open_at(place_.root() + "?v=3&sig=SECRETSECRET", {"Authorization: Bearer SECRET"});
  EXPECT_EQ(source.root_uri(), place_.root() + "?v=3");
  source.read(source.root_uri());
  source.read(place_.url("/place/east.glb"));
  EXPECT_EQ(base::test_support::to_text(source.read(elsewhere)), "other");
  EXPECT_EQ(base::test_support::to_text(source.read(place_.url("/place/moved"))), "other");
  ASSERT_FALSE(place_.server().requests().empty());
  for (const ServedRequest& request : place_.server().requests()) {
    EXPECT_EQ(request.header("authorization"), "Bearer SECRET");
    EXPECT_THAT(request.target, ::testing::EndsWith("?v=3&sig=SECRETSECRET"));
  }
  ASSERT_EQ(other.server().requests().size(), 2U);
  for (const ServedRequest& request : other.server().requests()) {
    EXPECT_EQ(request.header("authorization"), "");
    EXPECT_EQ(request.target, "/b.glb");
  }
}

TEST_F(HttpSourceTest, AHeaderIsOneLineWithAName) {
  for (const char* header : {"no colon", ": value", "A b: c", "A: b\r\nC: d"}) {
    EXPECT_THAT(base::test_support::error_of([&] { fetch::UrlProvider(place_.root(), {header}); }),
                HasSubstr("--header: must have the form"));
  }
}

/// Waits until the server has received this many requests and no more arrive.
std::size_t settled_requests(TestHttpTileset& place, std::size_t expected) {
  for (int i = 0; i < 500 && place.server().requests().size() < expected; ++i) place.server().wait(milliseconds(10));
  place.server().wait(milliseconds(50));
  return place.server().requests().size();
}

TEST_F(HttpSourceTest, RequestsRunAheadOfTheReadersWithinTheBudget) {
  options_.http.max_parallel = 2;
  options_.max_prefetch_bytes = 50'000;
  fetch::HttpSource source = open();
  std::vector<std::string> uris;
  for (int i = 0; i < 20; ++i) {
    const std::string path = "/" + std::to_string(i) + ".bin";
    place_.add(path, std::string(10'000, static_cast<char>('a' + i)));
    uris.push_back(place_.url(path));
  }
  source.prefetch(uris);
  EXPECT_EQ(settled_requests(place_, 5), 5U) << "five of 10 kB fill the budget";
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(base::test_support::to_text(source.read(uris[static_cast<std::size_t>(i)])),
              std::string(10'000, static_cast<char>('a' + i)));
  }
  EXPECT_EQ(place_.server().requests().size(), 20U) << "each once";
  source.read(uris[3]);
  EXPECT_EQ(place_.server().requests().size(), 21U) << "nothing is kept after it was read";
}

TEST_F(HttpSourceTest, ReadingAgainstTheOrderWorksAndWhatIsTakenBackIsNotFetched) {
  options_.http.max_parallel = 1;
  options_.max_prefetch_bytes = 1000;
  fetch::HttpSource source = open();
  std::vector<std::string> uris;
  for (int i = 0; i < 6; ++i) {
    place_.add("/" + std::to_string(i), std::string(900, 'x'));
    uris.push_back(place_.url("/" + std::to_string(i)));
  }
  source.prefetch(uris);
  for (int i = 5; i >= 3; --i) EXPECT_EQ(source.read(uris[static_cast<std::size_t>(i)]).size(), 900U);
  source.prefetch({});
  const std::size_t count = settled_requests(place_, 4);
  EXPECT_LE(count, 6U);
  EXPECT_EQ(source.read(uris[0]).size(), 900U);
}

TEST_F(HttpSourceTest, FaultsOfWhatWasFetchedAheadReachTheirReaderAlone) {
  place_.stage("/bad", [](const ServedRequest&, ServedConnection& c) { return c.answer(404, ""); });
  fetch::HttpSource source = open();
  source.prefetch({place_.url("/place/east.glb"), place_.url("/bad"), "http://localhost:9/x", "data:,x"});
  EXPECT_THAT(base::test_support::error_of([&] { source.read(place_.url("/bad")); }), HasSubstr("404"));
  EXPECT_THAT(base::test_support::error_of([&] { source.read("http://localhost:9/x"); }), HasSubstr("--allow-host"));
  EXPECT_EQ(base::test_support::to_text(source.read(place_.url("/place/east.glb"))),
            place_.files().at("/place/east.glb"));
}

/// A source with a cache, and a server whose responses can be changed.
class CachedHttpSource : public HttpSourceTest {
 protected:
  CachedHttpSource() {
    place_.stage("/a.glb", [this](const ServedRequest& request, ServedConnection& connection) {
      if (broken_) return connection.answer(503, "");
      std::vector<std::string> headers = {"Cache-Control: " + cache_control_, "ETag: " + etag_};
      if (request.header("if-none-match") == etag_) return connection.answer(304, "", headers);
      return connection.answer(200, "content of " + etag_, headers);
    });
  }
  fetch::HttpSource open_cached() {
    return fetch::HttpSource(std::make_unique<fetch::UrlProvider>(place_.root() + "?key=SECRETSECRET"), options_,
                             std::make_unique<fetch::HttpCache>(folder_.path()));
  }
  std::string read(fetch::HttpSource& source) { return base::test_support::to_text(source.read(place_.url("/a.glb"))); }
  int requests() { return place_.server().count("/a.glb"); }

  tests::TemporaryFolder folder_;
  std::string cache_control_ = "max-age=1000";
  std::string etag_ = "\"1\"";
  std::atomic<bool> broken_ = false;
};

TEST_F(CachedHttpSource, WhatIsFreshIsNotAskedForEvenAhead) {
  {
    fetch::HttpSource source = open_cached();
    EXPECT_EQ(read(source), "content of \"1\"");
    EXPECT_EQ(read(source), "content of \"1\"") << "though it may not be stored yet";
  }
  fetch::HttpSource later = open_cached();
  EXPECT_EQ(read(later), "content of \"1\"");
  later.prefetch({place_.url("/a.glb")});
  EXPECT_EQ(read(later), "content of \"1\"");
  EXPECT_EQ(requests(), 1);
}

TEST_F(CachedHttpSource, WhatIsStaleIsAskedAbout) {
  cache_control_ = "max-age=0";
  fetch::HttpSource source = open_cached();
  EXPECT_EQ(read(source), "content of \"1\"");
  EXPECT_EQ(read(source), "content of \"1\"");
  EXPECT_EQ(requests(), 2);
  EXPECT_EQ(place_.server().requests().back().header("if-none-match"), "\"1\"");
  cache_control_ = "max-age=1000";
  source.prefetch({place_.url("/a.glb")});
  EXPECT_EQ(read(source), "content of \"1\"");
  EXPECT_EQ(read(source), "content of \"1\"");
  EXPECT_EQ(requests(), 3) << "fresh again, by what the last answer said";
}

TEST_F(CachedHttpSource, WhatHasChangedIsReplaced) {
  cache_control_ = "no-cache";
  fetch::HttpSource source = open_cached();
  read(source);
  etag_ = "\"2\"";
  EXPECT_EQ(read(source), "content of \"2\"");
  EXPECT_EQ(read(source), "content of \"2\"");
  EXPECT_EQ(requests(), 3);
}

TEST_F(CachedHttpSource, NoStoreIsHeededAndTakesBackWhatWasStored) {
  fetch::HttpSource source = open_cached();
  cache_control_ = "max-age=0";
  read(source);
  cache_control_ = "no-store";
  etag_ = "\"2\"";
  read(source);
  read(source);
  EXPECT_EQ(requests(), 3);
  EXPECT_EQ(place_.server().requests().back().header("if-none-match"), "") << "nothing is kept";
}

TEST_F(CachedHttpSource, AStaleCopyServesWhileTheServerDoesNotUnlessItMustBeAsked) {
  cache_control_ = "max-age=0";
  fetch::HttpSource source = open_cached();
  read(source);
  broken_ = true;
  EXPECT_EQ(read(source), "content of \"1\"");
  EXPECT_THAT(source.warnings(), ElementsAre(HasSubstr("not reachable to revalidate 1 cached files")));
  broken_ = false;
  cache_control_ = "max-age=0, must-revalidate";
  etag_ = "\"2\"";
  read(source);
  broken_ = true;
  EXPECT_THAT(base::test_support::error_of([&] { read(source); }), HasSubstr("503"));
}

TEST_F(CachedHttpSource, BodiesThatCarrySecretsAreNotKept) {
  const auto fresh = [](const std::string& body) {
    return [body](const ServedRequest&, ServedConnection& c) {
      return c.answer(200, body, {"Cache-Control: max-age=1000"});
    };
  };
  place_.stage("/session.json", fresh(" {\"uri\": \"a.glb?session=abc\"}"));
  place_.stage("/echo.bin", fresh("you are SECRETSECRET"));
  place_.stage("/plain.bin", fresh("session=, but no JSON"));
  fetch::HttpSource source = open_cached();
  for (int i = 0; i < 2; ++i) {
    for (const char* path : {"/session.json", "/echo.bin", "/plain.bin"}) source.read(place_.url(path));
  }
  EXPECT_EQ(place_.server().count("/session.json"), 2);
  EXPECT_EQ(place_.server().count("/echo.bin"), 2);
  EXPECT_EQ(place_.server().count("/plain.bin"), 1);
}

TEST_F(HttpSourceTest, FilesThatTheTreeGoesOnInAreFetchedLevelByLevel) {
  fetch::test_support::Json root = fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 90, 9, 9), 5);
  for (int i = 0; i < 8; ++i) {
    const std::string name = std::to_string(i);
    const auto box = fetch::test_support::box_volume(10 * i - 35, 0, 0, 4, 4, 4);
    root["children"].push_back(fetch::test_support::tile(box, 4, name + ".json"));
    place_.stage("/place/" + name + ".json", [box, name](const ServedRequest&, ServedConnection& c) {
      c.wait(milliseconds(30));
      return c.answer(200, fetch::test_support::tileset(fetch::test_support::tile(box, 0, name + ".glb")).dump());
    });
    if (i != 5) place_.add("/place/" + name + ".glb", fetch::test_support::triangle_glb());
  }
  place_.add("/place/tileset.json", fetch::test_support::tileset(root).dump());
  const LoadedTiles tiles = load();
  EXPECT_EQ(tiles.tiles_loaded, 7);
  EXPECT_THAT(tiles.failures, ElementsAre(HasSubstr("5.glb")));
  EXPECT_GE(place_.server().most_at_once(), 4) << "not one after the other";
  for (int i = 0; i < 8; ++i) EXPECT_EQ(place_.server().count("/place/" + std::to_string(i) + ".json"), 1);
}

}  // namespace
}  // namespace tileflight::tileset::http_source_test
