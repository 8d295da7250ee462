#include "tileflight/tiles/fetch/origin_policy.h"

#include <curl/curl.h>

#include <algorithm>
#include <cctype>
#include <memory>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/tiles/fetch/uri.h"

namespace tileflight::fetch {
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

bool is_own_origin(const Origin& own, const Origin& other) {
  if (other == own) return true;
  const bool upgraded = own.scheme == "http" && other.scheme == "https" && own.host == other.host;
  return upgraded && own.port == "80" && other.port == "443";
}

}  // namespace

Origin parse_origin(const std::string& url) {
  const std::string scheme = uri_scheme(url);
  if (scheme != "http" && scheme != "https") {
    throw InputError(uri_for_message(url),
                     scheme.empty() ? "is not an http or https URL"
                                    : "a tileset from the network may not name '" + scheme + ":', only http and https");
  }
  const std::unique_ptr<CURLU, FreeUrl> parsed(curl_url());
  const CURLUcode code = curl_url_set(parsed.get(), CURLUPART_URL, url.c_str(), CURLU_DISALLOW_USER);
  if (code == CURLUE_USER_NOT_ALLOWED) {
    throw InputError(uri_for_message(url), "contains a user name; give credentials in a header instead (--header)");
  }
  if (code != CURLUE_OK) throw InputError(uri_for_message(url), "is not a valid URL");
  return {scheme, base::to_lower(part(parsed.get(), CURLUPART_HOST)),
          part(parsed.get(), CURLUPART_PORT, CURLU_DEFAULT_PORT)};
}

OriginPolicy::OriginPolicy(const std::string& root_url, std::vector<std::string> allowed_hosts)
    : own_(parse_origin(root_url)), allowed_hosts_(std::move(allowed_hosts)) {
  for (std::string& host : allowed_hosts_) host = base::to_lower(host);
}

void OriginPolicy::check(const std::string& url) const {
  const Origin origin = parse_origin(url);
  if (own_.scheme == "https" && origin.scheme == "http") {
    throw InputError(uri_for_message(url),
                     "would be fetched without encryption, but its tileset was loaded over https");
  }
  if (is_own_origin(own_, origin)) return;
  const bool allowed = std::any_of(allowed_hosts_.begin(), allowed_hosts_.end(), [&](const std::string& host) {
    return host == origin.host || host == origin.host + ":" + origin.port;
  });
  if (allowed) return;
  const std::string host =
      origin.host == own_.host || origin.host == "localhost" ? origin.host + ":" + origin.port : origin.host;
  throw InputError(uri_for_message(url),
                   "is on another host than its tileset (" + own_.host + "); to allow it, add --allow-host " + host);
}

bool OriginPolicy::is_same_origin(const std::string& url) const { return is_own_origin(own_, parse_origin(url)); }

}  // namespace tileflight::fetch
