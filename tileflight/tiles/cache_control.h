#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace tileflight::tiles {

/// Headers of an answer, names in lower case.
using HttpHeaders = std::map<std::string, std::string>;

/// What a private cache may do with an answer (RFC 9111).
struct Freshness {
  bool may_store = false;
  std::int64_t fresh_until_s = 0;  ///< Unix time until which it may be used without asking
  bool must_revalidate = false;    ///< never used beyond that, even where the server cannot be reached
  bool has_validator = false;      ///< a stale one can be asked about (ETag, Last-Modified)
};

/// Directives of a Cache-Control header: names in lower case, values without quotes.
std::map<std::string, std::string> parse_cache_control(const std::string& text);

/// Judges an answer of status 200 by its headers. `requested_s`, `received_s`: Unix times.
/// - May be stored unless no-store or Vary: *, and only if it can be of use again (RFC 9111, section 3).
/// - Lifetime (4.2.1): max-age, else Expires less Date, else a tenth of the time since Last-Modified, at most a day
///   (4.2.2). A max-age that is no number is none at all: stale. no-cache: always stale (5.2.2.4).
/// - Age (4.2.3): what Age says and the way here, or by Date, whichever is more.
Freshness freshness_of(const HttpHeaders& headers, std::int64_t requested_s, std::int64_t received_s);

/// The stored headers after an answer of 304 (4.3.4): those that it carries replace the stored ones.
HttpHeaders updated_headers(HttpHeaders stored, const HttpHeaders& not_modified);

}  // namespace tileflight::tiles
