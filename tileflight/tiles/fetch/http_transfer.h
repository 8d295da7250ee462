#pragma once

#include <curl/curl.h>

#include <chrono>
#include <memory>
#include <string>

#include "tileflight/tiles/fetch/http_client.h"

namespace tileflight::fetch {

/// One request of an HttpClient in progress: the request, the data received and the number of tries. Used only by the
/// client's own thread.
class HttpTransfer {
 public:
  using Clock = std::chrono::steady_clock;
  using Done = std::function<void(HttpResult)>;

  HttpTransfer(HttpRequest request, Done done, const HttpOptions& options);

  /// What to do after a try has ended.
  enum class NextStep { kFinished, kAgainAtOnce, kAgainLater };

  /// Prepares `easy` for the next try.
  void begin_try(CURL* easy, Clock::time_point now);
  /// Evaluates a finished try: a response, a redirect to follow, or a failure that may be retried.
  NextStep end_try(CURLcode code, Clock::time_point now, std::uint64_t random);
  /// Ends a stalled try, or a request that exceeded its total time; see `is_stalled`.
  NextStep end_stalled_try(Clock::time_point now, std::uint64_t random);

  bool is_stalled(Clock::time_point now);
  /// When `is_stalled` must be called next.
  Clock::time_point next_check() const;
  /// Earliest time of the next try.
  Clock::time_point due() const { return due_; }
  bool urgent() const { return request_.urgent; }
  CURL* easy() const { return easy_; }

  /// Passes the result to `done`.
  void finish();
  void fail(const std::string& what);

 private:
  NextStep follow_redirect(const std::string& target);
  NextStep retry(const std::string& cause, std::optional<std::chrono::milliseconds> asked, Clock::time_point now,
                 std::uint64_t random);
  NextStep give_up(const std::string& what);
  std::string cause_of(CURLcode code) const;
  std::string tries_text() const;
  /// Parses a header line of the response; false: the response is rejected.
  bool take_header(std::string_view line);
  bool take_body(const char* data, std::size_t bytes);
  static std::size_t on_header(char* data, std::size_t size, std::size_t count, void* self);
  static std::size_t on_body(char* data, std::size_t size, std::size_t count, void* self);

  struct FreeList {
    void operator()(curl_slist* list) const { curl_slist_free_all(list); }
  };

  HttpRequest request_;
  Done done_;
  const HttpOptions& options_;
  HttpResult outcome_;
  CURL* easy_ = nullptr;
  std::unique_ptr<curl_slist, FreeList> headers_;
  char error_text_[CURL_ERROR_SIZE] = {};
  std::string refusal_;  ///< why a callback stopped the transfer
  Clock::time_point deadline_;
  Clock::time_point due_;
  Clock::time_point window_start_;
  std::int64_t window_bytes_ = 0;
  std::size_t header_bytes_ = 0;
  int tries_ = 0;
  int redirects_ = 0;
  bool started_ = false;
};

}  // namespace tileflight::fetch
