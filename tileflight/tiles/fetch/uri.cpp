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

/// Whether the path segment is "." or "..", of which each point may be escaped ("%2e").
std::string_view unescaped_dots(std::string_view segment) {
  const std::string text = segment.size() <= 6 ? base::to_lower(segment) : std::string();
  if (text == "%2e") return ".";
  if (text == ".%2e" || text == "%2e." || text == "%2e%2e") return "..";
  return segment;
}

/// RFC 3986, section 5.2.4, except that ".." above the start of a relative path is kept.
std::string without_dot_segments(std::string_view path) {
  const bool absolute = path.starts_with('/');
  if (absolute) path.remove_prefix(1);
  std::vector<std::string_view> kept;
  bool ends_in_folder = false;
  while (true) {
    const std::size_t end = std::min(path.find('/'), path.size());
    const std::string_view segment = unescaped_dots(path.substr(0, end));
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

/// Whether the URLs of a scheme have a host and a path of segments (WHATWG URL, "special scheme", without files).
bool is_special(std::string_view lower_scheme) {
  return lower_scheme == "http" || lower_scheme == "https" || lower_scheme == "ws" || lower_scheme == "wss" ||
         lower_scheme == "ftp";
}

/// The reference without surrounding control characters and blanks, and without tabs and line ends; backslashes before
/// the query become slashes (WHATWG URL, section 4.4).
std::string cleaned(std::string_view reference) {
  const auto is_blank = [](char c) { return static_cast<unsigned char>(c) <= ' '; };
  while (!reference.empty() && is_blank(reference.front())) reference.remove_prefix(1);
  while (!reference.empty() && is_blank(reference.back())) reference.remove_suffix(1);
  std::string out(reference);
  std::erase_if(out, [](char c) { return c == '\t' || c == '\n' || c == '\r'; });
  if (is_data_uri(out)) return out;
  const auto query = out.begin() + static_cast<std::ptrdiff_t>(std::min(out.find_first_of("?#"), out.size()));
  std::replace(out.begin(), query, '\\', '/');
  return out;
}

/// Escapes the characters of `also`, blanks, control characters and all beyond ASCII.
std::string percent_encoded(std::string_view text, std::string_view also) {
  static constexpr char kHex[] = "0123456789ABCDEF";
  std::string out;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte > ' ' && byte < 0x7F && also.find(c) == std::string_view::npos) {
      out += c;
    } else {
      out += {'%', kHex[byte >> 4U], kHex[byte & 15U]};
    }
  }
  return out;
}

/// "//user@host:port" with the host in lower case and without the scheme's own port.
std::string normalized_authority(std::string_view authority, std::string_view scheme) {
  const std::size_t at = authority.rfind('@');
  const std::size_t start = at == std::string_view::npos ? 2 : at + 1;
  std::string host = base::to_lower(authority.substr(start));
  const std::string_view port = scheme == "http" || scheme == "ws" ? ":80" : scheme == "ftp" ? ":21" : ":443";
  if (host.ends_with(port)) host.resize(host.size() - port.size());
  if (host.ends_with(':')) host.pop_back();
  return std::string(authority.substr(0, start)) + host;
}

/// A URL of these parts; those of special schemes are normalised and percent-encoded.
std::string url_of(std::string_view scheme, std::string_view authority, std::string_view path, std::string_view query) {
  std::string out = scheme.empty() ? "" : base::to_lower(scheme) + ":";
  if (!is_special(out.substr(0, out.size() - std::min<std::size_t>(out.size(), 1)))) {
    return out + std::string(authority) + std::string(path) + std::string(query);
  }
  out += normalized_authority(authority, std::string_view(out).substr(0, out.size() - 1));
  if (!path.starts_with('/')) out += '/';
  return out + percent_encoded(path, "\"<>^`{}") + percent_encoded(query, "\"<>'");
}

int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

/// A percent sign without two hexadecimal digits stays.
std::string percent_decoded(std::string_view text) {
  std::string out;
  out.reserve(text.size());
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool escape = text[i] == '%' && i + 2 < text.size();
    const int high = escape ? hex_digit(text[i + 1]) : -1;
    const int low = escape ? hex_digit(text[i + 2]) : -1;
    if (high < 0 || low < 0) {
      out += text[i];
      continue;
    }
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

/// RFC 4648, both alphabets; padding is optional, blanks and line ends are skipped.
std::vector<std::byte> base64_decoded(std::string_view text, const std::string& name) {
  static constexpr std::array<signed char, 256> kValues = make_base64_values();
  while (text.ends_with('=') || text.ends_with('\n') || text.ends_with('\r') || text.ends_with(' ')) {
    text.remove_suffix(1);
  }
  std::vector<std::byte> out;
  out.reserve(text.size() / 4 * 3 + 2);
  unsigned bits = 0;
  int bit_count = 0;
  for (const char c : text) {
    if (c == ' ' || (c >= '\t' && c <= '\r')) continue;
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
  const std::string text = cleaned(reference);
  if (is_data_uri(text)) return text;
  const UriParts b = split(base);
  UriParts r = split(text);
  const std::string r_scheme = base::to_lower(r.scheme);
  const std::string scheme = r_scheme.empty() ? base::to_lower(b.scheme) : r_scheme;
  if (is_special(scheme)) {
    // Any number of slashes begins a host; with another scheme than the base's, none is needed.
    const bool names_host = !r.authority.empty() || (!r_scheme.empty() && r_scheme != base::to_lower(b.scheme));
    if (names_host) {
      std::string_view rest = std::string_view(text).substr(r.scheme.empty() ? 0 : r.scheme.size() + 1);
      rest.remove_prefix(std::min(rest.find_first_not_of('/'), rest.size()));
      const std::string with_host = "//" + std::string(rest);
      r = split(with_host);
      return url_of(scheme, r.authority, without_dot_segments(r.path), r.query);
    }
  } else if (!r_scheme.empty()) {
    return url_of(scheme, r.authority, without_dot_segments(r.path), r.query);
  }
  if (!r.authority.empty()) return url_of(scheme, r.authority, without_dot_segments(r.path), r.query);
  if (r.path.empty()) return url_of(scheme, b.authority, b.path, r.query.empty() ? b.query : r.query);
  if (r.path.starts_with('/')) return url_of(scheme, b.authority, without_dot_segments(r.path), r.query);
  const std::size_t slash = b.path.rfind('/');
  const std::string folder(slash == std::string_view::npos ? std::string_view() : b.path.substr(0, slash + 1));
  return url_of(scheme, b.authority, without_dot_segments(folder + std::string(r.path)), r.query);
}

std::string resolve_in_tileset(std::string_view base, std::string_view reference) {
  const std::string uri = resolve_uri(base, reference);
  const UriParts from = split(base), to = split(uri);
  if (from.query.size() <= 1 || !is_special(base::to_lower(from.scheme)) || from.scheme != to.scheme ||
      from.authority != to.authority) {
    return uri;
  }
  return inherit_query_parameters(uri, remove_version_parameters(base));
}

std::string uri_scheme(std::string_view uri) { return base::to_lower(uri.substr(0, scheme_length(uri))); }

std::string uri_path(std::string_view uri) {
  const std::string path = percent_decoded(split(uri).path);
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
  const std::string text = percent_decoded(payload);
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
