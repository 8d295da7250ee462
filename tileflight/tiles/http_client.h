#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/geometry/input_error.h"
#include "tileflight/tiles/http_options.h"

namespace tileflight::tiles {

struct HttpRequest {
  std::string url;                   ///< http or https
  std::vector<std::string> headers;  ///< "Name: value"
  /// Asked before a redirect is followed: the headers for that place. Throws InputError where it may not be gone to.
  /// Empty: redirects are not followed.
  std::function<std::vector<std::string>(const std::string& target)> redirected;
  bool urgent = false;  ///< before all that wait
};

struct HttpResponse {
  long status = 0;
  std::string url;                             ///< where it came from, redirects followed
  std::map<std::string, std::string> headers;  ///< names in lower case; several of one name joined by ", "
  std::vector<std::byte> body;                 ///< unpacked
  int tries = 0;
  std::int64_t requested_at_s = 0;  ///< Unix times of the last try
  std::int64_t received_at_s = 0;

  /// A header's value; empty where there is none.
  std::string header(const std::string& lower_case_name) const;
};

/// An answer of whatever status, or why there is none (unreachable, too slow, too large, redirected to where it may not
/// go, cancelled).
struct HttpOutcome {
  HttpResponse response;
  std::optional<InputError> failure;
};

/// Fetches over HTTP/1.1 and HTTP/2 (libcurl multi). A thread of its own drives all transfers; connections are kept and
/// shared. What may be another answer later (429, 5xx, a lost connection) is tried again with exponential backoff and
/// jitter, no sooner than the server asks for. Safe from several threads at once. URLs in messages are redacted.
class HttpClient {
 public:
  explicit HttpClient(const HttpOptions& options = {});
  HttpClient(const HttpClient&) = delete;
  HttpClient& operator=(const HttpClient&) = delete;
  /// Cancels what is under way.
  ~HttpClient();

  /// `done` is called once, from the client's own thread, and must neither block nor throw.
  void start(HttpRequest request, std::function<void(HttpOutcome)> done);
  /// Waits for the answer. Throws InputError where there is none.
  HttpResponse get(HttpRequest request);
  /// Everything under way and everything asked for from now on ends at once with "cancelled".
  void cancel();

 private:
  class Engine;
  std::unique_ptr<Engine> engine_;
};

}  // namespace tileflight::tiles
