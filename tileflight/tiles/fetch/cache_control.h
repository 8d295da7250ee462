#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace tileflight::fetch {

/// Headers of a response by name. Names are in lower case.
using HttpHeaders = std::map<std::string, std::string>;

/// States how a private cache may use a response (RFC 9111).
struct Freshness {
  bool may_store = false;
  std::int64_t fresh_until_s = 0;  ///< Unix time until which it is used without contacting the server
  bool must_revalidate = false;    ///< never used once stale, even if the server cannot be reached
  bool has_validator = false;      ///< a stale response can be revalidated (ETag, Last-Modified)
};

/// Parses the directives of a Cache-Control header: names in lower case, values without quotes.
std::map<std::string, std::string> parse_cache_control(const std::string& text);

/// Evaluates the headers of a response with status 200. `requested_s`, `received_s`: Unix times.
/// - May be stored unless no-store or Vary: *, and only if it can be reused (RFC 9111, section 3).
/// - Lifetime (4.2.1): max-age, else Expires minus Date, else a tenth of the time since Last-Modified, at most a day
///   (4.2.2). A max-age that is not a number means stale. no-cache: always stale (5.2.2.4).
/// - Age (4.2.3): the Age header plus the transfer time, or the time since Date, whichever is larger.
Freshness evaluate_freshness(const HttpHeaders& headers, std::int64_t requested_s, std::int64_t received_s);

/// Updates stored headers after a 304 response (4.3.4): headers in the response replace the stored ones.
HttpHeaders merge_headers(HttpHeaders stored, const HttpHeaders& not_modified);

}  // namespace tileflight::fetch
