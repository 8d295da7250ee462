#include "tileflight/tiles/fetch/url_secrets.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <functional>

namespace tileflight::fetch {
namespace {

constexpr std::size_t kLongestPlainValue = 24;

/// A query parameter, "name=value" or "name".
struct Parameter {
  std::string_view name;
  std::string_view value;
  bool has_value = false;
};

Parameter parameter_of(std::string_view text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string_view::npos) return {text, {}, false};
  return {text.substr(0, equals), text.substr(equals + 1), true};
}

/// Positions of a URL's query: its question mark, and its end (the fragment's mark or the end of the URL).
struct QueryRange {
  std::size_t begin;
  std::size_t end;
};

QueryRange query_range(std::string_view url) {
  const std::size_t end = std::min(url.find('#'), url.size());
  return {std::min(url.find('?'), end), end};
}

void for_each_parameter(std::string_view url, const std::function<void(Parameter)>& take) {
  const QueryRange range = query_range(url);
  if (range.begin == range.end) return;
  std::string_view query = url.substr(range.begin + 1, range.end - range.begin - 1);
  while (!query.empty()) {
    const std::size_t end = std::min(query.find('&'), query.size());
    if (end > 0) take(parameter_of(query.substr(0, end)));
    query.remove_prefix(std::min(end + 1, query.size()));
  }
}

/// The URL's query without the parameters that `is_dropped` chooses by their name.
std::string query_without(std::string_view url, const std::function<bool(std::string_view name)>& is_dropped) {
  std::string out;
  for_each_parameter(url, [&](const Parameter& parameter) {
    if (is_dropped(parameter.name)) return;
    out += (out.empty() ? '?' : '&') + std::string(parameter.name);
    if (parameter.has_value) out += "=" + std::string(parameter.value);
  });
  return out;
}

/// The URL up to the query without "user:password@" (RFC 3986, section 3.2.1), which `mask` replaces.
std::string without_user(std::string_view before_query, std::string_view mask) {
  const std::size_t slashes = before_query.find("//");
  if (slashes == std::string_view::npos) return std::string(before_query);
  const std::size_t start = slashes + 2;
  const std::size_t end = std::min(before_query.find('/', start), before_query.size());
  const std::size_t at = before_query.substr(0, end).rfind('@');
  if (at == std::string_view::npos || at < start) return std::string(before_query);
  return std::string(before_query.substr(0, start)) + std::string(mask) + std::string(before_query.substr(at + 1));
}

}  // namespace

bool is_secret_parameter(std::string_view parameter) {
  static constexpr std::array<std::string_view, 14> kNames = {
      "key",  "session", "sid",  "sig",    "k",       "jwt",     "pwd",
      "pass", "auth",    "code", "apikey", "api_key", "api-key", "subscription-key"};
  static constexpr std::array<std::string_view, 6> kParts = {"token",     "secret",     "password",
                                                             "signature", "credential", "access_key"};
  std::string name(parameter);
  std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::tolower(c); });
  return std::find(kNames.begin(), kNames.end(), name) != kNames.end() ||
         std::any_of(kParts.begin(), kParts.end(),
                     [&](std::string_view part) { return name.find(part) != std::string::npos; });
}

std::string redact_url(std::string_view url) {
  std::string out = without_user(url.substr(0, query_range(url).begin), "…@");
  char mark = '?';
  for_each_parameter(url, [&](const Parameter& parameter) {
    out += mark;
    mark = '&';
    out += parameter.name.substr(0, kLongestPlainValue);
    if (!parameter.has_value) return;
    const bool hide = is_secret_parameter(parameter.name) || parameter.value.size() > kLongestPlainValue;
    out += "=" + (hide ? "…" : std::string(parameter.value));
  });
  return out;
}

std::string remove_secrets(std::string_view url) {
  return without_user(url.substr(0, query_range(url).begin), "") + query_without(url, is_secret_parameter);
}

std::string remove_version_parameters(std::string_view url) {
  return std::string(url.substr(0, query_range(url).begin)) + query_without(url, [](std::string_view name) {
           return name == "versionId" || name == "versionid" || name == "snapshot" || name == "generation";
         });
}

std::string query_value(std::string_view url, std::string_view wanted) {
  std::string found;
  for_each_parameter(url, [&](const Parameter& parameter) {
    if (found.empty() && parameter.name == wanted) found = std::string(parameter.value);
  });
  return found;
}

std::string add_query_parameter(const std::string& url, const std::string& parameter, const std::string& value) {
  const QueryRange query = query_range(url);
  const char mark = query.begin == query.end ? '?' : '&';
  return url.substr(0, query.end) + mark + parameter + "=" + value;
}

std::string inherit_query_parameters(const std::string& url, std::string_view from) {
  std::string out = url;
  for_each_parameter(from, [&](const Parameter& parameter) {
    bool has_own = false;
    for_each_parameter(url, [&](const Parameter& own) { has_own = has_own || own.name == parameter.name; });
    if (!has_own) out = add_query_parameter(out, std::string(parameter.name), std::string(parameter.value));
  });
  return out;
}

std::vector<std::string> find_secrets(std::string_view url) {
  std::vector<std::string> found;
  for_each_parameter(url, [&](const Parameter& parameter) {
    if (is_secret_parameter(parameter.name) && !parameter.value.empty()) found.emplace_back(parameter.value);
  });
  return found;
}

std::string mask_secrets(std::string text, const std::vector<std::string>& secrets) {
  for (const std::string& secret : secrets) {
    if (secret.empty()) continue;
    for (std::size_t at = text.find(secret); at != std::string::npos; at = text.find(secret, at)) {
      text.replace(at, secret.size(), "…");
    }
  }
  return text;
}

}  // namespace tileflight::fetch
