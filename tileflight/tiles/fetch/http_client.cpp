#include "tileflight/tiles/fetch/http_client.h"

#include <curl/curl.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <chrono>
#include <ctime>
#include <deque>
#include <filesystem>
#include <future>
#include <list>
#include <memory>
#include <mutex>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

#include "tileflight/core/base/text_parsing.h"
#include "tileflight/tiles/fetch/uri.h"
#include "tileflight/tiles/fetch/url_secrets.h"

namespace tileflight::fetch {
namespace {

/// Returns the system's file of trusted certificates where it lies elsewhere than libcurl was built to look, as it does
/// when the library comes from another distribution; otherwise empty.
const std::filesystem::path& system_certificates() {
  static const std::filesystem::path kFile = []() -> std::filesystem::path {
    const char* const usual = curl_version_info(CURLVERSION_NOW)->cainfo;
    if (usual != nullptr && std::filesystem::exists(usual)) return {};
    // Debian and Arch; Fedora and Red Hat; openSUSE; Alpine.
    for (const char* file : {"/etc/ssl/certs/ca-certificates.crt", "/etc/pki/tls/certs/ca-bundle.crt",
                             "/etc/ssl/ca-bundle.pem", "/etc/ssl/cert.pem"})
      if (std::filesystem::exists(file)) return file;
    return {};
  }();
  return kFile;
}

using std::chrono::milliseconds;

bool is_redirect(long status) {
  return status == 301 || status == 302 || status == 303 || status == 307 || status == 308;
}

/// Whether a retry may succeed: the connection failed, was lost, or stalled.
bool is_connection_fault(CURLcode code) {
  switch (code) {
    case CURLE_COULDNT_RESOLVE_HOST:
    case CURLE_COULDNT_CONNECT:
    case CURLE_PARTIAL_FILE:
    case CURLE_OPERATION_TIMEDOUT:
    case CURLE_SSL_CONNECT_ERROR:
    case CURLE_GOT_NOTHING:
    case CURLE_SEND_ERROR:
    case CURLE_RECV_ERROR:
    case CURLE_HTTP2:
    case CURLE_HTTP2_STREAM:
    case CURLE_BAD_CONTENT_ENCODING:
      return true;
    default:
      return false;
  }
}

/// Whether a URL's host is this machine, so that no proxy is involved.
bool is_loopback(const std::string& url) {
  const std::size_t slashes = url.find("//");
  if (slashes == std::string::npos) return false;
  const std::string rest = url.substr(slashes + 2);
  return rest.starts_with("127.0.0.1") || rest.starts_with("localhost") || rest.starts_with("[::1]");
}

std::string text_of(milliseconds time) {
  return time.count() % 1000 == 0 ? std::to_string(time.count() / 1000) + " s" : std::to_string(time.count()) + " ms";
}

/// One request of an HttpClient in progress: the request, the data received and the number of tries. Used only by the
/// client's own thread.
class HttpTransfer {
 public:
  using Clock = std::chrono::steady_clock;
  using Done = std::function<void(HttpResult)>;

  HttpTransfer(HttpRequest request, Done done, const HttpOptions& options)
      : request_(std::move(request)), done_(std::move(done)), options_(options), due_(Clock::time_point::min()) {}

  /// The step that follows a try.
  enum class NextStep { kFinished, kAgainAtOnce, kAgainLater };

