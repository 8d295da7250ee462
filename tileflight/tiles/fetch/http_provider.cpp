#include "tileflight/tiles/fetch/http_provider.h"

#include <algorithm>
#include <cctype>

#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/fetch/origin_policy.h"
#include "tileflight/tiles/fetch/uri.h"
#include "tileflight/tiles/fetch/url_secrets.h"

namespace tileflight::fetch {

std::string validate_header(const std::string& header) {
  const std::size_t colon = header.find(':');
  const auto is_token = [](unsigned char c) { return std::isalnum(c) != 0 || c == '-' || c == '_'; };
  const bool has_name = colon != std::string::npos && colon > 0 &&
                        std::all_of(header.begin(), header.begin() + static_cast<std::ptrdiff_t>(colon), is_token);
  const bool one_line =
      std::none_of(header.begin(), header.end(), [](unsigned char c) { return c < ' ' && c != '\t'; });
  // The value may be a secret, so the message does not show it.
  if (!has_name || !one_line) throw InputError("--header", "must have the form \"Name: value\", on one line");
  return header;
}

UrlProvider::UrlProvider(const std::string& url, std::vector<std::string> headers)
    : url_(resolve_uri("", url)), headers_(std::move(headers)) {
  for (const std::string& header : headers_) validate_header(header);
}

std::string UrlProvider::resolve_root_url(HttpClient& /*client*/) { return remove_secrets(url_); }

HttpRequest UrlProvider::make_request(const std::string& uri) {
  HttpRequest request;
  request.url = inherit_query_parameters(uri, url_);
  request.headers = headers_;
  return request;
}

std::vector<std::string> UrlProvider::secrets() const {
  std::vector<std::string> out = find_secrets(url_);
  for (const std::string& header : headers_) {
    std::string value = header.substr(header.find(':') + 1);
    value.erase(0, value.find_first_not_of(" \t"));
    if (value.starts_with("Bearer ")) value.erase(0, 7);
    if (value.size() >= 8) out.push_back(value);  // shorter values may be ordinary words
  }
  return out;
}

TermsOfUse UrlProvider::terms() const {
  const std::string host = parse_origin(remove_secrets(url_)).host;
  if (host == "googleapis.com" || host.ends_with(".googleapis.com")) return google_terms();
  return unknown_terms(host);
}

}  // namespace tileflight::fetch
