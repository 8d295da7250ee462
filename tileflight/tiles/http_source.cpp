#include "tileflight/tiles/http_source.h"

#include <algorithm>
#include <ctime>
#include <nlohmann/json.hpp>
#include <string_view>

#include "tileflight/geometry/input_error.h"
#include "tileflight/tiles/uri.h"
#include "tileflight/tiles/url_secrets.h"

namespace tileflight::tiles {
namespace {

std::string_view as_text(const std::vector<std::byte>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

std::string meaning_of(long status) {
  switch (status) {
    case 400:
      return "bad request";
    case 401:
      return "not authorised: the key or token is missing, wrong or has run out";
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

/// The reason that services give in JSON: {"error": {"message"}} (Google) or {"message"} (Cesium ion).
std::string reason_of(const HttpResponse& response) {
  constexpr std::size_t kLongest = 200;
  const nlohmann::json json = nlohmann::json::parse(as_text(response.body), nullptr, false);
  if (!json.is_object()) return "";
  const nlohmann::json& holder = json.contains("error") && json["error"].is_object() ? json["error"] : json;
  if (!holder.contains("message") || !holder["message"].is_string()) return "";
  const std::string text = holder["message"].get<std::string>();
  return text.size() <= kLongest ? text : text.substr(0, kLongest) + "…";
}

/// A login or error page that came with a status of success.
bool is_web_page(const HttpResponse& response) {
  if (response.header("content-type").find("html") == std::string::npos) return false;
  std::string start(as_text(response.body).substr(0, 256));
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
  root_uri_ = resolve_uri("", provider_->open(*client_));
  policy_ = std::make_unique<OriginPolicy>(root_uri_, options_.allowed_hosts);
  if (!terms_accepted && provider_->terms().forbids(Use::kCache) != nullptr) cache_.reset();
  if (cache_) writer_ = std::make_unique<HttpCacheWriter>(*cache_);
  may_use_stale_ = terms_accepted || provider_->terms().forbids(Use::kOffline) == nullptr;
}

HttpSource::~HttpSource() {
  {
    const std::lock_guard lock(mutex_);
    wanted_.clear();
  }
  client_.reset();  // its thread calls back into this object until then
}

void HttpSource::cancel() { client_->cancel(); }

std::vector<std::byte> HttpSource::read(const std::string& uri) {
  policy_->check(uri);
  provider_->refresh(*client_);
  std::optional<Asked> asked = take_ahead(uri);
  if (!asked && is_fresh_in_cache(uri)) {
    if (auto body = cache_->body(without_secrets(uri))) return *std::move(body);
  }
  if (!asked) asked = ask(uri);
  const long status = asked->outcome.response.status;
  const bool is_refused = !asked->outcome.failure && status != 200 && status != 304;
  if (is_refused && policy_->is_own(uri) && provider_->renew(*client_, status, asked->generation)) asked = ask(uri);
  return settle(uri, *std::move(asked));
}

HttpRequest HttpSource::request_for(const std::string& uri, bool conditional) {
  HttpRequest request;
  if (policy_->is_own(uri)) {
    request = provider_->request(uri);
  } else {
    request.url = uri;
  }
  // Conditions stay where they were asked; a redirect's target is another answer.
  request.redirected = [this, headers = request.headers](const std::string& target) {
    policy_->check(target);
    return policy_->is_own(target) ? headers : std::vector<std::string>();
  };
  if (!cache_ || !conditional) return request;
  if (const std::optional<CachedAnswer> cached = find_cached(without_secrets(uri))) {
    const auto add = [&](const char* condition, const char* validator) {
      const auto it = cached->headers.find(validator);
      if (it != cached->headers.end()) request.headers.push_back(std::string(condition) + ": " + it->second);
    };
    add("If-None-Match", "etag");
    add("If-Modified-Since", "last-modified");
  }
  return request;
}

HttpSource::Asked HttpSource::ask(const std::string& uri, bool conditional) {
  Asked asked;
  asked.generation = provider_->generation();
  HttpRequest request = request_for(uri, conditional);
  request.urgent = true;
  try {
    asked.outcome.response = client_->get(std::move(request));
  } catch (const InputError& error) {
    asked.outcome.failure = error;
  }
  return asked;
}

std::optional<CachedAnswer> HttpSource::find_cached(const std::string& key) {
  if (!cache_) return std::nullopt;
  writer_->wait_for(key);
  return cache_->find(key);
}

bool HttpSource::is_fresh_in_cache(const std::string& uri) {
  const std::optional<CachedAnswer> cached = find_cached(without_secrets(uri));
  return cached && cached->fresh_until_s > std::time(nullptr);
}

std::vector<std::byte> HttpSource::settle(const std::string& uri, Asked asked) {
  if (asked.outcome.failure) return settle_without_answer(uri, *asked.outcome.failure);
  if (asked.outcome.response.status == 304) return settle_not_modified(uri, asked.outcome.response);
  return settle_answer(uri, std::move(asked.outcome.response));
}

std::vector<std::byte> HttpSource::settle_without_answer(const std::string& uri, const InputError& failure) {
  const std::string key = without_secrets(uri);
  const std::optional<CachedAnswer> cached = may_use_stale_ ? find_cached(key) : std::nullopt;
  if (!cached || cached->must_revalidate) throw InputError(failure);
  auto body = cache_->body(key);
  if (!body) throw InputError(failure);
  const std::lock_guard lock(mutex_);
  ++used_stale_;
  return *std::move(body);
}

std::vector<std::byte> HttpSource::settle_not_modified(const std::string& uri, const HttpResponse& response) {
  const std::string key = without_secrets(uri);
  const std::optional<CachedAnswer> cached = find_cached(key);
  auto body = cached ? cache_->body(key) : std::nullopt;
  if (!body) {  // it has left the cache since, or the server was not asked about one
    Asked again = ask(uri, false);
    if (!again.outcome.failure && again.outcome.response.status == 304) refuse(uri, again.outcome.response);
    return settle(uri, std::move(again));
  }
  const HttpHeaders headers = updated_headers(cached->headers, response.headers);
  const Freshness freshness = freshness_of(headers, response.requested_at_s, response.received_at_s);
  if (freshness.may_store) {
    cache_->refresh(key, {headers, freshness.fresh_until_s, freshness.must_revalidate});
  } else {
    cache_->remove(key);
  }
  return *std::move(body);
}

std::vector<std::byte> HttpSource::settle_answer(const std::string& uri, HttpResponse response) {
  if (response.status != 200) refuse(uri, response);
  if (is_web_page(response)) {
    throw InputError(uri_for_message(uri), "the server answered with a web page, not with the file");
  }
  provider_->learn(uri, response.body);
  if (cache_) keep(uri, response);
  return std::move(response.body);
}

void HttpSource::keep(const std::string& uri, const HttpResponse& response) {
  const std::string key = without_secrets(uri);
  const Freshness freshness = freshness_of(response.headers, response.requested_at_s, response.received_at_s);
  std::vector<std::string> secrets = provider_->secrets();
  // A tileset may carry its session on to its children.
  const std::string_view text = as_text(response.body);
  if (text.find_first_not_of(" \t\r\n\xEF\xBB\xBF") == text.find('{')) {
    for (const char* sign : {"session=", "key=", "token="}) secrets.emplace_back(sign);
  }
  const bool holds_secret = std::any_of(secrets.begin(), secrets.end(), [&](const std::string& secret) {
    return !secret.empty() && text.find(secret) != std::string_view::npos;
  });
  if (freshness.may_store && !holds_secret) {
    writer_->store({key, {response.headers, freshness.fresh_until_s, freshness.must_revalidate}, response.body});
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
    out.push_back(uri_for_message(root_uri_) + ": the server could not be asked about " + std::to_string(used_stale_) +
                  " kept files; they were used as they are in the cache");
  }
  return out;
}

void HttpSource::refuse(const std::string& uri, const HttpResponse& response) const {
  std::string text = "the server answered with status " + std::to_string(response.status);
  if (const std::string meaning = meaning_of(response.status); !meaning.empty()) text += " (" + meaning + ")";
  if (const std::string reason = reason_of(response); !reason.empty()) text += ": " + reason;
  throw InputError(uri_for_message(uri), scrubbed(text, provider_->secrets()));
}

bool HttpSource::prefetch(const std::vector<std::string>& uris) {
  std::unique_lock lock(mutex_);
  const std::set<std::string> kept(uris.begin(), uris.end());
  for (auto it = ahead_.begin(); it != ahead_.end();) {
    it->second.wanted = kept.contains(it->first);
    if (it->second.wanted || !it->second.done) {
      ++it;
      continue;
    }
    held_bytes_ -= it->second.asked.outcome.response.body.size();
    it = ahead_.erase(it);
  }
  wanted_.clear();
  std::set<std::string> listed;
  for (const std::string& uri : uris) {
    if (!is_data_uri(uri) && !ahead_.contains(uri) && listed.insert(uri).second) wanted_.push_back(uri);
  }
  start_ahead(lock);
  return true;
}

bool HttpSource::may_start_ahead() const {
  const auto parallel = static_cast<std::size_t>(options_.http.max_parallel);
  // Twice as many as run at once, so that none of the client's places is ever empty.
  return !wanted_.empty() && under_way_ < 2 * parallel &&
         held_bytes_ + (under_way_ + 1) * largest_bytes_ <= options_.max_ahead_bytes;
}

void HttpSource::start_ahead(std::unique_lock<std::mutex>& lock) {
  while (may_start_ahead()) {
    const std::string uri = wanted_.front();
    wanted_.pop_front();
    if (ahead_.contains(uri)) continue;
    try {
      policy_->check(uri);
    } catch (const InputError&) {
      continue;  // its reader is told
    }
    if (is_fresh_in_cache(uri)) continue;  // its reader finds it there
    ahead_[uri].asked.generation = provider_->generation();
    ++under_way_;
    lock.unlock();
    client_->start(request_for(uri), [this, uri](HttpOutcome outcome) { ahead_done(uri, std::move(outcome)); });
    lock.lock();
  }
}

void HttpSource::ahead_done(const std::string& uri, HttpOutcome outcome) {
  std::unique_lock lock(mutex_);
  --under_way_;
  Ahead& ahead = ahead_.at(uri);
  if (ahead.wanted) {
    const std::uintmax_t bytes = outcome.response.body.size();
    held_bytes_ += bytes;
    largest_bytes_ = std::max(largest_bytes_, bytes);
    ahead.asked.outcome = std::move(outcome);
    ahead.done = true;
  } else {
    ahead_.erase(uri);
  }
  start_ahead(lock);
  changed_.notify_all();
}

std::optional<HttpSource::Asked> HttpSource::take_ahead(const std::string& uri) {
  std::unique_lock lock(mutex_);
  const auto it = ahead_.find(uri);
  if (it == ahead_.end()) {
    std::erase(wanted_, uri);  // it is asked for now
    return std::nullopt;
  }
  it->second.wanted = true;
  changed_.wait(lock, [&] { return !ahead_.contains(uri) || ahead_.at(uri).done; });
  const auto found = ahead_.find(uri);
  if (found == ahead_.end()) return std::nullopt;  // another reader has taken it
  Asked taken = std::move(found->second.asked);
  held_bytes_ -= taken.outcome.response.body.size();
  ahead_.erase(found);
  start_ahead(lock);
  changed_.notify_all();
  return taken;
}

}  // namespace tileflight::tiles
