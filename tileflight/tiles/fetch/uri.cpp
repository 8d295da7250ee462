#include "tileflight/tiles/fetch/uri.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <optional>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/tiles/fetch/url_secrets.h"

namespace tileflight::fetch {
namespace {

/// RFC 3986, section 3: the parts before the query, and the query with its question mark. A fragment is dropped.
struct UriParts {
  std::string_view scheme;     ///< without the colon
  std::string_view authority;  ///< with its two slashes
  std::string_view path;
  std::string_view query;  ///< with its question mark
};

std::size_t scheme_length(std::string_view uri) {
  if (uri.empty() || std::isalpha(static_cast<unsigned char>(uri[0])) == 0) return 0;
  std::size_t i = 1;
  while (i < uri.size() &&
         (std::isalnum(static_cast<unsigned char>(uri[i])) != 0 || uri[i] == '+' || uri[i] == '-' || uri[i] == '.')) {
    ++i;
  }
  return i < uri.size() && uri[i] == ':' ? i : 0;
}

UriParts split(std::string_view uri) {
  UriParts parts;
  uri = uri.substr(0, uri.find('#'));
  if (const std::size_t length = scheme_length(uri); length > 0) {
    parts.scheme = uri.substr(0, length);
    uri.remove_prefix(length + 1);
  }
  if (uri.starts_with("//")) {
    const std::size_t end = std::min(uri.find_first_of("/?", 2), uri.size());
    parts.authority = uri.substr(0, end);
    uri.remove_prefix(end);
  }
  const std::size_t query = std::min(uri.find('?'), uri.size());
  parts.path = uri.substr(0, query);
  parts.query = uri.substr(query);
  return parts;
}

/// RFC 3986, section 5.2.4, except that ".." above the start of a relative path is kept.
std::string without_dot_segments(std::string_view path) {
  const bool absolute = path.starts_with('/');
  if (absolute) path.remove_prefix(1);
  std::vector<std::string_view> kept;
  bool ends_in_folder = false;
  while (true) {
    const std::size_t end = std::min(path.find('/'), path.size());
    const std::string_view segment = path.substr(0, end);
    ends_in_folder = segment == "." || segment == "..";
    if (segment == "..") {
      if (!kept.empty() && kept.back() != "..") {
        kept.pop_back();
      } else if (!absolute) {
        kept.push_back(segment);
      }
    } else if (segment != ".") {
      kept.push_back(segment);
    }
    if (end == path.size()) break;
    path.remove_prefix(end + 1);
  }
  std::string out = absolute ? "/" : "";
  for (std::size_t i = 0; i < kept.size(); ++i) {
    if (i > 0) out += '/';
    out += kept[i];
  }
  if (ends_in_folder && !kept.empty()) out += '/';
  return out;
}

int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

std::string percent_decoded(std::string_view text, const std::string& name) {
  std::string out;
  out.reserve(text.size());
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      out += text[i];
      continue;
    }
    const int high = i + 2 < text.size() ? hex_digit(text[i + 1]) : -1;
    const int low = i + 2 < text.size() ? hex_digit(text[i + 2]) : -1;
    if (high < 0 || low < 0)
      throw InputError(name, "has a percent sign that is not followed by two hexadecimal digits");
    out += static_cast<char>(high * 16 + low);
    i += 2;
  }
  return out;
}

constexpr std::array<signed char, 256> make_base64_values() {
  std::array<signed char, 256> values{};
  values.fill(-1);
  for (int i = 0; i < 26; ++i) values[static_cast<std::size_t>('A' + i)] = static_cast<signed char>(i);
  for (int i = 0; i < 26; ++i) values[static_cast<std::size_t>('a' + i)] = static_cast<signed char>(26 + i);
  for (int i = 0; i < 10; ++i) values[static_cast<std::size_t>('0' + i)] = static_cast<signed char>(52 + i);
  values['+'] = values['-'] = 62;
  values['/'] = values['_'] = 63;
  return values;
}

