#include "tileflight/tiles/fetch/provider_google.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string_view>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/tiles/fetch/uri.h"
#include "tileflight/tiles/fetch/url_secrets.h"

namespace tileflight::fetch {
std::string find_session(std::span<const std::byte> tileset_json) {
  std::string session;
  // Checks every string of the document at any depth: only URIs carry the parameter. Nothing is kept in memory.
  const auto find_parameter = [&](int /*depth*/, nlohmann::json::parse_event_t event, nlohmann::json& value) {
    if (event == nlohmann::json::parse_event_t::value && value.is_string() && session.empty()) {
      session = query_value(value.get_ref<const std::string&>(), "session");
    }
    return true;
  };
  const auto parsed = nlohmann::json::parse(base::as_text(tileset_json), find_parameter, false);
  return parsed.is_discarded() ? std::string() : session;
}

GoogleProvider::GoogleProvider(const GoogleOptions& options) : options_(options) {
  if (options_.key.empty()) options_.key = query_value(options_.root_url, "key");
  root_uri_ = remove_secrets(options_.root_url);
  if (options_.key.empty()) {
    throw InputError("google", "needs a key of the Map Tiles API in the environment variable GOOGLE_MAPS_API_KEY");
  }
}

std::string GoogleProvider::resolve_root_url(HttpClient& /*client*/) { return root_uri_; }

bool GoogleProvider::is_root(const std::string& uri) const { return remove_secrets(uri) == root_uri_; }

HttpRequest GoogleProvider::make_request(const std::string& uri) {
  HttpRequest request;
  request.url = remove_secrets(uri);
  const std::lock_guard lock(mutex_);
  if (!is_root(uri) && !sessions_.empty()) request.url = add_query_parameter(request.url, "session", sessions_.back());
  request.url = add_query_parameter(request.url, "key", options_.key);
  return request;
}

void GoogleProvider::observe_response(const std::string& uri, std::span<const std::byte> body) {
  if (is_root(uri)) take_session(find_session(body));
}

void GoogleProvider::take_session(const std::string& session) {
  const std::lock_guard lock(mutex_);
  since_ = options_.now();
  if (!session.empty()) sessions_.push_back(session);
}

void GoogleProvider::refresh_credentials(HttpClient& client) {
  const auto is_due = [this] {
    const std::lock_guard lock(mutex_);
    return !sessions_.empty() && options_.now() - since_ >= options_.session_lifetime - options_.margin;
  };
  if (!is_due()) return;
  const std::lock_guard one(renewing_);
  if (is_due()) start_session(client);
}

bool GoogleProvider::renew_credentials(HttpClient& client, long status, int asked_with) {
  if (status != 400 && status != 401 && status != 403) return false;
  const std::lock_guard one(renewing_);
  {
    const std::lock_guard lock(mutex_);
    if (sessions_.empty()) return false;
    if (static_cast<int>(sessions_.size()) > asked_with) return true;  // another reader has renewed it
    // A refusal within the session's lifetime has another cause, and each root request is billed.
    if (options_.now() - since_ < options_.session_lifetime - options_.margin) return false;
  }
  start_session(client);
  return true;
}

void GoogleProvider::start_session(HttpClient& client) {
  const HttpResponse response = client.get(make_request(root_uri_));
  const std::string session = response.status == 200 ? find_session(response.body) : "";
  if (session.empty()) {
    throw InputError(uri_for_message(root_uri_), "the session has expired and no new one was granted (status " +
                                                     std::to_string(response.status) + ")");
  }
  take_session(session);
}

int GoogleProvider::credential_generation() const {
  const std::lock_guard lock(mutex_);
  return static_cast<int>(sessions_.size());
}

std::vector<std::string> GoogleProvider::secrets() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::string> out = sessions_;
  out.push_back(options_.key);
  return out;
}

}  // namespace tileflight::fetch
