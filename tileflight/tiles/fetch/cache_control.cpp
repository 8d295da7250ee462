#include "tileflight/tiles/fetch/cache_control.h"

#include <curl/curl.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <ctime>
#include <optional>
#include <string_view>

#include "tileflight/core/base/text_parsing.h"

namespace tileflight::fetch {
namespace {

std::string value_of(const HttpHeaders& headers, const std::string& name) {
  const auto it = headers.find(name);
  return it == headers.end() ? std::string() : it->second;
}

std::optional<std::int64_t> seconds_of(std::string_view text) {
  constexpr std::int64_t kLongest = std::int64_t{1} << 31;  // RFC 9111, section 1.2.2
  std::int64_t seconds = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), seconds);
  if (error == std::errc::result_out_of_range) return kLongest;
  if (error != std::errc() || end != text.data() + text.size() || seconds < 0) return std::nullopt;
  return std::min(seconds, kLongest);
}

std::optional<std::int64_t> date_of(const std::string& text) {
  if (text.empty()) return std::nullopt;
  const std::time_t date = curl_getdate(text.c_str(), nullptr);
  return date < 0 ? std::nullopt : std::optional<std::int64_t>(date);
}

std::int64_t lifetime_s(const HttpHeaders& headers, const std::map<std::string, std::string>& directives,
                        std::int64_t date_s) {
  constexpr std::int64_t kLongestGuess = 24 * 3600;
  if (directives.contains("no-cache")) return 0;
  if (const auto max_age = directives.find("max-age"); max_age != directives.end()) {
    return seconds_of(max_age->second).value_or(0);
  }
  if (headers.contains("expires")) {
    const auto expires = date_of(value_of(headers, "expires"));
    return expires ? std::max<std::int64_t>(*expires - date_s, 0) : 0;
  }
  const auto modified = date_of(value_of(headers, "last-modified"));
  return modified ? std::clamp<std::int64_t>((date_s - *modified) / 10, 0, kLongestGuess) : 0;
}

}  // namespace

std::map<std::string, std::string> parse_cache_control(const std::string& text) {
  std::map<std::string, std::string> directives;
  std::size_t start = 0;
  while (start < text.size()) {
    std::size_t end = start;
    for (bool quoted = false; end < text.size() && (quoted || text[end] != ','); ++end) {
      if (text[end] == '"') quoted = !quoted;
    }
    const std::string_view directive = base::trim(std::string_view(text).substr(start, end - start));
    const std::size_t equals = std::min(directive.find('='), directive.size());
    std::string name(base::trim(directive.substr(0, equals)));
    std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::tolower(c); });
    std::string value(base::trim(directive.substr(std::min(equals + 1, directive.size()))));
    std::erase(value, '"');
    if (!name.empty()) directives.emplace(name, value);  // the first of repeated directives counts
    start = end + 1;
  }
  return directives;
}

Freshness evaluate_freshness(const HttpHeaders& headers, std::int64_t requested_s, std::int64_t received_s) {
  const std::map<std::string, std::string> directives = parse_cache_control(value_of(headers, "cache-control"));
  const std::int64_t date_s = date_of(value_of(headers, "date")).value_or(received_s);
  const std::int64_t told_age_s = seconds_of(value_of(headers, "age")).value_or(0);
  const std::int64_t age_s = std::max(
      {std::int64_t{0}, received_s - date_s, told_age_s + std::max<std::int64_t>(received_s - requested_s, 0)});
  Freshness freshness;
  freshness.fresh_until_s = received_s + lifetime_s(headers, directives, date_s) - age_s;
  freshness.must_revalidate = directives.contains("must-revalidate") || directives.contains("no-cache");
  freshness.has_validator = headers.contains("etag") || headers.contains("last-modified");
  const bool of_use = freshness.fresh_until_s > received_s || freshness.has_validator;
  freshness.may_store =
      of_use && !directives.contains("no-store") && value_of(headers, "vary").find('*') == std::string::npos;
  return freshness;
}

HttpHeaders merge_headers(HttpHeaders stored, const HttpHeaders& not_modified) {
  // Age and date of the old response do not apply to the new one.
  stored.erase("age");
  stored.erase("date");
  for (const char* name : {"cache-control", "etag", "last-modified", "date", "expires", "age", "vary"}) {
    if (const auto it = not_modified.find(name); it != not_modified.end()) stored[name] = it->second;
  }
  return stored;
}

}  // namespace tileflight::fetch