  /// Prepares `easy` for the next try.
  void begin_try(CURL* easy, Clock::time_point now) {
    if (!started_) deadline_ = now + options_.whole_timeout;
    started_ = true;
    ++tries_;
    easy_ = easy;
    outcome_.response = {};
    outcome_.response.url = request_.url;
    outcome_.response.redirected = redirects_ > 0;
    outcome_.response.requested_at_s = std::time(nullptr);
    refusal_.clear();
    error_text_[0] = '\0';
    window_start_ = now;
    window_bytes_ = 0;
    header_bytes_ = 0;

    curl_easy_reset(easy);
    const auto set = [easy](CURLoption option, auto value) { curl_easy_setopt(easy, option, value); };
    set(CURLOPT_URL, request_.url.c_str());
    set(CURLOPT_PROTOCOLS_STR, "http,https");
    set(CURLOPT_FOLLOWLOCATION, 0L);
    set(CURLOPT_NOSIGNAL, 1L);
    set(CURLOPT_HTTP_VERSION, static_cast<long>(CURL_HTTP_VERSION_2TLS));
    // Waiting for the handshake of a connection pays off, because it then carries many streams.
    set(CURLOPT_PIPEWAIT, uri_scheme(request_.url) == "https" ? 1L : 0L);
    set(CURLOPT_ACCEPT_ENCODING, "");  // all encodings that libcurl supports: gzip, br, zstd, deflate
    set(CURLOPT_USERAGENT, "tileflight");
    set(CURLOPT_CONNECTTIMEOUT_MS, static_cast<long>(options_.connect_timeout.count()));
    if (const std::filesystem::path& certificates = options_.ca_file.empty() ? system_certificates() : options_.ca_file;
        !certificates.empty())
      set(CURLOPT_CAINFO, certificates.c_str());
    if (is_loopback(request_.url)) set(CURLOPT_PROXY, "");
    curl_slist* list = nullptr;
    for (const std::string& header : request_.headers) list = curl_slist_append(list, header.c_str());
    headers_.reset(list);
    set(CURLOPT_HTTPHEADER, headers_.get());
    if (const auto& signature = request_.signature) {
      set(CURLOPT_AWS_SIGV4, ("aws:amz:" + signature->region + ":s3").c_str());
      set(CURLOPT_USERNAME, signature->access_key_id.c_str());
      set(CURLOPT_PASSWORD, signature->secret_access_key.c_str());
    }
    set(CURLOPT_ERRORBUFFER, static_cast<char*>(error_text_));
    set(CURLOPT_HEADERFUNCTION, &HttpTransfer::on_header);
    set(CURLOPT_HEADERDATA, this);
    set(CURLOPT_WRITEFUNCTION, &HttpTransfer::on_body);
    set(CURLOPT_WRITEDATA, this);
    set(CURLOPT_PRIVATE, this);
  }

  /// Evaluates a finished try: a response, a redirect to follow, or a failure that may be retried.
  NextStep end_try(CURLcode code, Clock::time_point now, std::uint64_t random) {
    HttpResponse& response = outcome_.response;
    curl_easy_getinfo(easy_, CURLINFO_RESPONSE_CODE, &response.status);
    easy_ = nullptr;
    response.tries = tries_;
    response.received_at_s = std::time(nullptr);
    if (!refusal_.empty()) return give_up(refusal_);
    if (code != CURLE_OK) {
      if (is_connection_fault(code)) return retry(cause_of(code), std::nullopt, now, random);
      return give_up(cause_of(code));
    }
    if (is_redirect(response.status) && !response.header("location").empty()) {
      return follow_redirect(resolve_uri(request_.url, response.header("location")));
    }
    if (is_retryable_status(response.status)) {
      const auto asked = parse_retry_after(response.header("retry-after"), std::time(nullptr));
      return retry("answered with status " + std::to_string(response.status), asked, now, random);
    }
    return NextStep::kFinished;
  }

  /// Ends a stalled try, or a request that exceeded its total time; see `is_stalled`.
  NextStep end_stalled_try(Clock::time_point now, std::uint64_t random) {
    easy_ = nullptr;
    if (now >= deadline_) return give_up("took longer than " + text_of(options_.whole_timeout));
    return retry(
        "stalled: fewer than " + std::to_string(options_.stall_bytes) + " bytes in " + text_of(options_.stall_timeout),
        std::nullopt, now, random);
  }

  bool is_stalled(Clock::time_point now) {
    if (now >= deadline_) return true;
    if (now - window_start_ < options_.stall_timeout) return false;
    if (window_bytes_ < options_.stall_bytes) return true;
    window_start_ = now;
    window_bytes_ = 0;
    return false;
  }

  /// When `is_stalled` must be called next.
  Clock::time_point next_check() const { return std::min(deadline_, window_start_ + options_.stall_timeout); }
  /// Earliest time of the next try.
  Clock::time_point due() const { return due_; }
  bool urgent() const { return request_.urgent; }
  CURL* easy() const { return easy_; }

  /// Passes the result to `done`.
  void finish() {
    if (done_) std::exchange(done_, {})(std::move(outcome_));
  }

  void fail(const std::string& what) {
    outcome_.failure = InputError(uri_for_message(request_.url), what);
    finish();
  }

