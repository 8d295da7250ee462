#include "tileflight/tiles/origin_policy.h"

#include <curl/curl.h>

#include <algorithm>
#include <cctype>
#include <memory>

#include "tileflight/geometry/input_error.h"
#include "tileflight/tiles/uri.h"

namespace tileflight::tiles {
namespace {

struct FreeUrl {
  void operator()(CURLU* url) const { curl_url_cleanup(url); }
};

std::string part(CURLU* url, CURLUPart which, unsigned flags = 0) {
  char* text = nullptr;
  if (curl_url_get(url, which, &text, flags) != CURLUE_OK) return "";
  const std::string value = text;
  curl_free(text);
  return value;
}

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

bool is_own_origin(const Origin& own, const Origin& other) {
  if (other == own) return true;
  const bool upgraded = own.scheme == "http" && other.scheme == "https" && own.host == other.host;
  return upgraded && own.port == "80" && other.port == "443";
}

}  // namespace

Origin origin_of(const std::string& url) {
  const std::string scheme = uri_scheme(url);
  if (scheme != "http" && scheme != "https") {
    throw InputError(uri_for_message(url),
                     scheme.empty() ? "is not an http or https URL"
                                    : "a tileset from the network may not name '" + scheme + ":', only http and https");
  }
  const std::unique_ptr<CURLU, FreeUrl> parsed(curl_url());
  const CURLUcode code = curl_url_set(parsed.get(), CURLUPART_URL, url.c_str(), CURLU_DISALLOW_USER);
  if (code == CURLUE_USER_NOT_ALLOWED) {
    throw InputError(uri_for_message(url), "has a user name in it; give credentials as a header instead (--header)");
  }
  if (code != CURLUE_OK) throw InputError(uri_for_message(url), "is not a URL that can be read");
  return {scheme, lower(part(parsed.get(), CURLUPART_HOST)), part(parsed.get(), CURLUPART_PORT, CURLU_DEFAULT_PORT)};
}

OriginPolicy::OriginPolicy(const std::string& root_url, std::vector<std::string> allowed_hosts)
    : own_(origin_of(root_url)), allowed_hosts_(std::move(allowed_hosts)) {
  for (std::string& host : allowed_hosts_) host = lower(host);
}

void OriginPolicy::check(const std::string& url) const {
  const Origin origin = origin_of(url);
  if (own_.scheme == "https" && origin.scheme == "http") {
    throw InputError(uri_for_message(url), "would be fetched without encryption, by a tileset that came over https");
  }
  if (is_own_origin(own_, origin)) return;
  const bool allowed = std::any_of(allowed_hosts_.begin(), allowed_hosts_.end(), [&](const std::string& host) {
    return host == origin.host || host == origin.host + ":" + origin.port;
  });
  if (allowed) return;
  const std::string host =
      origin.host == own_.host || origin.host == "localhost" ? origin.host + ":" + origin.port : origin.host;
  throw InputError(uri_for_message(url), "is on another host than its tileset (" + own_.host +
                                             "); if that is meant, allow it with --allow-host " + host);
}

bool OriginPolicy::is_own(const std::string& url) const { return is_own_origin(own_, origin_of(url)); }

}  // namespace tileflight::tiles
