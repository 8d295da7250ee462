#include "tileflight/tiles/fetch/http_client.h"

#include <curl/curl.h>

#include <algorithm>
#include <deque>
#include <future>
#include <list>
#include <mutex>
#include <random>
#include <stdexcept>
#include <thread>

#include "tileflight/tiles/fetch/http_transfer.h"

namespace tileflight::fetch {

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