 private:
  NextStep follow_redirect(const std::string& target) {
    if (++redirects_ > options_.max_redirects) {
      return give_up("is redirected more than " + std::to_string(options_.max_redirects) + " times");
    }
    if (request_.signature)
      return give_up("is redirected to " + uri_for_message(target) +
                     ", where its signature is not valid: check AWS_REGION and AWS_ENDPOINT_URL");
    if (!request_.headers_for_redirect)
      return give_up("is redirected to " + uri_for_message(target) + ", which is not allowed");
    try {
      request_.headers = request_.headers_for_redirect(target);
      request_.url = target;
      --tries_;  // this try is not counted as a failure
      return NextStep::kAgainAtOnce;
    } catch (const InputError& error) {
      outcome_.failure = InputError(uri_for_message(request_.url), std::string("is redirected, but ") + error.what());
      return NextStep::kFinished;
    }
  }

  NextStep retry(const std::string& cause, std::optional<std::chrono::milliseconds> asked, Clock::time_point now,
                 std::uint64_t random) {
    if (tries_ >= options_.retry.max_tries) return give_up(cause + tries_text());
    if (asked && *asked > options_.retry.max_retry_after) {
      return give_up(cause + " and asks to wait " + text_of(*asked) + "; try again later");
    }
    const milliseconds wait = std::max(backoff(options_.retry, tries_, random), asked.value_or(milliseconds(0)));
    if (now + wait >= deadline_)
      return give_up(cause + tries_text() + "; took longer than " + text_of(options_.whole_timeout));
    due_ = now + wait;
    return NextStep::kAgainLater;
  }

  NextStep give_up(const std::string& what) {
    outcome_.failure = InputError(uri_for_message(request_.url), what);
    return NextStep::kFinished;
  }

  std::string cause_of(CURLcode code) const {
    const std::string text = error_text_[0] != '\0' ? error_text_ : curl_easy_strerror(code);
    if (code == CURLE_PARTIAL_FILE) {
      return "the connection was closed early, after " + std::to_string(outcome_.response.body.size()) + " bytes";
    }
    return "cannot be fetched: " + text;
  }

  std::string tries_text() const { return tries_ > 1 ? " (" + std::to_string(tries_) + " tries)" : std::string(); }
  /// Parses a header line of the response; false: the response is rejected.
  bool take_header(std::string_view line) {
    window_bytes_ += static_cast<std::int64_t>(line.size());
    constexpr std::size_t kMostHeaderBytes = 256 * 1024;
    auto& headers = outcome_.response.headers;
    header_bytes_ += line.size();
    if (header_bytes_ > kMostHeaderBytes) {
      refusal_ = "sends more than " + std::to_string(kMostHeaderBytes) + " bytes of headers";
      return false;
    }
    if (line.starts_with("HTTP/")) {  // headers of another response (a 100 Continue came before)
      headers.clear();
      return true;
    }
    const std::size_t colon = line.find(':');
    if (colon == std::string_view::npos) return true;
    std::string name(base::trim(line.substr(0, colon)));
    std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::tolower(c); });
    const std::string value(base::trim(line.substr(colon + 1)));
    std::string& kept = headers[name];
    kept += (kept.empty() ? "" : ", ") + value;
    if (name != "content-length") return true;
    std::uintmax_t announced = 0;
    const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), announced);
    const bool too_large = error == std::errc::result_out_of_range || announced > options_.max_response_bytes;
    if (!too_large) return true;
    refusal_ =
        "declares " + value + " bytes, more than the " + std::to_string(options_.max_response_bytes) + " allowed";
    return false;
  }

  bool take_body(const char* data, std::size_t bytes) {
    window_bytes_ += static_cast<std::int64_t>(bytes);
    std::vector<std::byte>& body = outcome_.response.body;
    if (body.size() + bytes > options_.max_response_bytes) {
      refusal_ = "sends more than the " + std::to_string(options_.max_response_bytes) + " bytes allowed";
      return false;
    }
    const auto* first = reinterpret_cast<const std::byte*>(data);
    body.insert(body.end(), first, first + bytes);
    return true;
  }

  static std::size_t on_header(char* data, std::size_t size, std::size_t count, void* self) {
    return static_cast<HttpTransfer*>(self)->take_header({data, size * count}) ? size * count : 0;
  }

  static std::size_t on_body(char* data, std::size_t size, std::size_t count, void* self) {
    return static_cast<HttpTransfer*>(self)->take_body(data, size * count) ? size * count : 0;
  }

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

}  // namespace

