#pragma once

#include <chrono>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "tileflight/tiles/fetch/http_provider.h"

namespace tileflight::fetch {

/// Access to Google's tiles, and the lifetime of a session.
struct GoogleOptions {
  std::string root_url = "https://tile.googleapis.com/v1/3dtiles/root.json";  ///< may carry the key itself
  std::string key;
  /// "A single root tileset request allows for at least three hours of tile requests."
  std::chrono::seconds session_lifetime = std::chrono::hours(3);
  /// A session is renewed this long before it expires, so that running requests still succeed.
  std::chrono::seconds margin = std::chrono::minutes(5);
  std::function<std::chrono::steady_clock::time_point()> now = &std::chrono::steady_clock::now;
};

/// Serves Google Photorealistic 3D Tiles (Map Tiles API, "Work with your own 3D Tiles renderer"). The root is requested
/// with the key. The URIs in its response carry a session, and every further request carries key and session. Root
/// requests are billed, so only one is made per session. URIs are kept without key and session, so that they are the
/// same in all sessions.
class GoogleProvider : public HttpProvider {
 public:
  /// Throws InputError if there is no key.
  explicit GoogleProvider(const GoogleOptions& options);

  std::string resolve_root_url(HttpClient& client) override;
  HttpRequest make_request(const std::string& uri) override;
  void observe_response(const std::string& uri, std::span<const std::byte> body) override;
  /// Requests the root again if the session is about to expire.
  void refresh_credentials(HttpClient& client) override;
  /// Requests the root again after a refusal, if the session may have expired.
  bool renew_credentials(HttpClient& client, long status, int generation) override;
  int credential_generation() const override;
  std::vector<std::string> secrets() const override;
  std::vector<std::string> attribution() const override { return {"Google"}; }
  TermsOfUse terms() const override { return google_terms(); }

 private:
  bool is_root(const std::string& uri) const;
  void start_session(HttpClient& client);
  void take_session(const std::string& session);

  GoogleOptions options_;
  std::string root_uri_;               ///< without the key
  std::mutex renewing_;                ///< one root request at a time
  mutable std::mutex mutex_;           ///< guards the members below
  std::vector<std::string> sessions_;  ///< all so far; the last one is in use
  std::chrono::steady_clock::time_point since_;
};

/// Returns the first session parameter in a tileset's URIs; empty if there is none.
std::string find_session(std::span<const std::byte> tileset_json);

}  // namespace tileflight::fetch
