#pragma once

#include <chrono>
#include <cstdint>
#include <ctime>
#include <optional>
#include <string_view>

#include "tileflight/tiles/fetch/http_options.h"

namespace tileflight::fetch {

/// Whether a status may be transient: 408, 425, 429, 500, 502, 503, 504 (RFC 9110, section 15; RFC 6585, 8470).
bool is_retryable_status(long status);

/// Parses a Retry-After header (RFC 9110, section 10.2.3): seconds, or a date, which is taken relative to `now` (0 for
/// a past date). nullopt if it is neither.
std::optional<std::chrono::milliseconds> parse_retry_after(std::string_view text, std::time_t now);

/// Exponential backoff with jitter: before try `tries_done` + 1, a wait between half and all of initial_backoff *
/// 2^(tries_done - 1), at most max_backoff. `random`: any number; its lowest 32 bits choose the jitter.
std::chrono::milliseconds backoff(const RetryOptions& options, int tries_done, std::uint64_t random);

}  // namespace tileflight::fetch