bool is_retryable_status(long status) {
  switch (status) {
    case 408:
    case 425:
    case 429:
    case 500:
    case 502:
    case 503:
    case 504:
      return true;
    default:
      return false;
  }
}

std::optional<std::chrono::milliseconds> parse_retry_after(std::string_view text, std::time_t now) {
  while (text.starts_with(' ')) text.remove_prefix(1);
  while (text.ends_with(' ')) text.remove_suffix(1);
  constexpr std::int64_t kMostSeconds = 1'000'000'000;
  std::int64_t seconds = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), seconds);
  if (error == std::errc() && end == text.data() + text.size()) {
    if (seconds < 0) return std::nullopt;
  } else if (error == std::errc::result_out_of_range) {
    seconds = kMostSeconds;
  } else {
    const std::time_t date = curl_getdate(std::string(text).c_str(), nullptr);
    if (date < 0) return std::nullopt;
    seconds = static_cast<std::int64_t>(date) - static_cast<std::int64_t>(now);
  }
  return std::chrono::seconds(std::clamp<std::int64_t>(seconds, 0, kMostSeconds));
}

std::chrono::milliseconds backoff(const RetryOptions& options, int tries_done, std::uint64_t random) {
  const int doublings = std::clamp(tries_done - 1, 0, 30);
  const std::int64_t whole_ms =
      std::min<std::int64_t>(options.initial_backoff.count() << doublings, options.max_backoff.count());
  const std::int64_t half_ms = whole_ms / 2;
  const auto share = static_cast<std::int64_t>(random & 0xFFFFFFFFU);
  return std::chrono::milliseconds(half_ms + ((whole_ms - half_ms) * share >> 32));
}

std::string HttpResponse::header(const std::string& lower_case_name) const {
  const auto it = headers.find(lower_case_name);
  return it == headers.end() ? std::string() : it->second;
}

/// The thread and its transfers. A transfer is in one of three places: `queue_` (waits for a free slot), `running_`
/// (handed to libcurl), `later_` (waits for its next try).
class HttpClient::Engine {
 public:
  explicit Engine(const HttpOptions& options) : options_(options), random_(options.jitter_seed) {
    static const CURLcode ready = curl_global_init(CURL_GLOBAL_DEFAULT);
    multi_ = curl_multi_init();
    if (ready != CURLE_OK || multi_ == nullptr) throw std::runtime_error("libcurl cannot be initialised");
    curl_multi_setopt(multi_, CURLMOPT_PIPELINING, CURLPIPE_MULTIPLEX);
    curl_multi_setopt(multi_, CURLMOPT_MAXCONNECTS, static_cast<long>(options_.max_parallel));
    thread_ = std::thread([this] { run(); });
  }
  Engine(const Engine&) = delete;
  Engine& operator=(const Engine&) = delete;

  ~Engine() {
    {
      const std::lock_guard lock(mutex_);
      stopping_ = true;
    }
    curl_multi_wakeup(multi_);
    thread_.join();
    for (CURL* easy : idle_) curl_easy_cleanup(easy);
    curl_multi_cleanup(multi_);
  }

  void submit(std::unique_ptr<HttpTransfer> transfer) {
    {
      const std::lock_guard lock(mutex_);
      submitted_.push_back(std::move(transfer));
    }
    curl_multi_wakeup(multi_);
  }

  const HttpOptions& options() const { return options_; }

 private:
  using Clock = HttpTransfer::Clock;
  using Transfers = std::list<std::unique_ptr<HttpTransfer>>;

  void run() {
    while (take_submitted()) {
      begin_tries();
      int running = 0;
      curl_multi_perform(multi_, &running);
      end_tries();
      end_stalled();
      curl_multi_poll(multi_, nullptr, 0, wait_ms(), nullptr);
    }
  }

  /// False: the client is being destroyed.
  bool take_submitted() {
    std::deque<std::unique_ptr<HttpTransfer>> submitted;
    bool stopping = false;
    {
      const std::lock_guard lock(mutex_);
      submitted.swap(submitted_);
      stopping = stopping_;
    }
    for (std::unique_ptr<HttpTransfer>& transfer : submitted) {
      queue_.insert(transfer->urgent() ? queue_.begin() : queue_.end(), std::move(transfer));
    }
    if (stopping) abandon_all();
    return !stopping;
  }

