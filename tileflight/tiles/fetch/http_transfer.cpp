#include "tileflight/tiles/fetch/http_transfer.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <ctime>
#include <utility>

#include "tileflight/core/base/text_parsing.h"
#include "tileflight/tiles/fetch/uri.h"
#include "tileflight/tiles/fetch/url_secrets.h"

namespace tileflight::fetch {
namespace {

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

}  // namespace

HttpTransfer::HttpTransfer(HttpRequest request, Done done, const HttpOptions& options)
    : request_(std::move(request)), done_(std::move(done)), options_(options), due_(Clock::time_point::min()) {}

void HttpTransfer::begin_try(CURL* easy, Clock::time_point now) {
  if (!started_) deadline_ = now + options_.whole_timeout;
  started_ = true;
  ++tries_;
  easy_ = easy;
  outcome_.response = {};
  outcome_.response.url = request_.url;
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
  if (!options_.ca_file.empty()) set(CURLOPT_CAINFO, options_.ca_file.c_str());
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

HttpTransfer::NextStep HttpTransfer::end_try(CURLcode code, Clock::time_point now, std::uint64_t random) {
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

HttpTransfer::NextStep HttpTransfer::end_stalled_try(Clock::time_point now, std::uint64_t random) {
  easy_ = nullptr;
  if (now >= deadline_) return give_up("took longer than " + text_of(options_.whole_timeout));
  return retry(
      "stalled: fewer than " + std::to_string(options_.stall_bytes) + " bytes in " + text_of(options_.stall_timeout),
      std::nullopt, now, random);
}

bool HttpTransfer::is_stalled(Clock::time_point now) {
  if (now >= deadline_) return true;
  if (now - window_start_ < options_.stall_timeout) return false;
  if (window_bytes_ < options_.stall_bytes) return true;
  window_start_ = now;
  window_bytes_ = 0;
  return false;
}

HttpTransfer::Clock::time_point HttpTransfer::next_check() const {
  return std::min(deadline_, window_start_ + options_.stall_timeout);
}

HttpTransfer::NextStep HttpTransfer::follow_redirect(const std::string& target) {
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

HttpTransfer::NextStep HttpTransfer::retry(const std::string& cause, std::optional<milliseconds> asked,
                                           Clock::time_point now, std::uint64_t random) {
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

HttpTransfer::NextStep HttpTransfer::give_up(const std::string& what) {
  outcome_.failure = InputError(uri_for_message(request_.url), what);
  return NextStep::kFinished;
}

std::string HttpTransfer::cause_of(CURLcode code) const {
  const std::string text = error_text_[0] != '\0' ? error_text_ : curl_easy_strerror(code);
  if (code == CURLE_PARTIAL_FILE) {
    return "the connection was closed early, after " + std::to_string(outcome_.response.body.size()) + " bytes";
  }
  return "cannot be fetched: " + text;
}

std::string HttpTransfer::tries_text() const {
  return tries_ > 1 ? " (" + std::to_string(tries_) + " tries)" : std::string();
}

void HttpTransfer::finish() {
  if (done_) std::exchange(done_, {})(std::move(outcome_));
}

void HttpTransfer::fail(const std::string& what) {
  outcome_.failure = InputError(uri_for_message(request_.url), what);
  finish();
}

bool HttpTransfer::take_header(std::string_view line) {
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
  refusal_ = "declares " + value + " bytes, more than the " + std::to_string(options_.max_response_bytes) + " allowed";
  return false;
}

bool HttpTransfer::take_body(const char* data, std::size_t bytes) {
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

std::size_t HttpTransfer::on_header(char* data, std::size_t size, std::size_t count, void* self) {
  return static_cast<HttpTransfer*>(self)->take_header({data, size * count}) ? size * count : 0;
}

std::size_t HttpTransfer::on_body(char* data, std::size_t size, std::size_t count, void* self) {
  return static_cast<HttpTransfer*>(self)->take_body(data, size * count) ? size * count : 0;
}

}  // namespace tileflight::fetch
