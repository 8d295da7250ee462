#include "tileflight/tiles/fetch/http_retry.h"

#include <curl/curl.h>

#include <algorithm>
#include <charconv>
#include <string>

namespace tileflight::fetch {

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

}  // namespace tileflight::fetch
