#include "tileflight/tiles/fetch/provider_ion.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <nlohmann/json.hpp>
#include <string_view>

#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/fetch/origin_policy.h"
#include "tileflight/tiles/fetch/uri.h"
#include "tileflight/tiles/fetch/url_secrets.h"

namespace tileflight::fetch {
namespace {

using nlohmann::json;

std::string string_at(const json& object, const char* key) {
  const auto it = object.find(key);
  return it != object.end() && it->is_string() ? it->get<std::string>() : std::string();
}

/// Value of `title="…"` or `alt="…"` within a tag; empty if it has neither.
std::string title_of(std::string_view tag) {
  for (const std::string_view name : {"title=\"", "alt=\""}) {
    const std::size_t start = tag.find(name);
    if (start == std::string_view::npos) continue;
    const std::size_t end = tag.find('"', start + name.size());
    if (end != std::string_view::npos) return std::string(tag.substr(start + name.size(), end - start - name.size()));
  }
  return "";
}

std::string decode_entities(std::string text) {
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 7> kEntities = {{{"&copy;", "©"},
                                                                                              {"&nbsp;", " "},
                                                                                              {"&lt;", "<"},
                                                                                              {"&gt;", ">"},
                                                                                              {"&quot;", "\""},
                                                                                              {"&#39;", "'"},
                                                                                              {"&amp;", "&"}}};
  for (const auto& [entity, meaning] : kEntities) {
    for (std::size_t at = text.find(entity); at != std::string::npos; at = text.find(entity, at + meaning.size())) {
      text.replace(at, entity.size(), meaning);
    }
  }
  return text;
}

std::string collapse_whitespace(const std::string& text) {
  std::string out;
  for (const char c : text) {
    const bool is_space = std::isspace(static_cast<unsigned char>(c)) != 0;
    if (!is_space) out += c;
    if (is_space && !out.empty() && out.back() != ' ') out += ' ';
  }
  while (out.ends_with(' ')) out.pop_back();
  return out;
}

bool is_google(const std::string& url, const GoogleOptions& google) {
  const Origin origin = parse_origin(url);
  return origin == parse_origin(google.root_url) || origin.host == "tile.googleapis.com";
}

}  // namespace

std::string html_to_text(const std::string& html) {
  std::string text;
  std::string title;
  for (std::size_t at = 0; at < html.size();) {
    if (html[at] != '<') {
      text += html[at++];
      continue;
    }
    const std::size_t end = std::min(html.find('>', at), html.size() - 1);
    if (title.empty()) title = title_of(std::string_view(html).substr(at, end - at));
    at = end + 1;
  }
  const std::string plain = collapse_whitespace(decode_entities(text));
  return plain.empty() ? collapse_whitespace(decode_entities(title)) : plain;
}

IonProvider::IonProvider(const IonOptions& options) : options_(options), name_("ion:" + options.asset) {
  const bool is_number =
      !options_.asset.empty() && options_.asset.size() <= 18 &&
      std::all_of(options_.asset.begin(), options_.asset.end(), [](unsigned char c) { return std::isdigit(c) != 0; });
  if (!is_number) throw InputError(name_, "a Cesium ion asset is given by its number, e.g. ion:12345");
  if (options_.token.empty()) {
    throw InputError(name_, "needs a token of Cesium ion in the environment variable CESIUM_ION_TOKEN");
  }
}

IonProvider::Endpoint IonProvider::get_endpoint(HttpClient& client) const {
  HttpRequest request;
  request.url = options_.api + "/v1/assets/" + options_.asset + "/endpoint";
  request.headers = {"Authorization: Bearer " + options_.token};
  const HttpResponse response = client.get(request);
  const std::string_view text(reinterpret_cast<const char*>(response.body.data()), response.body.size());
  const json answer = json::parse(text, nullptr, false);
  if (response.status != 200 || !answer.is_object()) {
    const std::string reason = answer.is_object() ? string_at(answer, "message") : "";
    throw InputError(name_, mask_secrets("Cesium ion answered with status " + std::to_string(response.status) +
                                             (reason.empty() ? "" : ": " + reason.substr(0, 200)) +
                                             (response.status == 401 ? "; see CESIUM_ION_TOKEN" : ""),
                                         secrets()));
  }
  if (const std::string type = string_at(answer, "type"); type != "3DTILES") {
    throw InputError(name_, "is of type " + (type.empty() ? "none" : type.substr(0, 40)) + ", not 3DTILES");
  }
  Endpoint endpoint;
  const bool is_external = answer.contains("externalType");
  endpoint.url =
      is_external && answer.contains("options") ? string_at(answer["options"], "url") : string_at(answer, "url");
  endpoint.access_token = is_external ? "" : string_at(answer, "accessToken");
  if (endpoint.url.empty() || (!is_external && endpoint.access_token.empty())) {
    throw InputError(name_, "Cesium ion's answer contains no tileset URL");
  }
  const json attributions = answer.value("attributions", json::array());
  for (const json& attribution : attributions) {
    if (!attribution.is_object()) continue;
    const std::string holder = html_to_text(string_at(attribution, "html"));
    if (!holder.empty()) endpoint.attribution.push_back(holder);
  }
  return endpoint;
}

std::string IonProvider::resolve_root_url(HttpClient& client) {
  const Endpoint endpoint = get_endpoint(client);
  attribution_ = endpoint.attribution;
  if (!endpoint.access_token.empty()) {
    access_tokens_ = {endpoint.access_token};
    return remove_secrets(endpoint.url);
  }
  if (is_google(endpoint.url, options_.google)) {
    GoogleOptions google = options_.google;
    google.root_url = endpoint.url;
    google.key = query_value(endpoint.url, "key");
    external_ = std::make_unique<GoogleProvider>(google);
  } else {
    external_ = std::make_unique<UrlProvider>(endpoint.url);
  }
  return external_->resolve_root_url(client);
}

HttpRequest IonProvider::make_request(const std::string& uri) {
  if (external_) return external_->make_request(uri);
  HttpRequest request;
  request.url = uri;
  const std::lock_guard lock(mutex_);
  request.headers = {"Authorization: Bearer " + access_tokens_.back()};
  return request;
}

void IonProvider::observe_response(const std::string& uri, std::span<const std::byte> body) {
  if (external_) external_->observe_response(uri, body);
}

void IonProvider::refresh_credentials(HttpClient& client) {
  if (external_) external_->refresh_credentials(client);
}

bool IonProvider::renew_credentials(HttpClient& client, long status, int asked_with) {
  if (external_) return external_->renew_credentials(client, status, asked_with);
  if (status != 401) return false;
  const std::lock_guard one(renewing_);
  if (credential_generation() > asked_with) return true;  // another reader has renewed it
  const Endpoint endpoint = get_endpoint(client);
  if (endpoint.access_token.empty()) return false;
  const std::lock_guard lock(mutex_);
  access_tokens_.push_back(endpoint.access_token);
  return true;
}

int IonProvider::credential_generation() const {
  if (external_) return external_->credential_generation();
  const std::lock_guard lock(mutex_);
  return static_cast<int>(access_tokens_.size());
}

std::vector<std::string> IonProvider::secrets() const {
  std::vector<std::string> out = external_ ? external_->secrets() : std::vector<std::string>();
  const std::lock_guard lock(mutex_);
  out.insert(out.end(), access_tokens_.begin(), access_tokens_.end());
  out.push_back(options_.token);
  return out;
}

std::vector<std::string> IonProvider::attribution() const {
  std::vector<std::string> out = attribution_;
  if (!external_) return out;
  for (const std::string& holder : external_->attribution()) {
    if (std::find(out.begin(), out.end(), holder) == out.end()) out.push_back(holder);
  }
  return out;
}

TermsOfUse IonProvider::terms() const { return external_ ? external_->terms() : cesium_ion_terms(); }

}  // namespace tileflight::fetch
