#pragma once

#include <chrono>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "tileflight/tiles/http_provider.h"

namespace tileflight::tiles {

struct GoogleOptions {
  std::string root_url = "https://tile.googleapis.com/v1/3dtiles/root.json";  ///< may carry the key itself
  std::string key;
  /// "A single root tileset request allows for at least three hours of tile requests."
  std::chrono::seconds session_lifetime = std::chrono::hours(3);
  /// A session is renewed this long before its end, so that requests under way are served.
  std::chrono::seconds margin = std::chrono::minutes(5);
  std::function<std::chrono::steady_clock::time_point()> now = &std::chrono::steady_clock::now;
};

/// Google Photorealistic 3D Tiles (Map Tiles API, "Work with your own 3D Tiles renderer"): the root is asked for with
/// the key; its answer's URIs carry a session, and every further request carries both. A root request is what is paid
/// for, so it is made once a session only. URIs are kept without key and session, so that they are the same in all
/// sessions.
class GoogleProvider : public HttpProvider {
 public:
  /// Throws InputError where there is no key.
  explicit GoogleProvider(const GoogleOptions& options);

  std::string open(HttpClient& client) override;
  HttpRequest request(const std::string& uri) override;
  void learn(const std::string& uri, std::span<const std::byte> body) override;
  /// Asks for the root again where the session is about to run out.
  void refresh(HttpClient& client) override;
  /// The same after a refusal, where the session may have run out.
  bool renew(HttpClient& client, long status, int generation) override;
  int generation() const override;
  std::vector<std::string> secrets() const override;
  std::vector<std::string> attribution() const override { return {"Google"}; }
  Terms terms() const override { return google_terms(); }

 private:
  bool is_root(const std::string& uri) const;
  void start_session(HttpClient& client);
  void take_session(const std::string& session);

  GoogleOptions options_;
  std::string root_uri_;               ///< without the key
  std::mutex renewing_;                ///< one root request at a time
  mutable std::mutex mutex_;           ///< of what follows
  std::vector<std::string> sessions_;  ///< all so far; the last one is in use
  std::chrono::steady_clock::time_point since_;
};

/// The first session that a tileset's URIs carry; empty where none does.
std::string session_in(std::span<const std::byte> tileset_json);

}  // namespace tileflight::tiles