  void abandon_all() {
    for (const std::unique_ptr<HttpTransfer>& transfer : running_) release(transfer->easy());
    for (Transfers* place : {&running_, &queue_, &later_}) {
      for (const std::unique_ptr<HttpTransfer>& transfer : *place) transfer->fail("cancelled");
      place->clear();
    }
  }

  void begin_tries() {
    const Clock::time_point now = Clock::now();
    for (auto it = later_.begin(); it != later_.end();) {
      const auto current = it++;
      if ((*current)->due() <= now) queue_.splice(queue_.begin(), later_, current);
    }
    while (!queue_.empty() && running_.size() < static_cast<std::size_t>(options_.max_parallel)) {
      CURL* easy = idle_handle();
      queue_.front()->begin_try(easy, now);
      curl_multi_add_handle(multi_, easy);
      running_.splice(running_.end(), queue_, queue_.begin());
    }
  }

  CURL* idle_handle() {
    if (idle_.empty()) return curl_easy_init();
    CURL* easy = idle_.back();
    idle_.pop_back();
    return easy;
  }

  void release(CURL* easy) {
    curl_multi_remove_handle(multi_, easy);
    idle_.push_back(easy);
  }

  void end_tries() {
    int waiting = 0;
    while (const CURLMsg* message = curl_multi_info_read(multi_, &waiting)) {
      if (message->msg != CURLMSG_DONE) continue;
      CURL* easy = message->easy_handle;
      const CURLcode code = message->data.result;
      const auto it = std::find_if(running_.begin(), running_.end(), [&](const auto& t) { return t->easy() == easy; });
      const HttpTransfer::NextStep next = (*it)->end_try(code, Clock::now(), random_());
      release(easy);
      proceed(it, next);
    }
  }

  void end_stalled() {
    const Clock::time_point now = Clock::now();
    for (auto it = running_.begin(); it != running_.end();) {
      const auto current = it++;
      if (!(*current)->is_stalled(now)) continue;
      release((*current)->easy());
      proceed(current, (*current)->end_stalled_try(now, random_()));
    }
  }

  void proceed(Transfers::iterator it, HttpTransfer::NextStep next) {
    if (next == HttpTransfer::NextStep::kAgainAtOnce) {
      queue_.splice(queue_.begin(), running_, it);
    } else if (next == HttpTransfer::NextStep::kAgainLater) {
      later_.splice(later_.end(), running_, it);
    } else {
      const std::unique_ptr<HttpTransfer> transfer = std::move(*it);
      running_.erase(it);
      transfer->finish();
    }
  }

  int wait_ms() const {
    const Clock::time_point now = Clock::now();
    if (!queue_.empty() && running_.size() < static_cast<std::size_t>(options_.max_parallel)) return 0;
    Clock::time_point until = now + std::chrono::seconds(60);
    for (const auto& transfer : running_) until = std::min(until, transfer->next_check());
    for (const auto& transfer : later_) until = std::min(until, transfer->due());
    const auto wait = std::chrono::ceil<std::chrono::milliseconds>(until - now).count();
    return static_cast<int>(std::max<std::int64_t>(wait, 0));
  }

  HttpOptions options_;
  std::mt19937_64 random_;
  CURLM* multi_ = nullptr;
  std::vector<CURL*> idle_;
  Transfers queue_, running_, later_;
  std::mutex mutex_;  ///< guards the members below
  std::deque<std::unique_ptr<HttpTransfer>> submitted_;
  bool stopping_ = false;
  std::thread thread_;
};

HttpClient::HttpClient(const HttpOptions& options) : engine_(std::make_unique<Engine>(options)) {}

HttpClient::~HttpClient() = default;

void HttpClient::start(HttpRequest request, std::function<void(HttpResult)> done) {
  engine_->submit(std::make_unique<HttpTransfer>(std::move(request), std::move(done), engine_->options()));
}

HttpResponse HttpClient::get(HttpRequest request) {
  request.urgent = true;
  const auto promise = std::make_shared<std::promise<HttpResult>>();  // shared, because it must outlive this call
  start(std::move(request), [promise](HttpResult outcome) { promise->set_value(std::move(outcome)); });
  HttpResult outcome = promise->get_future().get();
  if (outcome.failure) throw *outcome.failure;
  return std::move(outcome.response);
}

}  // namespace tileflight::fetch
