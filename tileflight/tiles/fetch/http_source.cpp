#include "tileflight/tiles/fetch/http_source.h"

#include <algorithm>
#include <ctime>
#include <nlohmann/json.hpp>
#include <string_view>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/tiles/fetch/uri.h"
#include "tileflight/tiles/fetch/url_secrets.h"

namespace tileflight::fetch {
namespace {

/// The header of a cache entry that says where the redirects of its request ended.
constexpr const char* kFinalUrl = "tileflight-final-url";

std::string describe_status(long status) {
  switch (status) {
    case 400:
      return "bad request";
    case 401:
      return "not authorised: the key or token is missing, wrong or expired";
    case 403:
      return "forbidden: the key or token does not permit it";
    case 404:
      return "not found";
    case 410:
      return "gone";
    default:
      return "";
  }
}

/// Text of an XML element of an S3 error: <Error><Code>AccessDenied</Code><Message>…</Message>…; empty: there is none.
std::string xml_text(const HttpResponse& response, const std::string& element) {
  constexpr std::size_t kLongest = 200;
  const std::string_view body = base::as_text(response.body);
  const std::string opening = "<" + element + ">";
  const std::size_t begin = body.find(opening);
  if (begin == std::string_view::npos) return "";
  const std::string_view text = body.substr(begin + opening.size());
  return std::string(text.substr(0, std::min(text.find('<'), kLongest)));
}

/// Error text of a JSON response: {"error": {"message"}} (Google) or {"message"} (Cesium ion).
std::string reason_of(const HttpResponse& response) {
  constexpr std::size_t kLongest = 200;
  const nlohmann::json json = nlohmann::json::parse(base::as_text(response.body), nullptr, false);
  if (!json.is_object()) return "";
  const nlohmann::json& holder = json.contains("error") && json["error"].is_object() ? json["error"] : json;
  if (!holder.contains("message") || !holder["message"].is_string()) return "";
  const std::string text = holder["message"].get<std::string>();
  return text.size() <= kLongest ? text : text.substr(0, kLongest) + "…";
}

/// A login or error page with a success status.
bool is_web_page(const HttpResponse& response) {
  if (response.header("content-type").find("html") == std::string::npos) return false;
  std::string start(base::as_text(response.body).substr(0, 256));
  start.erase(0, start.find_first_not_of(" \t\r\n\xEF\xBB\xBF"));
  return start.starts_with("<");
}

}  // namespace

HttpSource::HttpSource(std::unique_ptr<HttpProvider> provider, const HttpSourceOptions& options,
                       std::unique_ptr<HttpCache> cache, bool terms_accepted)
    : provider_(std::move(provider)),
      options_(options),
      cache_(std::move(cache)),
      client_(std::make_unique<HttpClient>(options.http)) {
  root_uri_ = resolve_uri("", provider_->resolve_root_url(*client_));
  policy_ = std::make_unique<OriginPolicy>(root_uri_, options_.allowed_hosts);
  if (!terms_accepted && provider_->terms().find_prohibition(Use::kCache) != nullptr) cache_.reset();
  if (cache_) writer_ = std::make_unique<HttpCacheWriter>(*cache_);
  may_use_stale_ = terms_accepted || provider_->terms().find_prohibition(Use::kOffline) == nullptr;
}

HttpSource::~HttpSource() {
  {
    const std::lock_guard lock(mutex_);
    prefetch_queue_.clear();
  }
  client_.reset();  // until then, its thread calls back into this object
}

std::vector<std::byte> HttpSource::read(const std::string& uri) {
  require_allowed(uri);
  provider_->refresh_credentials(*client_);
  std::optional<FetchResult> asked = take_prefetched(uri);
  if (!asked && is_fresh_in_cache(uri)) {
    const std::optional<CachedResponse> cached = find_cached(remove_secrets(uri));
    if (auto body = cached ? cached_body(uri, *cached) : std::nullopt) return *std::move(body);
  }
  if (!asked) asked = fetch(uri);
  const long status = asked->outcome.response.status;
  const bool is_refused = !asked->outcome.failure && status != 200 && status != 304;
  if (is_refused && policy_->is_same_origin(uri) && provider_->renew_credentials(*client_, status, asked->generation))
    asked = fetch(uri);
  return process_result(uri, *std::move(asked));
}

void HttpSource::require_allowed(const std::string& uri) const {
  policy_->check(uri);
  if (policy_->is_same_origin(uri)) provider_->require_allowed(uri);
}

HttpRequest HttpSource::make_request(const std::string& uri, bool conditional) {
  HttpRequest request;
  if (policy_->is_same_origin(uri)) {
    request = provider_->make_request(uri);
  } else {
    request.url = uri;
  }
  // Conditional headers are for the original URL only; a redirect's target has its own response.
  request.headers_for_redirect = [this, headers = request.headers](const std::string& target) {
    policy_->check(target);
    return policy_->is_same_origin(target) ? headers : std::vector<std::string>();
  };
  if (!cache_ || !conditional) return request;
  if (const std::optional<CachedResponse> cached = find_cached(remove_secrets(uri))) {
    const auto add = [&](const char* condition, const char* validator) {
      const auto it = cached->headers.find(validator);
      if (it != cached->headers.end()) request.headers.push_back(std::string(condition) + ": " + it->second);
    };
    add("If-None-Match", "etag");
    add("If-Modified-Since", "last-modified");
  }
  return request;
}

HttpSource::FetchResult HttpSource::fetch(const std::string& uri, bool conditional) {
  FetchResult asked;
  asked.generation = provider_->credential_generation();
  HttpRequest request = make_request(uri, conditional);
  request.urgent = true;
  try {
    asked.outcome.response = client_->get(std::move(request));
  } catch (const InputError& error) {
    asked.outcome.failure = error;
  }
  return asked;
}

std::optional<CachedResponse> HttpSource::find_cached(const std::string& key) {
  if (!cache_) return std::nullopt;
  writer_->wait_for(key);
  return cache_->find(key);
}

bool HttpSource::is_fresh_in_cache(const std::string& uri) {
  const std::optional<CachedResponse> cached = find_cached(remove_secrets(uri));
  return cached && cached->fresh_until_s > std::time(nullptr);
}

std::vector<std::byte> HttpSource::process_result(const std::string& uri, FetchResult asked) {
  if (asked.outcome.failure) return fall_back_to_stale(uri, *asked.outcome.failure);
  if (asked.outcome.response.status == 304) return process_not_modified(uri, asked.outcome.response);
  return process_response(uri, std::move(asked.outcome.response));
}

std::vector<std::byte> HttpSource::fall_back_to_stale(const std::string& uri, const InputError& failure) {
  const std::string key = remove_secrets(uri);
  const std::optional<CachedResponse> cached = may_use_stale_ ? find_cached(key) : std::nullopt;
  if (!cached || cached->must_revalidate) throw InputError(failure);
  auto body = cached_body(uri, *cached);
  if (!body) throw InputError(failure);
  const std::lock_guard lock(mutex_);
  ++used_stale_;
  return *std::move(body);
}

std::vector<std::byte> HttpSource::process_not_modified(const std::string& uri, const HttpResponse& response) {
  const std::string key = remove_secrets(uri);
  const std::optional<CachedResponse> cached = find_cached(key);
  auto body = cached ? cached_body(uri, *cached) : std::nullopt;
  if (!body) {  // the entry has been evicted meanwhile, or the request was not conditional
    FetchResult again = fetch(uri, false);
    if (!again.outcome.failure && again.outcome.response.status == 304) throw_http_error(uri, again.outcome.response);
    return process_result(uri, std::move(again));
  }
  const HttpHeaders headers = merge_headers(cached->headers, response.headers);
  const Freshness freshness = evaluate_freshness(headers, response.requested_at_s, response.received_at_s);
  if (freshness.may_store) {
    cache_->refresh(key, {headers, freshness.fresh_until_s, freshness.must_revalidate});
  } else {
    cache_->remove(key);
  }
  return *std::move(body);
}

std::vector<std::byte> HttpSource::process_response(const std::string& uri, HttpResponse response) {
  if (response.status != 200) throw_http_error(uri, response);
  if (is_web_page(response)) {
    throw InputError(uri_for_message(uri), "the server sent a web page instead of the file");
  }
  provider_->observe_response(uri, response.body);
  note_redirect(uri, response.redirected ? remove_secrets(response.url) : "");
  if (cache_) store_in_cache(uri, response);
  return std::move(response.body);
}

std::optional<std::vector<std::byte>> HttpSource::cached_body(const std::string& uri, const CachedResponse& cached) {
  const auto final_url = cached.headers.find(kFinalUrl);
  note_redirect(uri, final_url == cached.headers.end() ? "" : final_url->second);
  return cache_->body(remove_secrets(uri));
}

void HttpSource::note_redirect(const std::string& uri, const std::string& final_url) {
  const std::lock_guard lock(mutex_);
  if (final_url.empty()) {
    redirected_.erase(uri);
  } else {
    redirected_[uri] = final_url;
  }
}

std::string HttpSource::base_uri(const std::string& uri) const {
  std::string final_url;
  {
    const std::lock_guard lock(mutex_);
    const auto it = redirected_.find(uri);
    if (it == redirected_.end()) return uri;
    final_url = it->second;
  }
  // Its parameters belong to the server that asked for them.
  return parse_origin(final_url) == parse_origin(uri) ? inherit_query_parameters(final_url, uri) : final_url;
}

void HttpSource::store_in_cache(const std::string& uri, const HttpResponse& response) {
  const std::string key = remove_secrets(uri);
  const Freshness freshness = evaluate_freshness(response.headers, response.requested_at_s, response.received_at_s);
  std::vector<std::string> secrets = provider_->secrets();
  // A tileset may pass its session on to its children.
  const std::string_view text = base::as_text(response.body);
  if (text.find_first_not_of(" \t\r\n\xEF\xBB\xBF") == text.find('{')) {
    for (const char* sign : {"session=", "key=", "token="}) secrets.emplace_back(sign);
  }
  const bool holds_secret = std::any_of(secrets.begin(), secrets.end(), [&](const std::string& secret) {
    return !secret.empty() && text.find(secret) != std::string_view::npos;
  });
  if (freshness.may_store && !holds_secret) {
    HttpHeaders headers = response.headers;
    headers.erase(kFinalUrl);
    if (response.redirected) headers[kFinalUrl] = remove_secrets(response.url);
    writer_->store({key, {headers, freshness.fresh_until_s, freshness.must_revalidate}, response.body});
  } else {
    writer_->wait_for(key);
    cache_->remove(key);
  }
}

std::vector<std::string> HttpSource::warnings() const {
  std::vector<std::string> out;
  if (cache_) {
    writer_->wait_for_all();
    out = cache_->warnings();
    for (const std::string& warning : writer_->warnings()) {
      if (std::find(out.begin(), out.end(), warning) == out.end()) out.push_back(warning);
    }
  }
  const std::lock_guard lock(mutex_);
  if (used_stale_ > 0) {
    out.push_back(uri_for_message(root_uri_) + ": the server was not reachable to revalidate " +
                  std::to_string(used_stale_) + " cached files; the cached copies were used");
  }
  return out;
}

void HttpSource::throw_http_error(const std::string& uri, const HttpResponse& response) const {
  std::string text = "the server answered with status " + std::to_string(response.status);
  if (const std::string meaning = describe_status(response.status); !meaning.empty()) text += " (" + meaning + ")";
  if (const std::string reason = reason_of(response); !reason.empty()) text += ": " + reason;
  if (const std::string code = xml_text(response, "Code"); !code.empty()) {
    const std::string message = xml_text(response, "Message"), cure = provider_->explain(code);
    text += ": " + code + (message.empty() ? "" : ", " + message) + (cure.empty() ? "" : " (" + cure + ")");
  }
  throw InputError(uri_for_message(uri), mask_secrets(text, provider_->secrets()));
}

bool HttpSource::prefetch(const std::vector<std::string>& uris) {
  std::unique_lock lock(mutex_);
  const std::set<std::string> kept(uris.begin(), uris.end());
  for (auto it = prefetches_.begin(); it != prefetches_.end();) {
    it->second.wanted = kept.contains(it->first);
    if (it->second.wanted || !it->second.done) {
      ++it;
      continue;
    }
    held_bytes_ -= it->second.result.outcome.response.body.size();
    it = prefetches_.erase(it);
  }
  prefetch_queue_.clear();
  std::set<std::string> listed;
  for (const std::string& uri : uris) {
    if (!is_data_uri(uri) && !prefetches_.contains(uri) && listed.insert(uri).second) prefetch_queue_.push_back(uri);
  }
  start_prefetches(lock);
  return true;
}

bool HttpSource::may_start_prefetch() const {
  const auto parallel = static_cast<std::size_t>(options_.http.max_parallel);
  // Twice the number of parallel requests, so that the client never runs out of work.
  return !prefetch_queue_.empty() && under_way_ < 2 * parallel &&
         held_bytes_ + (under_way_ + 1) * largest_bytes_ <= options_.max_prefetch_bytes;
}

void HttpSource::start_prefetches(std::unique_lock<std::mutex>& lock) {
  while (may_start_prefetch()) {
    const std::string uri = prefetch_queue_.front();
    prefetch_queue_.pop_front();
    if (prefetches_.contains(uri)) continue;
    try {
      require_allowed(uri);
    } catch (const InputError&) {
      continue;  // its reader reports the error
    }
    if (is_fresh_in_cache(uri)) continue;  // its reader finds it there
    prefetches_[uri].result.generation = provider_->credential_generation();
    ++under_way_;
    lock.unlock();
    client_->start(make_request(uri), [this, uri](HttpResult outcome) { on_prefetch_done(uri, std::move(outcome)); });
    lock.lock();
  }
}

void HttpSource::on_prefetch_done(const std::string& uri, HttpResult outcome) {
  std::unique_lock lock(mutex_);
  --under_way_;
  Prefetch& ahead = prefetches_.at(uri);
  if (ahead.wanted) {
    const std::uintmax_t bytes = outcome.response.body.size();
    held_bytes_ += bytes;
    largest_bytes_ = std::max(largest_bytes_, bytes);
    ahead.result.outcome = std::move(outcome);
    ahead.done = true;
  } else {
    prefetches_.erase(uri);
  }
  start_prefetches(lock);
  changed_.notify_all();
}

std::optional<HttpSource::FetchResult> HttpSource::take_prefetched(const std::string& uri) {
  std::unique_lock lock(mutex_);
  const auto it = prefetches_.find(uri);
  if (it == prefetches_.end()) {
    std::erase(prefetch_queue_, uri);  // it is requested now
    return std::nullopt;
  }
  it->second.wanted = true;
  changed_.wait(lock, [&] { return !prefetches_.contains(uri) || prefetches_.at(uri).done; });
  const auto found = prefetches_.find(uri);
  if (found == prefetches_.end()) return std::nullopt;  // another reader has taken it
  FetchResult taken = std::move(found->second.result);
  held_bytes_ -= taken.outcome.response.body.size();
  prefetches_.erase(found);
  start_prefetches(lock);
  changed_.notify_all();
  return taken;
}

}  // namespace tileflight::fetch
