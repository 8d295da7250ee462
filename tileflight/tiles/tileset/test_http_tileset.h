#pragma once

#include <functional>
#include <map>
#include <string>
#include <utility>

#include "tileflight/tiles/fetch/http_options.h"
#include "tileflight/tiles/fetch/test_http_server.h"
#include "tileflight/tiles/fetch/test_tilesets.h"

namespace tileflight::tileset::test_support {

/// Timeouts in milliseconds, so that simulated faults end soon.
inline fetch::HttpSourceOptions quick_source_options() {
  fetch::HttpSourceOptions options;
  options.http.stall_timeout = std::chrono::milliseconds(3000);
  options.http.whole_timeout = std::chrono::milliseconds(20'000);
  options.http.retry = {.max_tries = 3,
                        .initial_backoff = std::chrono::milliseconds(2),
                        .max_backoff = std::chrono::milliseconds(8),
                        .max_retry_after = std::chrono::milliseconds(3000)};
  return options;
}

/// An HTTP server for in-memory files by path; faults can be simulated for any path.
class TestHttpTileset {
 public:
  TestHttpTileset()
      : server_([this](const fetch::test_support::ServedRequest& r, fetch::test_support::ServedConnection& c) {
          return answer(r, c);
        }) {}

  /// Two triangles side by side, in b3dm and glb, below an external tileset.
  void add_tileset() {
    fetch::test_support::Json outer =
        fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 10, 2, 2), 5, "sub/inner.json");
    fetch::test_support::Json inner = fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 10, 2, 2), 5);
    inner["children"] = {
        fetch::test_support::tile(fetch::test_support::box_volume(-5, 0, 0, 2, 2, 2), 0, "west.b3dm"),
        fetch::test_support::tile(fetch::test_support::box_volume(5, 0, 0, 2, 2, 2), 0, "../east.glb")};
    fetch::test_support::Json json = fetch::test_support::tileset(outer);
    json["asset"]["copyright"] = "Survey; City";
    files_["/place/tileset.json"] = json.dump();
    files_["/place/sub/inner.json"] = fetch::test_support::tileset(inner).dump();
    files_["/place/sub/west.b3dm"] =
        fetch::test_support::b3dm(fetch::test_support::triangle_glb({-6, 0, 0, -4, 0, 0, -5, 1, 0}));
    files_["/place/east.glb"] = fetch::test_support::triangle_glb({4, 0, 0, 6, 0, 0, 5, 1, 0});
  }
  void add(const std::string& path, const std::string& content) { files_[path] = content; }
  /// Must be called before any request.
  void stage(const std::string& path, fetch::test_support::TestHttpServer::Handler fault) {
    faults_[path] = std::move(fault);
  }

  std::string url(const std::string& path) const { return server_.url(path); }
  std::string root() const { return url("/place/tileset.json"); }
  fetch::test_support::TestHttpServer& server() { return server_; }
  const std::map<std::string, std::string>& files() const { return files_; }

 private:
  bool answer(const fetch::test_support::ServedRequest& request, fetch::test_support::ServedConnection& connection) {
    if (const auto fault = faults_.find(request.path()); fault != faults_.end())
      return fault->second(request, connection);
    const auto file = files_.find(request.path());
    if (file == files_.end()) return connection.answer(404, "<html>no such file</html>", {"Content-Type: text/html"});
    return connection.answer(200, file->second);
  }

  std::map<std::string, std::string> files_;
  std::map<std::string, fetch::test_support::TestHttpServer::Handler> faults_;
  fetch::test_support::TestHttpServer server_;  // last, so that its threads end first
};

}  // namespace tileflight::tileset::test_support
