#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <ctime>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/fetch/http_options.h"

namespace tileflight::fetch {

/// Returns whether a status may be transient: 408, 425, 429, 500, 502, 503, 504 (RFC 9110, section 15; RFC 6585, 8470).
bool is_retryable_status(long status);

/// Parses a Retry-After header (RFC 9110, section 10.2.3): seconds, or a date, which is taken relative to `now` (0 for
/// a past date). Returns nullopt if it is neither.
std::optional<std::chrono::milliseconds> parse_retry_after(std::string_view text, std::time_t now);

/// Returns the wait before try `tries_done` + 1, by exponential backoff with jitter: between half and all of
/// initial_backoff * 2^(tries_done - 1), at most max_backoff. `random`: any number; its lowest 32 bits choose the
/// jitter.
std::chrono::milliseconds backoff(const RetryOptions& options, int tries_done, std::uint64_t random);

/// Keys by which libcurl signs each try of a request with AWS Signature Version 4, for the service s3.
struct AwsSignature {
  std::string region, access_key_id, secret_access_key;
};

/// A GET request.
struct HttpRequest {
  std::string url;                   ///< http or https
  std::vector<std::string> headers;  ///< "Name: value"
  /// Called before a redirect is followed; returns the headers for the target. Throws InputError if the target is not
  /// allowed. Empty: redirects are not followed.
  std::function<std::vector<std::string>(const std::string& target)> headers_for_redirect;
  std::optional<AwsSignature> signature;  ///< a signed request follows no redirect
  bool urgent = false;                    ///< takes precedence over waiting requests
};

/// A response of any status.
struct HttpResponse {
  long status = 0;
  std::string url;  ///< final URL, after redirects
  bool redirected = false;
  std::map<std::string, std::string> headers;  ///< names in lower case; repeated headers are joined by ", "
  std::vector<std::byte> body;                 ///< decompressed
  int tries = 0;
  std::int64_t requested_at_s = 0;  ///< Unix times of the last try
  std::int64_t received_at_s = 0;

  /// Returns a header's value; empty if the header is missing.
  std::string header(const std::string& lower_case_name) const;
};

/// A response, or the reason why there is none (unreachable, too slow, too large, redirect not allowed, cancelled).
struct HttpResult {
  HttpResponse response;
  std::optional<InputError> failure;
};

/// HTTP/1.1 and HTTP/2 client (libcurl multi). One internal thread drives all transfers; connections are kept alive and
/// shared. Transient failures (429, 5xx, a lost connection) are retried with exponential backoff and jitter, no sooner
/// than the server asks for. Thread safe. URLs in messages are redacted.
class HttpClient {
 public:
  explicit HttpClient(const HttpOptions& options = {});
  HttpClient(const HttpClient&) = delete;
  HttpClient& operator=(const HttpClient&) = delete;
  /// All requests that have not ended fail with "cancelled".
  ~HttpClient();

  /// Starts a request. `done` is called once, from the client's own thread, and must neither block nor throw.
  void start(HttpRequest request, std::function<void(HttpResult)> done);
  /// Sends a request and waits for the response. Throws InputError if there is none.
  HttpResponse get(HttpRequest request);

 private:
  class Engine;
  std::unique_ptr<Engine> engine_;
};

}  // namespace tileflight::fetch
