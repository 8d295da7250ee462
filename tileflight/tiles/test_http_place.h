#pragma once

#include <functional>
#include <map>
#include <string>
#include <utility>

#include "tileflight/tiles/http_options.h"
#include "tileflight/tiles/test_http_server.h"
#include "tileflight/tiles/test_tilesets.h"

namespace tileflight::tiles::testing {

/// Bounds in milliseconds, so that faults are over soon.
inline HttpSourceOptions quick_source_options() {
  HttpSourceOptions options;
  options.http.stall_timeout = std::chrono::milliseconds(3000);
  options.http.whole_timeout = std::chrono::milliseconds(20'000);
  options.http.retry = {.max_tries = 3,
                        .first_wait = std::chrono::milliseconds(2),
                        .longest_wait = std::chrono::milliseconds(8),
                        .longest_asked = std::chrono::milliseconds(3000)};
  return options;
}

/// Files by path, served; a fault may be staged for any.
class HttpPlace {
 public:
  HttpPlace() : server_([this](const ServedRequest& r, ServedConnection& c) { return answer(r, c); }) {}

  /// Two triangles side by side, in b3dm and glb, below an external tileset.
  void add_tileset() {
    Json outer = tile(box_volume(0, 0, 0, 10, 2, 2), 5, "sub/inner.json");
    Json inner = tile(box_volume(0, 0, 0, 10, 2, 2), 5);
    inner["children"] = {tile(box_volume(-5, 0, 0, 2, 2, 2), 0, "west.b3dm"),
                         tile(box_volume(5, 0, 0, 2, 2, 2), 0, "../east.glb")};
    Json json = tileset(outer);
    json["asset"]["copyright"] = "Survey; City";
    files_["/place/tileset.json"] = json.dump();
    files_["/place/sub/inner.json"] = tileset(inner).dump();
    files_["/place/sub/west.b3dm"] = b3dm(triangle_glb({-6, 0, 0, -4, 0, 0, -5, 1, 0}));
    files_["/place/east.glb"] = triangle_glb({4, 0, 0, 6, 0, 0, 5, 1, 0});
  }
  void add(const std::string& path, const std::string& content) { files_[path] = content; }
  /// Before any request comes.
  void stage(const std::string& path, TestHttpServer::Handler fault) { faults_[path] = std::move(fault); }

  std::string url(const std::string& path) const { return server_.url(path); }
  std::string root() const { return url("/place/tileset.json"); }
  TestHttpServer& server() { return server_; }
  const std::map<std::string, std::string>& files() const { return files_; }

 private:
  bool answer(const ServedRequest& request, ServedConnection& connection) {
    if (const auto fault = faults_.find(request.path()); fault != faults_.end())
      return fault->second(request, connection);
    const auto file = files_.find(request.path());
    if (file == files_.end()) return connection.answer(404, "<html>no such file</html>", {"Content-Type: text/html"});
    return connection.answer(200, file->second);
  }

  std::map<std::string, std::string> files_;
  std::map<std::string, TestHttpServer::Handler> faults_;
  TestHttpServer server_;  // last: its threads end first
};

}  // namespace tileflight::tiles::testing
