#pragma once

#include <curl/curl.h>

#include <chrono>
#include <memory>
#include <string>

#include "tileflight/tiles/http_client.h"

namespace tileflight::tiles {

/// One request of an HttpClient on its way: what was asked, what has come, which try this is. Used by the client's own
/// thread alone.
class HttpTransfer {
 public:
  using Clock = std::chrono::steady_clock;
  using Done = std::function<void(HttpOutcome)>;

  HttpTransfer(HttpRequest request, Done done, const HttpOptions& options);

  /// What to do after a try has ended.
  enum class Next { kFinished, kAgainAtOnce, kAgainLater };

  /// Sets `easy` up for the next try.
  void begin_try(CURL* easy, Clock::time_point now);
  /// Judges a try that ended: an answer, a redirect to follow, or a failure that may be worth another try.
  Next end_try(CURLcode code, Clock::time_point now, std::uint64_t random);
  /// Ends a try whose bytes stopped coming, or the whole that took too long; see `is_stalled`.
  Next end_stalled_try(Clock::time_point now, std::uint64_t random);

  bool is_stalled(Clock::time_point now);
  /// When `is_stalled` is to be asked next.
  Clock::time_point next_check() const;
  /// The next try begins no sooner.
  Clock::time_point due() const { return due_; }
  bool urgent() const { return request_.urgent; }
  CURL* easy() const { return easy_; }

  /// Hands the outcome over.
  void finish();
  void fail(const std::string& what);

 private:
  Next follow_redirect(const std::string& target);
  Next retry(const std::string& cause, std::optional<std::chrono::milliseconds> asked, Clock::time_point now,
             std::uint64_t random);
  Next give_up(const std::string& what);
  std::string cause_of(CURLcode code) const;
  std::string tries_text() const;
  /// Takes a line of the answer's head; false: the answer is refused.
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
  HttpOutcome outcome_;
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

}  // namespace tileflight::tiles