/// RFC 4648, both alphabets; padding is optional.
std::vector<std::byte> base64_decoded(std::string_view text, const std::string& name) {
  static constexpr std::array<signed char, 256> kValues = make_base64_values();
  while (text.ends_with('=')) text.remove_suffix(1);
  std::vector<std::byte> out;
  out.reserve(text.size() / 4 * 3 + 2);
  unsigned bits = 0;
  int bit_count = 0;
  for (const char c : text) {
    const int value = kValues[static_cast<unsigned char>(c)];
    if (value < 0) throw InputError(name, "has a character that is not base64");
    bits = (bits << 6U | static_cast<unsigned>(value)) & 0xFFFFU;
    bit_count += 6;
    if (bit_count >= 8) {
      bit_count -= 8;
      out.push_back(static_cast<std::byte>(bits >> static_cast<unsigned>(bit_count) & 0xFFU));
    }
  }
  return out;
}

}  // namespace

std::string resolve_uri(std::string_view base, std::string_view reference) {
  if (is_data_uri(reference)) return std::string(reference);
  std::string slashed(reference);
  std::replace(slashed.begin(), slashed.end(), '\\', '/');
  const UriParts r = split(slashed);
  if (!r.scheme.empty()) {
    return base::to_lower(r.scheme) + ":" + std::string(r.authority) + without_dot_segments(r.path) +
           std::string(r.query);
  }
  const UriParts b = split(base);
  const std::string start = (b.scheme.empty() ? "" : std::string(b.scheme) + ":");
  if (!r.authority.empty()) {
    return start + std::string(r.authority) + without_dot_segments(r.path) + std::string(r.query);
  }
  const std::string host = start + std::string(b.authority);
  if (r.path.empty()) return host + std::string(b.path) + std::string(r.query.empty() ? b.query : r.query);
  if (r.path.starts_with('/')) return host + without_dot_segments(r.path) + std::string(r.query);
  const std::size_t slash = b.path.rfind('/');
  const std::string folder(slash == std::string_view::npos ? std::string_view() : b.path.substr(0, slash + 1));
  return host + without_dot_segments(folder + std::string(r.path)) + std::string(r.query);
}

std::string uri_scheme(std::string_view uri) { return base::to_lower(uri.substr(0, scheme_length(uri))); }

std::string uri_path(std::string_view uri) {
  const std::string path = percent_decoded(split(uri).path, uri_for_message(uri));
  if (path.find('\0') != std::string::npos) throw InputError(uri_for_message(uri), "has a zero byte in its path");
  return path;
}

std::string uri_extension(std::string_view uri) {
  if (is_data_uri(uri)) return "";
  std::string_view path = split(uri).path;
  path = path.substr(path.rfind('/') + 1);  // npos + 1 is 0: the whole path
  const std::size_t point = path.rfind('.');
  return point == std::string_view::npos ? "" : base::to_lower(path.substr(point + 1));
}

bool is_data_uri(std::string_view uri) { return uri.size() >= 5 && base::to_lower(uri.substr(0, 5)) == "data:"; }

std::vector<std::byte> decode_data_uri(std::string_view uri, const std::string& name) {
  const std::size_t comma = uri.find(',');
  if (comma == std::string_view::npos) throw InputError(name, "is a data: URI without a comma");
  const std::string_view payload = uri.substr(comma + 1);
  if (uri.substr(0, comma).ends_with(";base64")) return base64_decoded(payload, name);
  const std::string text = percent_decoded(payload, name);
  const auto* bytes = reinterpret_cast<const std::byte*>(text.data());
  return {bytes, bytes + text.size()};
}

std::string uri_for_message(std::string_view uri) {
  const bool is_data = is_data_uri(uri);
  const std::size_t longest = is_data ? 32 : 200;
  const std::string shown = is_data ? std::string(uri.substr(0, longest + 1)) : redact_url(uri);
  return shown.size() <= longest ? shown : shown.substr(0, longest) + "…";
}

}  // namespace tileflight::fetch
